"""What lineages really reach beside what the chain predicts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nichechain.core.checks import check_whole
from nichechain.core.errors import NichechainError
from nichechain.plots.style import EDGE, FAINT, INK, LONG_JUMP

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.validation.direct import DirectCheck

_COLORS = {"niche": EDGE, "genotype": LONG_JUMP}
_MARKERS = {"niche": "o", "genotype": "D"}


def plot_calibration(check: DirectCheck, ax: Axes, *, generation: int) -> Axes:
    """Niches reached by each elite's lineages against the chain's prediction, with 90 % intervals.

    Parameters
    ----------
    check : DirectCheck
    ax : matplotlib.axes.Axes
    generation : int
        Niches reached up to this generation, between 1 and l.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If there is no such generation.
    """
    last = check.reached.shape[1]
    check_whole(generation=generation)
    if not 1 <= generation <= last:
        raise NichechainError(f"generation is {generation}, but must be between 1 and {last}")
    k = generation - 1
    summary = check.summary().set_index(["start", "generation"])
    reached = check.reached[:, k]
    top = float(reached.max())
    for prediction in check.predictions:
        low, high = (bound[:, k] for bound in prediction.interval)
        value = prediction.value[:, k]
        correlation = summary.loc[(prediction.start, generation), "spearman"]
        # The value is a mean over draws of T, which need not lie between the quantiles.
        around = np.maximum(0.0, [value - low, high - value])
        ax.errorbar(
            value,
            reached,
            xerr=around,
            fmt=_MARKERS[prediction.start],
            color=_COLORS[prediction.start],
            ecolor=_COLORS[prediction.start] + "55",
            markersize=4,
            elinewidth=0.8,
            label=f"from the {prediction.start}: Spearman {correlation:.2f}",
        )
        top = max(top, float(high.max()))
    ax.plot([0.0, top], [0.0, top], color=FAINT, linewidth=1.0, zorder=0)
    generations = "1 generation" if generation == 1 else f"{generation} generations"
    ax.set(
        xlim=(0.0, 1.04 * top),
        ylim=(0.0, 1.04 * top),
        aspect="equal",
        xlabel="niches predicted (90 % interval)",
        ylabel=f"niches reached by {check.lineages.states.shape[1]} lineages",
        title=generations,
    )
    _finish(ax)
    return ax


def plot_reached(check: DirectCheck, ax: Axes) -> Axes:
    """Niches reached over generations, predicted and real, as means over the elites.

    Parameters
    ----------
    check : DirectCheck
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    generations = np.arange(1, check.reached.shape[1] + 1)
    mean = check.reached.mean(axis=0)
    error = check.reached.std(axis=0, ddof=1) / np.sqrt(len(check.reached))
    ax.errorbar(
        generations,
        mean,
        yerr=error,
        color=INK,
        marker="s",
        markersize=4,
        capsize=2,
        label="reached (± s.e.)",
    )
    for prediction in check.predictions:
        ax.plot(
            generations,
            prediction.value.mean(axis=0),
            color=_COLORS[prediction.start],
            marker=_MARKERS[prediction.start],
            markersize=4,
            linestyle="--",
            label=f"predicted from the {prediction.start}",
        )
    ax.set(
        xticks=generations,
        ylim=(0.0, None),
        xlabel="generations",
        ylabel=f"niches, mean over {len(check.reached)} elites",
        title="Prediction and reality",
    )
    _finish(ax)
    return ax


def _finish(ax: Axes) -> None:
    ax.tick_params(length=3, color=INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), frameon=False, fontsize="small")
