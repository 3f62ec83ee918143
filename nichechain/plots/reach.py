"""Where the descendants of a niche go, as a map."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain.plots.cells import fill, frame
from nichechain.plots.style import EMPTY, INK, behavior_axes, colorbar, key

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.archive.archive import Archive
    from nichechain.evolvability.reach import Reach
    from nichechain.niches import Niche


def plot_reach(archive: Archive, reach: Reach, ax: Axes, *, niche: Niche | None = None) -> Axes:
    """Probability that at least one of U lineages visits each niche.

    Colours follow the square root of the probability, so that rare niches are seen.

    Parameters
    ----------
    archive : Archive
    reach : Reach
        From :func:`nichechain.evolvability.reach.reach`.
    ax : matplotlib.axes.Axes
    niche : int or tuple of int, optional
        Where the root stands, to frame it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If there is no such niche, or behavior does not have two axes.
    """
    from matplotlib.colors import PowerNorm
    from matplotlib.patches import Patch

    behavior_axes(ax, archive)
    ax.set_facecolor(EMPTY)
    mesh = fill(ax, archive.niches, reach.at_least_one, "Blues", PowerNorm(0.5, 0.0, 1.0))
    lineages = "the lineage" if reach.lineages == 1 else f"one of {reach.lineages} lineages"
    colorbar(ax, mesh, f"probability that {lineages} visits")
    handles = []
    whose = ""
    if niche is not None:
        state = archive.niches.flat(niche)
        frame(ax, archive.niches, state)
        whose = f" from niche {archive.niches.label(state)}"
        handles.append(Patch(fill=False, edgecolor=INK, linewidth=2.0, label="the root's niche"))
    generations = "1 generation" if reach.l == 1 else f"{reach.l} generations"
    ax.set_title(f"Reach{whose} in {generations}: {reach.evolvability:.1f} niches")
    births = "" if reach.births is None else f"; {reach.births} births behind the row"
    key(ax, *handles, note=f"{reach.estimator}; convention: {reach.convention}{births}")
    return ax
