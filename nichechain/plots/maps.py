"""Maps of niches over behavior space: elites, visits, evolvability, its uncertainty, and reach."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_whole
from nichechain.core.errors import NichechainError
from nichechain.core.text import some
from nichechain.plots.cells import fill, frame, hatch
from nichechain.plots.style import EMPTY, INK, axes_of, behavior_axes, colorbar, key, on_map, without_outliers
from nichechain.search.config import WHO_IS_ELITE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import Collection
    from matplotlib.colors import Normalize

    from nichechain.archive.archive import Archive
    from nichechain.evolvability import NicheEvolvability
    from nichechain.evolvability.reach import Reach
    from nichechain.niches import Niche


def plot_elites(archive: Archive, ax: Axes | None = None) -> Axes:
    """Objective of the elite of every niche, and where each elite really ends.

    A note says which rule made the elites: by default of a build they are not the best.

    Parameters
    ----------
    archive : Archive
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If the archive has no elites, as that of a log, or behavior has more than two axes.

    Notes
    -----
    Colours span the objectives without outliers, those further from the quartiles than three times the
    distance between these (Tukey, "Exploratory Data Analysis", 1977). The colour bar says how many there are.
    """
    ax = axes_of(ax)
    from matplotlib.colors import Normalize
    from matplotlib.lines import Line2D

    elites = archive.elites
    if not len(elites):
        why = ": births of a log were imported" if archive.meta.imported else ""
        raise NichechainError(f"{archive.folder} has no elites to draw{why}")
    inside = elites.niche < len(archive.niches)
    values = np.full(len(archive.niches), np.nan)
    values[elites.niche[inside]] = elites.objective[inside]
    low, high = without_outliers(values)
    mesh = _map(ax, archive, values, "viridis", Normalize(low, high))
    x, y = on_map(elites.behavior[inside])
    ax.plot(x, y, ".", color="white", markersize=3, markeredgecolor="none", alpha=0.9)
    colorbar(ax, mesh, archive.meta.facts.objective_name, values)
    ax.set_title(f"Elites: {archive.filled} of {len(archive.niches)} niches filled")
    handle = Line2D([], [], marker=".", linestyle="none", color="#777777", label="behavior of an elite")
    key(ax, handle, note=f"elites: {WHO_IS_ELITE[archive.config.replacement]} of each niche")
    return ax


def plot_visits(archive: Archive, ax: Axes | None = None) -> Axes:
    """Births in every niche, on a logarithmic scale.

    Parameters
    ----------
    archive : Archive
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax)
    from matplotlib.colors import LogNorm

    visits = archive.counts.visits[: len(archive.niches)].astype(float)
    visits[visits == 0] = np.nan
    largest = np.nanmax(visits) if np.isfinite(visits).any() else 1.0
    mesh = _map(ax, archive, visits, "viridis", LogNorm(1.0, max(2.0, largest)))
    colorbar(ax, mesh, "births")
    births, outside = int(archive.counts.visits.sum()), archive.counts.births_outside
    ax.set_title(f"{some(births, 'birth')}, {outside / max(1, births):.0%} outside")
    key(ax)
    return ax


def plot_evolvability(
    archive: Archive, scores: NicheEvolvability, ax: Axes | None = None, *, min_births: int = 20
) -> Axes:
    """l-evolvability of every niche that was a parent.

    Parameters
    ----------
    archive : Archive
    scores : NicheEvolvability
    ax : matplotlib.axes.Axes, optional
        By default one of its own.
    min_births : int
        Niches with fewer births behind their row of T are hatched: their value is mostly
        the prior's.

    Returns
    -------
    matplotlib.axes.Axes
    """
    ax = axes_of(ax)
    check_whole(min_births=min_births)
    from matplotlib.patches import Patch

    births = archive.counts.births[: len(archive.niches)]
    values = np.where(births > 0, scores.value, np.nan)
    mesh = _map(ax, archive, values, "magma")
    hatch(ax, archive.niches, (births > 0) & (births < min_births), "#ffffff80")
    colorbar(ax, mesh, f"niches reached in {some(scores.l, 'generation')}")
    ax.set_title(f"{scores.l}-evolvability, {some(scores.lineages, 'lineage')}")
    hatched = Patch(facecolor="#888888", hatch="////", edgecolor="white", label=f"under {min_births} births")
    key(ax, hatched, note=f"{scores.estimator}; convention: {scores.convention}; {scores.method}")
    return ax


def _map(
    ax: Axes,
    archive: Archive,
    values: NDArray[np.float64],
    colors: str,
    norm: Normalize | None = None,
) -> Collection:
    """Values of all niches (n,) as colours; NaN is an empty niche."""
    behavior_axes(ax, archive)
    ax.set_facecolor(EMPTY)
    return fill(ax, archive.niches, values, colors, norm)


def plot_uncertainty(archive: Archive, scores: NicheEvolvability, ax: Axes | None = None) -> Axes:
    """Width of the 90 % interval of every niche that was a parent; stands beside the values.

    Parameters
    ----------
    archive : Archive
    scores : NicheEvolvability
        As for :func:`nichechain.plots.plot_evolvability`.
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If T is given, so that there is no interval, or behavior does not have two axes.
    """
    ax = axes_of(ax)
    width = scores.high - scores.low
    if not np.nansum(width):
        raise NichechainError(f"T is given by {scores.estimator}, which leaves no interval to draw")
    births = archive.counts.births[: len(archive.niches)]
    behavior_axes(ax, archive)
    ax.set_facecolor(EMPTY)
    shown = np.where(births > 0, width, np.nan)
    mesh = fill(ax, archive.niches, shown, "cividis")
    colorbar(ax, mesh, "width of the 90 % interval (niches)")
    ax.set_title(
        f"Uncertainty: half of the intervals are under {np.median(width[births > 0]):.1f} niches wide"
    )
    key(ax, note=f"{scores.estimator}; light grey: never a parent")
    return ax


def plot_reach(archive: Archive, reach: Reach, ax: Axes | None = None, *, niche: Niche | None = None) -> Axes:
    """Probability that at least one of U lineages visits each niche.

    Colours follow the square root of the probability, so that rare niches are seen.

    Parameters
    ----------
    archive : Archive
    reach : Reach
        From :func:`nichechain.evolvability.reach.reach`.
    ax : matplotlib.axes.Axes, optional
        By default one of its own.
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
    ax = axes_of(ax)
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
    ax.set_title(f"Reach{whose} in {some(reach.l, 'generation')}: {reach.evolvability:.1f} niches")
    births = "" if reach.births is None else f"; {some(reach.births, 'birth')} behind the row"
    key(ax, *handles, note=f"{reach.estimator}; convention: {reach.convention}{births}")
    return ax
