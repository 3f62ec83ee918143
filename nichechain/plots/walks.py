"""Walks: a measure over their steps, and where each run stands at one of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import as_tuple, check_choice, check_text, check_whole
from nichechain.core.errors import NichechainError
from nichechain.core.intervals import mean_interval
from nichechain.core.text import some
from nichechain.plots.style import FAINT, INK, axes_of, check_records, plain

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DRAWN: Mapping[str, str] = {
    "expected_evolvability": "expected evolvability η*",
    "evolvability": "evolvability η",
    "coverage": "coverage d/n of the offspring",
    "population_evolvability": "population evolvability ρ*",
}
"""Measures of a walk that are drawn, the mean over its states, and their labels."""
_OF_STATES = ("expected_evolvability", "evolvability", "coverage")

# Okabe and Ito's colours in an order of which neighbours differ in lightness as well.
_COLORS = ("#000000", "#e69f00", "#0072b2", "#56b4e9", "#d55e00", "#cc79a7", "#009e73")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
# More bands than these lie on each other.
_MOST_BANDS = 3
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (5, 1.5, 1.2, 1.5)))


@dataclass(frozen=True)
class LineStyle:
    """How a condition is drawn: its colour, and what tells it from the others in grey."""

    color: str
    marker: str
    dashes: Any


def line_styles(conditions: Sequence[str], *, ordered: bool = False) -> dict[str, LineStyle]:
    """One style per condition.

    Parameters
    ----------
    conditions : sequence of str
    ordered : bool
        Whether they are levels of one thing: then from dark to light along one scale.

    Returns
    -------
    dict of str to LineStyle
    """
    import matplotlib as mpl
    from matplotlib.colors import to_hex

    if ordered or len(conditions) > len(_COLORS):
        # The lightest end of the scale would vanish on white.
        scale = mpl.colormaps["viridis"](np.linspace(0.0, 0.88, len(conditions)))
        colors = [to_hex(color) for color in scale]
    else:
        colors = list(_COLORS)
    return {
        label: LineStyle(colors[k], _MARKERS[k % len(_MARKERS)], _DASHES[k % len(_DASHES)])
        for k, label in enumerate(conditions)
    }


def plot_walks(
    records: pd.DataFrame,
    ax: Axes | None = None,
    *,
    measure: str = "expected_evolvability",
    conditions: Sequence[str] | None = None,
    ordered: bool = False,
    unit: str = "",
) -> Axes:
    """Mean of a measure at each step, with its 95 % t-interval over runs: a band, or bars for over three.

    Parameters
    ----------
    records : DataFrame
        Of :func:`nichechain.studies.read_records`.
    ax : matplotlib.axes.Axes, optional
        By default one of its own.
    measure : str
        One of :data:`DRAWN`.
    conditions : sequence of str, optional
        Which, in the order of the legend; by default all, as they come.
    ordered : bool
        Whether they are levels of one thing, see :func:`line_styles`.
    unit : str
        Unit of behavior; coverage has none.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If there is no such measure or condition.

    Notes
    -----
    Source: the paper's figures of both experiments. A condition with a single run has no band.
    """
    ax = axes_of(ax)
    labels = _labels(records, measure, conditions)
    check_text(unit=unit)
    for place, (label, style) in enumerate(line_styles(labels, ordered=ordered).items()):
        table = _pivot(records, label, measure)
        mean, low, high = mean_interval(table.to_numpy(np.float64))
        steps = table.columns.to_numpy()
        if len(labels) <= _MOST_BANDS:
            ax.fill_between(steps, low, high, color=style.color, alpha=0.13, linewidth=0)
        else:
            # Bands on each other are a blur: bars at some steps, each condition's beside the others'.
            every = max(len(labels), len(steps) // 8)
            at = slice(place, None, every)
            error = np.maximum(np.stack([mean - low, high - mean])[:, at], 0.0)
            ax.errorbar(
                steps[at], mean[at], error, color=style.color, fmt="none", elinewidth=1.0, capsize=2.0
            )
        ax.plot(
            steps,
            mean,
            color=style.color,
            linestyle=style.dashes,
            marker=style.marker,
            # Each at steps of its own, so that none hides another's.
            markevery=(place, max(len(labels), len(steps) // 8)),
            markersize=5.5,
            markeredgecolor="white",
            markeredgewidth=0.4,
            linewidth=1.4,
            label=f"{plain(label)} ({some(len(table), 'run')})",
        )
    ax.set(xlabel="step", ylabel=_axis(measure, unit), xlim=(0, max(1, int(records["step"].max()))))
    # No measure is ever negative, though an interval may reach below.
    ax.set_ylim(bottom=max(0.0, ax.get_ylim()[0]))
    _finish(ax)
    return ax


def plot_runs(
    records: pd.DataFrame,
    ax: Axes | None = None,
    *,
    step: int,
    measure: str = "expected_evolvability",
    conditions: Sequence[str] | None = None,
    ordered: bool = False,
    unit: str = "",
) -> Axes:
    """Every run at one step, with the quartiles of each condition.

    Parameters
    ----------
    records, ax, measure, conditions, ordered, unit
        As in :func:`plot_walks`.
    step : int

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If there is no such measure, condition or step.
    """
    ax = axes_of(ax)
    labels = _labels(records, measure, conditions)
    check_text(unit=unit)
    _check_step(records, step)
    for place, (label, style) in enumerate(line_styles(labels, ordered=ordered).items()):
        values = _pivot(records, label, measure)[step].dropna().to_numpy(np.float64)
        box = ax.boxplot(
            [values],
            positions=[place],
            widths=0.55,
            whis=(0, 100),
            showcaps=False,
            showfliers=False,
            patch_artist=True,
            medianprops={"color": INK, "linewidth": 1.6},
            whiskerprops={"color": FAINT},
            boxprops={"edgecolor": style.color, "linewidth": 1.0},
        )
        box["boxes"][0].set_facecolor(f"{style.color}22")
        ax.plot(
            place + _spread(values),
            values,
            linestyle="none",
            marker=style.marker,
            markersize=3.5,
            color=style.color,
            alpha=0.75,
            markeredgewidth=0,
        )
    labels = [plain(label) for label in labels]
    # The name of what varies once, not at every tick; words under each other need less room.
    varied = {label.partition(" ")[0] for label in labels if " " in label}
    if len(varied) == 1 and all(" " in label for label in labels):
        ax.set_xlabel(varied.pop())
        labels = [label.partition(" ")[2] for label in labels]
    ticks = [label.replace("-", "-\n").replace(":", ":\n").replace(" ", "\n") for label in labels]
    ax.set_xticks(range(len(labels)), ticks, fontsize="small" if len(labels) > 6 else None)
    ax.set(xlim=(-0.6, len(labels) - 0.4), ylabel=_axis(measure, unit))
    # Runs of no evolvability at all would lie hidden under the axis.
    ax.set_ylim(bottom=-0.03 * ax.get_ylim()[1])
    _finish(ax)
    return ax


def draw_study(
    records: pd.DataFrame,
    *,
    step: int,
    conditions: Sequence[str] | None = None,
    ordered: bool = False,
    unit: str = "",
    title: str = "",
    main: str = "expected_evolvability",
) -> Figure:
    """All of a study in one figure: a measure over the steps, every run at one step, and two others.

    Parameters
    ----------
    records, conditions, ordered, unit
        As in :func:`plot_walks`.
    step : int
        Step of the panel of runs.
    title : str
    main : str
        The measure; below it are two of η*, η and d/n.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    NichechainError
        As :func:`plot_walks` and :func:`plot_runs`.
    """
    from matplotlib.figure import Figure

    check_choice("main", main, DRAWN)
    check_text(title=title)
    _labels(records, main, conditions)
    _check_step(records, step)
    if not records["step"].any():
        return _draw_starts(records, conditions=conditions, ordered=ordered, unit=unit, title=title)
    figure = Figure(figsize=(11.0, 8.6), layout="constrained")
    axes = figure.subplots(2, 2, gridspec_kw={"height_ratios": (1.25, 1.0)})
    plot_walks(records, axes[0, 0], measure=main, conditions=conditions, ordered=ordered, unit=unit)
    axes[0, 0].set_title("mean over runs and 95 % t-interval", fontsize="medium")
    plot_runs(records, axes[0, 1], step=step, measure=main, conditions=conditions, ordered=ordered, unit=unit)
    axes[0, 1].set_title(f"every run at step {step}, median and quartiles", fontsize="medium")
    first = "evolvability" if main == "expected_evolvability" else "expected_evolvability"
    for ax, measure in zip(axes[1], (first, "coverage"), strict=True):
        plot_walks(records, ax, measure=measure, conditions=conditions, ordered=ordered, unit=unit)
    figure.legend(
        *axes[0, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=min(records["condition"].nunique(), _columns(records["condition"].unique())),
        frameon=False,
        handlelength=3.2,
        fontsize="small",
    )
    figure.suptitle(plain(title))
    return figure


def _draw_starts(
    records: pd.DataFrame, *, conditions: Sequence[str] | None, ordered: bool, unit: str, title: str
) -> Figure:
    """Walks of no step have no curves: every run by each measure."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15.0, 4.6), layout="constrained")
    for ax, measure in zip(figure.subplots(1, 3), _OF_STATES, strict=True):
        plot_runs(records, ax, step=0, measure=measure, conditions=conditions, ordered=ordered, unit=unit)
    figure.suptitle(f"{plain(title)}: every run at step 0, median and quartiles")
    return figure


