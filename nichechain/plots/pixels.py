"""T as an image of no more pixels than can be seen: each shows the largest of some entries, or one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.evolvability.question import dense

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

    from nichechain.chain import NicheChain

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SMALLEST = 1e-3
"""Probabilities below this are left white."""

# Pixels along an axis, and rows of T that are made at once.
_MOST, _ROWS = 2_000, 256


def show_entries(
    ax: Axes, chain: NicheChain, rows: Ints, columns: Ints, **options: object
) -> tuple[AxesImage, str]:
    """Draw T between some states, one unit of the axes to a state.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
    chain : NicheChain
    rows, columns : (r,), (c,) int64 arrays
        States of the parent and of the child, in the order in which they are drawn. Of a state -1 the row is
        left white.
    **options
        Of ``imshow``.

    Returns
    -------
    matplotlib.image.AxesImage
    str
        What a pixel shows, where that is more than one entry: for the title.
    """
    from matplotlib.colors import LogNorm

    shown, size = largest_entries(chain, rows, columns)
    height, width = (size * pixels for pixels in shown.shape)
    picture = ax.imshow(
        np.ma.masked_less(shown, SMALLEST),
        norm=LogNorm(SMALLEST, 1.0),
        cmap="viridis_r",
        interpolation="nearest",
        extent=(-0.5, width - 0.5, height - 0.5, -0.5),
        **options,  # type: ignore[arg-type]
    )
    ax.set(xlim=(-0.5, columns.size - 0.5), ylim=(rows.size - 0.5, -0.5), facecolor="white")
    return picture, f"a pixel: the largest of {size} × {size} entries" if size > 1 else ""


def largest_entries(chain: NicheChain, rows: Ints, columns: Ints) -> tuple[Floats, int]:
    """The largest entry of T in each square of k × k states, and k: 1 where all entries can be seen.

    Parameters
    ----------
    chain, rows, columns
        As in :func:`show_entries`.

    Returns
    -------
    (⌈r / k⌉, ⌈c / k⌉) float64 array
    int
    """
    size = max(1, -(-max(rows.size, columns.size) // _MOST))
    starts = np.arange(0, columns.size, size)
    found = np.zeros((-(-rows.size // size), starts.size))
    step = size * max(1, _ROWS // size)
    for first in range(0, rows.size, step):
        some = rows[first : first + step]
        known = np.flatnonzero(some >= 0)
        part = np.zeros((some.size, columns.size))
        # Only the rows that are shown are made: of many states, T does not fit in memory as a matrix.
        part[known] = dense(chain.operator[some[known]])[:, columns]
        part = np.maximum.reduceat(part, starts, axis=1)
        pixels = np.maximum.reduceat(part, np.arange(0, some.size, size), axis=0)
        found[first // size : first // size + len(pixels)] = pixels
    return found, size
