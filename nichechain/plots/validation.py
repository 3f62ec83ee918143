"""Figures of validation: lineages beside predictions, rankings of thinned births, grids of several sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nichechain.core.checks import check_whole
from nichechain.core.errors import NichechainError
from nichechain.plots.style import EDGE, FAINT, INK, LONG_JUMP, START, axes_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.validation.direct import DirectCheck
    from nichechain.validation.drift import LevelCourse
    from nichechain.validation.grid_size import Sweep
    from nichechain.validation.stability import RankStability

_COLORS = {"niche": EDGE, "genotype": LONG_JUMP}
_MARKERS = {"niche": "o", "genotype": "D"}


def plot_calibration(check: DirectCheck, ax: Axes | None = None, *, generation: int) -> Axes:
    """Niches reached by each elite's lineages against the chain's prediction, with 90 % intervals.

    Parameters
    ----------
    check : DirectCheck
    ax : matplotlib.axes.Axes, optional
        By default one of its own.
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
    ax = axes_of(ax)
    last = check.reached.shape[1]
    check_whole(generation=generation)
    if not 1 <= generation <= last:
        raise NichechainError(f"generation is {generation}, but must be between 1 and {last}")
    # True is a whole number, but no label.
    generation = int(generation)
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


def plot_reached(check: DirectCheck, ax: Axes | None = None) -> Axes:
    """Niches reached over generations, predicted and real, as means over the elites.

    Parameters
    ----------
    check : DirectCheck
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax)
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


def plot_stability(stability: RankStability, ax: Axes | None = None) -> Axes:
    """Rank correlation of thinned births with all of them, and of halves with each other.

    Parameters
    ----------
    stability : RankStability
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax)
    from nichechain.validation.stability import ENOUGH

    frame = stability.to_frame()
    ax.fill_between(frame["births"], frame["lowest"], frame["highest"], color=EDGE, alpha=0.2, linewidth=0)
    ax.plot(
        frame["births"],
        frame["spearman"],
        color=EDGE,
        marker="o",
        markersize=4,
        label="a part with all births",
    )
    half = stability.all_births / 2
    ax.plot(
        [half] * stability.halves.size,
        stability.halves,
        color=LONG_JUMP,
        marker="D",
        markersize=5,
        linestyle="none",
        label="two halves that share no birth",
    )
    ax.axhline(ENOUGH, color=FAINT, linewidth=1.0, zorder=0)
    what = "elites with their children" if stability.thin == "elite" else "single births"
    ax.set(
        xlim=(0.0, stability.all_births),
        ylim=(min(0.0, float(stability.spearman.min()), float(stability.halves.min())), 1.0),
        xlabel=f"births kept, by leaving out {what}",
        ylabel=f"Spearman, {stability.niches} niches by {stability.l}-evolvability",
        title="Is the ranking of niches settled?",
    )
    ax.tick_params(length=3, color=INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(loc="lower right", frameon=False, fontsize="small")
    return ax


def plot_level(course: LevelCourse, ax: Axes | None = None) -> Axes:
    """Mean l-evolvability by each part of the births alone, and by all up to its end, with 90 % intervals.

    Parameters
    ----------
    course : LevelCourse
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax)
    for x, level, low, high, color, marker, label in (
        (
            course.grown - course.births / 2,
            course.level,
            course.low,
            course.high,
            LONG_JUMP,
            "D",
            "births of a part of the steps alone",
        ),
        (
            course.grown,
            course.grown_level,
            course.grown_low,
            course.grown_high,
            EDGE,
            "o",
            "all births so far",
        ),
    ):
        around = [level - low, high - level]
        ax.errorbar(
            x, level, yerr=around, color=color, marker=marker, markersize=4, elinewidth=0.8, label=label
        )
    ax.set(
        xlim=(0.0, 1.03 * float(course.grown[-1])),
        xlabel="births, in the order of steps",
        ylabel=f"mean {course.l}-evolvability of {course.niches} niches",
        title="Is the level settled?",
    )
    ax.set_ylim(bottom=0.0)
    ax.tick_params(length=3, color=INK)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(loc="lower right", frameon=False, fontsize="small")
    return ax


_GREEN = "#4f8a5b"


def plot_filling(sweep: Sweep, ax: Axes | None = None) -> Axes:
    """The paper's warning: too few niches and children stay, too many and few are visited.

    The suggested grid is marked, and the grid of the search itself.

    Parameters
    ----------
    sweep : Sweep
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax)
    frame = sweep.to_frame()
    for name, color, marker, text in (
        ("staying", LONG_JUMP, "o", "children that stay in their niche"),
        ("self_transition", START, "s", "the same, every row alike"),
        ("visited", EDGE, "o", "niches visited"),
        ("rows_observed", "#7fa8cf", "s", "niches of parents: rows of T observed"),
        ("known", _GREEN, "D", f"time in rows of {sweep.min_births} births"),
    ):
        ax.plot(frame["niches"], frame[name], color=color, marker=marker, markersize=4, label=text)
    ax.set(ylim=(0.0, 1.03), ylabel="share", title="Too few niches, too many niches")
    _finish_sweep(ax, sweep)
    ax.legend(frameon=False, fontsize="x-small", loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
    return ax


def plot_surprise(sweep: Sweep, ax: Axes | None = None) -> Axes:
    """Bits of surprise in a child's niche, and what its parent's niche tells of it.

    Parameters
    ----------
    sweep : Sweep
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax)
    frame = sweep.to_frame()
    niches = frame["niches"]
    ax.plot(
        niches, frame["entropy"], color=INK, marker="o", markersize=4, label="surprise left, given the parent"
    )
    ax.plot(
        niches,
        frame["information"],
        color=_GREEN,
        marker="D",
        markersize=4,
        label="what the parent's niche tells (held out)",
    )
    ax.set(ylabel="bits per birth", title="What the parent's niche tells")
    lowest = min(0.0, 1.1 * float(frame["information"].min()))
    ax.set_ylim(lowest, 1.1 * float(max(frame["entropy"].max(), frame["information"].max())))
    _finish_sweep(ax, sweep)
    ax.legend(frameon=False, fontsize="x-small", loc="upper center", bbox_to_anchor=(0.5, -0.2))
    return ax


def plot_scores(sweep: Sweep, ax: Axes | None = None) -> Axes:
    """l-evolvability of one behavior on every grid, with its 90 % interval.

    Parameters
    ----------
    sweep : Sweep
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax)
    frame = sweep.to_frame()
    niches = frame["niches"]
    place = ", ".join(f"{x:.3g}" for x in sweep.behavior)
    ax.fill_between(niches, frame["low"], frame["high"], color=EDGE, alpha=0.2, linewidth=0)
    ax.plot(
        niches,
        frame["evolvability"],
        color=EDGE,
        marker="o",
        markersize=4,
        label="niches reached, 90 % interval",
    )
    ax.plot(niches, niches, color=FAINT, linewidth=1.0, label="all niches")
    ax.set(
        yscale="log",
        ylabel=f"niches reached in {sweep.l} generations, {sweep.lineages} lineages",
        title=f"{sweep.l}-evolvability of the niche at ({place})",
    )
    _finish_sweep(ax, sweep)
    ax.legend(frameon=False, fontsize="x-small", loc="upper center", bbox_to_anchor=(0.5, -0.2))
    return ax


def _finish_sweep(ax: Axes, sweep: Sweep) -> None:
    """An axis of sizes, with the suggestion and the search's own grid."""
    from matplotlib.ticker import NullLocator

    found = sweep.suggestion
    if found is not None:
        ax.axvline(found.niches, color=_GREEN, linewidth=6.0, alpha=0.2, zorder=0)
    marks = [
        (grid.niches, "×".join(map(str, grid.shape)) if len(grid.shape) < 3 else str(grid.niches))
        for grid in sweep.grids
    ]
    ax.set_xscale("log")
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xticks([at for at, _ in marks], [text for _, text in marks], rotation=90, fontsize="x-small")
    names = [] if found is None else ["band: suggested"]
    if sweep.built is not None:
        size = 1
        for cells in sweep.built:
            size *= cells
        ax.axvline(size, color=FAINT, linewidth=1.0, linestyle=":", zorder=0)
        names.append("dotted: the search's own")
    ax.set_xlabel("grid" + (f" ({', '.join(names)})" if names else ""))
    ax.tick_params(length=3, color=INK)
    ax.spines[["top", "right"]].set_visible(False)
