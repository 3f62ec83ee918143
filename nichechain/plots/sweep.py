"""Grids of several sizes over the same births: which they fill, and what they tell."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain.plots.style import EDGE, FAINT, INK, LONG_JUMP, START

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.validation.grid_size import Sweep

_GREEN = "#4f8a5b"


def plot_filling(sweep: Sweep, ax: Axes) -> Axes:
    """The paper's warning: too few niches and children stay, too many and few are visited.

    The suggested grid is marked, and the grid of the search itself.

    Parameters
    ----------
    sweep : Sweep
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
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
    _finish(ax, sweep)
    ax.legend(frameon=False, fontsize="x-small", loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)
    return ax


def plot_surprise(sweep: Sweep, ax: Axes) -> Axes:
    """Bits of surprise in a child's niche, and what its parent's niche tells of it.

    Parameters
    ----------
    sweep : Sweep
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
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
    _finish(ax, sweep)
    ax.legend(frameon=False, fontsize="x-small", loc="upper center", bbox_to_anchor=(0.5, -0.2))
    return ax


def plot_scores(sweep: Sweep, ax: Axes) -> Axes:
    """l-evolvability of one behavior on every grid, with its 90 % interval.

    Parameters
    ----------
    sweep : Sweep
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
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
    _finish(ax, sweep)
    ax.legend(frameon=False, fontsize="x-small", loc="upper center", bbox_to_anchor=(0.5, -0.2))
    return ax


def _finish(ax: Axes, sweep: Sweep) -> None:
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
