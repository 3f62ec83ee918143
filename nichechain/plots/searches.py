"""Curves of searches that are compared: niches filled against births, with bands over runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from nichechain.core.checks import as_tuple, check_choice
from nichechain.core.intervals import mean_interval
from nichechain.plots.style import EDGE, LONG_JUMP, START, check_records, plain

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

# Told apart by line style as well as by hue.
_COLORS = ("#4a4a4a", START, EDGE, LONG_JUMP, "#3a7d44", "#7a4fa3")
_STYLES = ("-", "--", "-", "-.", ":", (0, (5, 1)))


def plot_filled(records: pd.DataFrame, ax: Axes, *, selections: Sequence[str] | None = None) -> Axes:
    """Niches filled against births, a line for each selection of parents with its 95 % band over runs.

    Parameters
    ----------
    records : DataFrame
        Columns ``selection``, ``run``, ``births`` and ``filled``, such as of
        :func:`nichechain.studies.searches.read_searches`.
    ax : matplotlib.axes.Axes
    selections : sequence of str, optional
        Which, and in which order; by default all as they come.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If a column is missing or there is no search of a selection.
    """
    check_records(records, "selection", "run", "births", "filled")
    names = dict.fromkeys(records["selection"]) if selections is None else as_tuple("selections", selections)
    for number, name in enumerate(names):
        check_choice("selections", name, records["selection"].unique())
        rows = records[records["selection"] == name]
        table = rows.pivot_table(index="births", columns="run", values="filled")
        mean, low, high = mean_interval(table.to_numpy().T)
        color = _COLORS[number % len(_COLORS)]
        ax.plot(table.index, mean, color=color, linestyle=_STYLES[number % len(_STYLES)], label=plain(name))
        if np.isfinite(low).all():
            ax.fill_between(table.index, low, high, color=color, alpha=0.18, linewidth=0)
    ax.set(xlabel="births", ylabel="niches filled", xlim=(0, records["births"].max()), ylim=(0, None))
    ax.legend(frameon=False, loc="lower right")
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    return ax