def _columns(labels: Sequence[str]) -> int:
    """Columns of a legend that the figure has room for."""
    return max(1, min(6, 140 // (22 + max(map(len, labels)))))


def _labels(records: pd.DataFrame, measure: str, conditions: Sequence[str] | None) -> list[str]:
    check_choice("measure", measure, DRAWN)
    check_records(records, "condition", "run", "step", measure)
    there = list(dict.fromkeys(records["condition"]))
    if not there:
        raise NichechainError("there are no finished walks to draw")
    labels = there if conditions is None else list(dict.fromkeys(as_tuple("conditions", conditions)))
    for label in labels:
        check_choice("condition", label, there)
    return labels


def _check_step(records: pd.DataFrame, step: int) -> None:
    check_whole(step=step)
    if step not in set(records["step"]):
        raise NichechainError(f"step is {step}, but the walks have steps 0 to {records['step'].max()}")


def _pivot(records: pd.DataFrame, label: str, measure: str) -> pd.DataFrame:
    """One row per run, one column per step; the mean over the states of a walk."""
    rows = records[records["condition"] == label]
    return rows.groupby(["run", "step"])[measure].mean().unstack()


def _spread(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places beside each other for runs of similar values, the same for the same values."""
    order = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    # Multiples of the golden ratio spread any number of neighbours in rank evenly.
    return np.asarray(0.4 * ((order * 0.6180339887) % 1.0 - 0.5))


def _axis(measure: str, unit: str) -> str:
    return f"{DRAWN[measure]} ({plain(unit)})" if unit and measure != "coverage" else DRAWN[measure]


def _finish(ax: Axes) -> None:
    ax.tick_params(length=3, color=INK)
    ax.spines[["top", "right"]].set_visible(False)
