"""Heat maps over behavior space: elites, visits, evolvability."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_whole
from nichechain.plots.cells import fill, hatch
from nichechain.plots.style import EMPTY, behavior_axes, colorbar, key, on_map

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import Collection
    from matplotlib.colors import Normalize

    from nichechain.archive.archive import Archive
    from nichechain.evolvability import NicheEvolvability


def plot_elites(archive: Archive, ax: Axes) -> Axes:
    """Objective of the elite of every niche, and where each elite really ends.

    Parameters
    ----------
    archive : Archive
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    from matplotlib.lines import Line2D

    elites = archive.elites
    inside = elites.niche < len(archive.niches)
    values = np.full(len(archive.niches), np.nan)
    values[elites.niche[inside]] = elites.objective[inside]
    mesh = _map(ax, archive, values, "viridis")
    x, y = on_map(elites.behavior[inside])
    ax.plot(x, y, ".", color="white", markersize=3, markeredgecolor="none", alpha=0.9)
    colorbar(ax, mesh, archive.meta.facts.objective_name)
    ax.set_title(f"Elites: {archive.filled} of {len(archive.niches)} niches filled")
    key(ax, Line2D([], [], marker=".", linestyle="none", color="#777777", label="behavior of an elite"))
    return ax


def plot_visits(archive: Archive, ax: Axes) -> Axes:
    """Births in every niche, on a logarithmic scale.

    Parameters
    ----------
    archive : Archive
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes
    """
    from matplotlib.colors import LogNorm

    visits = archive.counts.visits[: len(archive.niches)].astype(float)
    visits[visits == 0] = np.nan
    largest = np.nanmax(visits) if np.isfinite(visits).any() else 1.0
    mesh = _map(ax, archive, visits, "viridis", LogNorm(1.0, max(2.0, largest)))
    colorbar(ax, mesh, "births")
    births, outside = archive.meta.births, archive.counts.births_outside
    ax.set_title(f"Births: {births}, {outside / births:.0%} outside")
    key(ax)
    return ax


def plot_evolvability(archive: Archive, scores: NicheEvolvability, ax: Axes, *, min_births: int = 20) -> Axes:
    """l-evolvability of every niche that was a parent.

    Parameters
    ----------
    archive : Archive
    scores : NicheEvolvability
    ax : matplotlib.axes.Axes
    min_births : int
        Niches with fewer births behind their row of T are crossed out: their value is mostly
        the prior's.

    Returns
    -------
    matplotlib.axes.Axes
    """
    check_whole(min_births=min_births)
    from matplotlib.patches import Patch

    births = archive.counts.births[: len(archive.niches)]
    values = np.where(births > 0, scores.value, np.nan)
    mesh = _map(ax, archive, values, "magma")
    hatch(ax, archive.niches, (births > 0) & (births < min_births), "#ffffff80")
    colorbar(ax, mesh, f"niches reached in {scores.l} generations")
    ax.set_title(f"{scores.l}-evolvability, {scores.lineages} lineages")
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
