"""Niches as patches of a map: cells of a grid, Voronoi cells, or pieces of a line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.niches import GridNiches
from nichechain.plots.style import EMPTY, INK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import Collection
    from matplotlib.colors import Colormap, Normalize

    from nichechain.niches import Niches

Floats = NDArray[np.float64]

# A centroid on the edge of the box would fall together with its mirror image.
_INWARD = 1e-9


def fill(
    ax: Axes,
    niches: Niches,
    values: ArrayLike,
    colors: str | Colormap,
    norm: Normalize | None = None,
    *,
    edge: str = "white",
    width: float = 0.3,
) -> Collection:
    """Values of all niches (n,) as colours; NaN is left out.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    niches : Niches
        Of one or two axes of behavior.
    values : (n,) array
    colors : str or Colormap
    norm : Normalize, optional
    edge : str
        Colour of the borders.
    width : float
        Of the borders, in points.
    """
    shown = np.ma.masked_invalid(np.asarray(values, np.float64))
    drawn = _mesh(niches, shown)
    if drawn is not None:
        return ax.pcolormesh(*drawn, cmap=colors, norm=norm, edgecolors=edge, linewidth=width)
    from matplotlib.collections import PolyCollection

    cells = PolyCollection(
        voronoi_cells(niches), array=shown, cmap=colors, norm=norm, edgecolors=edge, linewidths=width
    )
    cells.autoscale_None()
    ax.add_collection(cells, autolim=False)
    return cells


def hatch(ax: Axes, niches: Niches, where: NDArray[np.bool_], color: str) -> Collection:
    """Hatch some of the niches (n,)."""
    drawn = _mesh(niches, np.ma.masked_invalid(np.where(where, 1.0, np.nan)))
    if drawn is not None:
        return ax.pcolor(*drawn, facecolor="none", hatch="////", edgecolor=color, linewidth=0)
    from matplotlib.collections import PolyCollection

    some = [cell for cell, chosen in zip(voronoi_cells(niches), where, strict=True) if chosen]
    cells = PolyCollection(some, facecolors="none", hatch="////", edgecolors=color, linewidths=0)
    ax.add_collection(cells, autolim=False)
    return cells


def borders(ax: Axes, niches: Niches) -> None:
    """Faint borders of the niches of two axes of behavior."""
    if isinstance(niches, GridNiches):
        (left, right), (bottom, top) = niches.bounds
        x, y = edges(niches)
        ax.vlines(x, bottom, top, color=EMPTY, linewidth=0.5, zorder=0)
        ax.hlines(y, left, right, color=EMPTY, linewidth=0.5, zorder=0)
        return
    from matplotlib.collections import PolyCollection

    outlines = PolyCollection(
        voronoi_cells(niches), facecolors="none", edgecolors=EMPTY, linewidths=0.5, zorder=0
    )
    ax.add_collection(outlines, autolim=False)


def frame(ax: Axes, niches: Niches, niche: int) -> None:
    """Frame one niche."""
    from matplotlib.patches import Patch, Polygon, Rectangle

    # White below black is seen on any colour.
    for color, width in (("white", 4.0), (INK, 2.0)):
        patch: Patch
        if len(niches.bounds) == 1:
            x, order = _line(niches)
            k = int(np.flatnonzero(order == niche)[0])
            patch = Rectangle((float(x[k]), 0.0), float(x[k + 1] - x[k]), 1.0)
        elif isinstance(niches, GridNiches):
            x, y = edges(niches)
            i, j = niches.index(niche)
            corner = float(x[i]), float(y[j])
            patch = Rectangle(corner, float(x[1] - x[0]), float(y[1] - y[0]))
        else:
            patch = Polygon(voronoi_cells(niches)[niche])
        patch.set(fill=False, edgecolor=color, linewidth=width, zorder=8)
        ax.add_patch(patch)


def cells_along(niches: Niches) -> int:
    """Cells along an axis: the most of a grid, about the number of other niches."""
    if isinstance(niches, GridNiches):
        return max(niches.shape)
    along: int = round(float(len(niches)) ** (1.0 / len(niches.bounds)))
    return max(1, along)


def edges(niches: GridNiches) -> tuple[Floats, Floats]:
    """Borders of the cells along the two axes."""
    (left, right), (bottom, top) = niches.bounds
    columns, rows = niches.shape
    return np.linspace(left, right, columns + 1), np.linspace(bottom, top, rows + 1)


def voronoi_cells(niches: Niches) -> list[Floats]:
    """Corners of the Voronoi cell of each centre within the bounds, in two axes of behavior.

    Notes
    -----
    The centres are mirrored at the four sides of the box: the border between a centre and its
    image is that side, so that every cell ends there.
    """
    from scipy.spatial import Voronoi

    lower, upper = niches.lower, niches.upper
    inward = _INWARD * (upper - lower)
    centers = np.clip(niches.centers, lower + inward, upper - inward)
    images = [centers]
    for axis in range(2):
        for side in (lower[axis], upper[axis]):
            mirrored = centers.copy()
            mirrored[:, axis] = 2.0 * side - mirrored[:, axis]
            images.append(mirrored)
    diagram = Voronoi(np.concatenate(images))
    cells = []
    for center, region in zip(centers, diagram.point_region, strict=False):
        corners = diagram.vertices[diagram.regions[region]]
        around = np.argsort(np.arctan2(*(corners - center).T[::-1]))
        cells.append(np.clip(corners[around], lower, upper))
    return cells


def _mesh(niches: Niches, values: np.ma.MaskedArray) -> tuple[Floats, Floats, np.ma.MaskedArray] | None:
    """Borders and values of rectangular cells; None where cells are not rectangles."""
    if len(niches.bounds) == 1:
        x, order = _line(niches)
        return x, np.array([0.0, 1.0]), values[order][None, :]
    if isinstance(niches, GridNiches):
        # Axis 0 of the grid is x, but rows of a picture run along y.
        return *edges(niches), values.reshape(niches.shape).T
    return None


def _line(niches: Niches) -> tuple[Floats, NDArray[np.int64]]:
    """Borders of niches along the one axis, (n + 1,), and the niches in the order of places, (n,)."""
    ((low, high),) = niches.bounds
    if isinstance(niches, GridNiches):
        return np.linspace(low, high, len(niches) + 1), np.arange(len(niches))
    order = np.argsort(niches.centers[:, 0])
    places = niches.centers[order, 0]
    return np.concatenate([[low], (places[1:] + places[:-1]) / 2.0, [high]]), order
