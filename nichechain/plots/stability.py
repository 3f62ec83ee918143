"""How the ranking of niches settles as births accumulate."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain.plots.style import EDGE, FAINT, INK, LONG_JUMP

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.validation.stability import RankStability


def plot_stability(stability: RankStability, ax: Axes) -> Axes:
    """Rank correlation of thinned births with all of them, and of halves with each other.

    Parameters
    ----------
    stability : RankStability
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
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
