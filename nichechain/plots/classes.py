"""Communicating classes: niches that all lead to one another, as a map and as an order of T."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.chain.structure.classes import communicating_classes, recurrent_classes
from nichechain.core.errors import NichechainError
from nichechain.core.text import some
from nichechain.plots.cells import cells_along, fill, hatch
from nichechain.plots.pixels import SMALLEST, show_entries
from nichechain.plots.style import EDGE, EMPTY, INK, LONG_JUMP, START, axes_of, behavior_axes, colorbar, key

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.archive.archive import Archive
    from nichechain.chain import NicheChain

Ints = NDArray[np.int64]

# The largest classes, in order; colours that differ in lightness as well as in hue.
_COLORS = (EDGE, START, "#7fb08a", "#8a5a9e", "#5c4433", "#9fd3e6")
_SINGLE = "#c9a7ad"
# Width of the borders of niches, over the cells along an axis: borders must not hide what is small.
_BORDER = 6.0


def plot_classes(
    archive: Archive, chain: NicheChain, ax: Axes | None = None, *, threshold: float = 0.0
) -> Axes:
    """Niches by communicating class; those that no lineage leaves are hatched.

    A posterior mean has no zeros and thus one class: hand over a chain of ``mle``, or a threshold.
    Niches that were filled but never a parent are no class of their own but leaves.

    Parameters
    ----------
    archive : Archive
    chain : NicheChain
    ax : matplotlib.axes.Axes, optional
        By default one of its own.
    threshold : float
        Transitions at or below this probability do not count.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If the threshold is out of range or behavior does not have two axes.
    """
    ax = axes_of(ax)
    from matplotlib.colors import ListedColormap, Normalize
    from matplotlib.patches import Patch

    classes = _by_size(chain, threshold)
    n = len(archive.niches)
    births, visits = archive.counts.births, archive.counts.visits
    kind = np.full(chain.states, np.nan)
    large = [states for states in classes if states.size > 1]
    single = len(_COLORS) + 1
    for number, states in enumerate(large):
        kind[states] = min(number, len(_COLORS))
    alone = np.array([states[0] for states in classes if states.size == 1], np.int64)
    kind[alone] = np.where(births[alone] > 0, single, np.where(visits[alone] > 0, single + 1, np.nan))
    colors = (*_COLORS, "#5f6a72", _SINGLE, "#ffffff")
    behavior_axes(ax, archive)
    ax.set_facecolor(EMPTY)
    # Borders in grey, or a white niche would not be seen.
    fill(
        ax,
        archive.niches,
        kind[:n],
        ListedColormap(colors),
        Normalize(-0.5, len(colors) - 0.5),
        edge="#bbbbbb",
        width=_BORDER / cells_along(archive.niches),
    )
    closed = np.zeros(n, bool)
    for states in recurrent_classes(chain, threshold=threshold):
        inside = states[(states < n) & (births[states] > 0)]
        closed[inside] = True
    hatch(ax, archive.niches, closed, "#ffffffa0")
    handles = [
        Patch(color=color, label=_size(states, n))
        for color, states in zip(_COLORS, large[: len(_COLORS)], strict=False)
    ]
    if len(large) > len(_COLORS):
        handles.append(
            Patch(color=colors[len(_COLORS)], label=f"{len(large) - len(_COLORS)} smaller classes")
        )
    for code, text in ((single, "a class alone"), (single + 1, "never a parent")):
        number = int((kind[:n] == code).sum())
        if number:
            handles.append(Patch(facecolor=colors[code], edgecolor="#bbbbbb", label=f"{text}: {number}"))
    if closed.any():
        handles.append(Patch(facecolor="#888888", hatch="////", edgecolor="white", label="never left"))
    ax.set_title(f"Communicating classes: {len(large)} of several states")
    key(ax, *handles, note=_note(chain, threshold))
    return ax


def plot_transitions_by_class(
    archive: Archive, chain: NicheChain, ax: Axes | None = None, *, threshold: float = 0.0
) -> Axes:
    """T between the states that births speak of, the largest communicating class first.

    Inside a class, states stand in the order of the grid; lines part the classes of several states.

    Parameters
    ----------
    archive, chain, ax, threshold
        As in :func:`plot_classes`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If no birth has a parent or the threshold is out of range.
    """
    ax = axes_of(ax)
    counts = archive.counts
    if not counts.births.any():
        raise NichechainError(f"{archive.folder} has no births with a parent: there is no T to draw")
    seen = (counts.visits > 0) | (counts.births > 0)
    parts = [states[seen[states]] for states in _by_size(chain, threshold)]
    parts = [states for states in parts if states.size]
    order = np.concatenate(parts)
    known = np.where(counts.births[order] > 0, order, NONE)
    picture, pixel = show_entries(ax, chain, known, order)
    several = [states for states in parts if states.size > 1]
    ends = np.cumsum([states.size for states in several])
    for end in ends:
        ax.axhline(end - 0.5, color=LONG_JUMP, linewidth=0.8)
        ax.axvline(end - 0.5, color=LONG_JUMP, linewidth=0.8)
    middles = ends - np.array([states.size for states in several]) / 2 - 0.5 if several else np.array([])
    # Names of narrow classes would lie on each other.
    named = [k for k, states in enumerate(several) if states.size >= order.size / 25]
    ticks = [float(middles[k]) for k in named]
    names = [f"class of {several[k].size}" for k in named]
    alone = len(parts) - len(several)
    if alone >= order.size / 25:
        ticks.append(order.size - alone / 2 - 0.5)
        names.append(f"{alone} alone")
    ax.set_xticks(ticks, names, fontsize="small")
    ax.set_yticks(ticks, names, fontsize="small", rotation=90, va="center")
    ax.set(xlabel="state of the child", ylabel="state of the parent")
    ax.tick_params(length=2, color=INK)
    colorbar(ax, picture, f"probability (white: under {SMALLEST:g}, or no births)")
    ax.set_title(f"T by communicating class: {len(several)} of several states, {some(alone, 'state')} alone")
    key(ax, note="; ".join(filter(None, (_note(chain, threshold), pixel))))
    return ax


def _by_size(chain: NicheChain, threshold: float) -> list[Ints]:
    """Classes, the largest first."""
    return sorted(communicating_classes(chain, threshold=threshold), key=lambda states: -states.size)


def _size(states: Ints, niches: int) -> str:
    outside = " and outside" if (states >= niches).any() else ""
    inside = int((states < niches).sum())
    return f"{inside} niche{'s' if inside > 1 else ''}{outside}"


def _note(chain: NicheChain, threshold: float) -> str:
    return f"{chain.estimator}; transitions above {threshold:g}" if threshold else chain.estimator
