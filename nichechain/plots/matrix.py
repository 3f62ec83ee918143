"""The transition matrix as a picture."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from nichechain.core.errors import NichechainError
from nichechain.core.text import some
from nichechain.niches import GridNiches
from nichechain.plots.cells import cells_along
from nichechain.plots.pixels import SMALLEST, show_entries
from nichechain.plots.style import EMPTY, INK, axes_of, colorbar, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.archive.archive import Archive
    from nichechain.chain import NicheChain
    from nichechain.niches import Niches

# Letters of a line of the title.
_TITLE = 54


def plot_transitions(archive: Archive, chain: NicheChain, ax: Axes | None = None) -> Axes:
    """T between the states that births speak of, in the order of the grid or of the first axis.

    The outside state comes last.

    Parameters
    ----------
    archive : Archive
    chain : NicheChain
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If no birth has a parent.
    """
    ax = axes_of(ax)
    counts = archive.counts
    rows = _in_order(archive.niches, np.flatnonzero(counts.births))
    columns = _in_order(archive.niches, np.flatnonzero(counts.visits))
    if not rows.size:
        raise NichechainError(f"{archive.folder} has no births with a parent: there is no T to draw")
    picture, pixel = show_entries(ax, chain, rows, columns, aspect="auto")
    ax.xaxis.set_ticks(*_ticks(archive, columns), rotation=90, fontsize="x-small")
    ax.yaxis.set_ticks(*_ticks(archive, rows), fontsize="x-small")
    name, unit = archive.meta.facts.behavior_names[0], archive.meta.facts.unit
    order = plain(f"by {name} of its centre ({unit})")
    ax.set(xlabel=f"niche of the child, {order}", ylabel=f"niche of the parent, {order}")
    # Niches of one column of the grid stand together: their borders show how far children jump.
    for axis, states in ((ax.axhline, rows), (ax.axvline, columns)):
        for border in np.flatnonzero(np.diff(_first_index(archive, states))):
            axis(border + 0.5, color=EMPTY, linewidth=0.6, zorder=0.5)
    colorbar(ax, picture, f"probability (white: under {SMALLEST:g})")
    ax.set_title(
        "\n".join(
            [
                f"T: {some(rows.size, 'row')} with births, {some(columns.size, 'state')} visited",
                *textwrap.wrap(chain.estimator, _TITLE),
                *([pixel] if pixel else []),
            ]
        ),
        fontsize="medium",
    )
    ax.tick_params(length=2, color=INK)
    return ax


def _in_order(niches: Niches, states: np.ndarray) -> np.ndarray:
    """States in the order of their places along axis 0; outside comes after."""
    if isinstance(niches, GridNiches):
        return states
    along = np.append(niches.centers[:, 0], np.inf)
    ordered: np.ndarray = states[np.argsort(along[states], kind="stable")]
    return ordered


def _columns(niches: Niches) -> int:
    """Columns along axis 0: those of a grid, or slices as wide as a niche."""
    return niches.shape[0] if isinstance(niches, GridNiches) else cells_along(niches)


def _first_index(archive: Archive, states: np.ndarray) -> np.ndarray:
    """Column of each state along axis 0; outside comes after."""
    niches = archive.niches
    columns = _columns(niches)
    if isinstance(niches, GridNiches):
        return np.array([columns if s == len(niches) else niches.index(int(s))[0] for s in states])
    low, high = niches.bounds[0]
    slices = np.minimum((niches.centers[:, 0] - low) / (high - low) * columns, columns - 1).astype(int)
    found: np.ndarray = np.append(slices, columns)[states]
    return found


def _ticks(archive: Archive, states: np.ndarray) -> tuple[list[float], list[str]]:
    """A tick in the middle of the niches of each column of the grid, or of some of them."""
    first = _first_index(archive, states)
    (low, high), cells = archive.niches.bounds[0], _columns(archive.niches)
    middles = {k: float(np.flatnonzero(first == k).mean()) for k in np.unique(first)}
    centers = {k: f"{low + (k + 0.5) * (high - low) / cells:.3g}" for k in range(cells)}
    labels = {k: centers.get(int(k), "outside") for k in middles}
    kept: list[float] = []
    names: list[str] = []
    for k, middle in middles.items():
        # Narrow columns would write over each other; outside is always named.
        if kept and middle - kept[-1] <= len(states) / 40:
            if labels[k] != "outside":
                continue
            kept.pop()
            names.pop()
        kept.append(middle)
        names.append(labels[k])
    return kept, names
