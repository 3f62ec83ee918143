"""How much births leave open of every niche's l-evolvability."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nichechain.core.errors import NichechainError
from nichechain.plots.cells import fill
from nichechain.plots.style import EMPTY, behavior_axes, colorbar, key

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.archive.archive import Archive
    from nichechain.evolvability import NicheEvolvability


def plot_uncertainty(archive: Archive, scores: NicheEvolvability, ax: Axes) -> Axes:
    """Width of the 90 % interval of every niche that was a parent; stands beside the values.

    Parameters
    ----------
    archive : Archive
    scores : NicheEvolvability
        As for :func:`nichechain.plots.plot_evolvability`.
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If T is given, so that there is no interval, or behavior does not have two axes.
    """
    width = scores.high - scores.low
    if not width.any():
        raise NichechainError(f"T is given by {scores.estimator}, which leaves no interval to draw")
    births = archive.counts.births[: len(archive.niches)]
    behavior_axes(ax, archive)
    ax.set_facecolor(EMPTY)
    shown = np.where(births > 0, width, np.nan)
    mesh = fill(ax, archive.niches, shown, "cividis")
    colorbar(ax, mesh, "width of the 90 % interval (niches)")
    ax.set_title(f"Uncertainty: {np.median(width[births > 0]):.1f} niches in the middle")
    key(ax, note=f"{scores.estimator}; grey: never a parent")
    return ax
