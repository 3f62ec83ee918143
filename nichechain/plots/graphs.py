"""Graphs over behavior space: which niches lead to which, and wormholes among them."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_at_least
from nichechain.core.text import some
from nichechain.plots.cells import borders, fill
from nichechain.plots.style import EDGE, INK, LONG_JUMP, START, axes_of, behavior_axes, colorbar, key

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd
    from matplotlib.axes import Axes

    from nichechain.archive.archive import Archive
    from nichechain.chain import NicheChain

Floats = NDArray[np.float64]

_WIDEST = 3.0
_LARGEST = 110.0
_SMALLEST = 5.0
# A niche that so many others lead to, or this share of them, is a sink: arrows to it would hide all others.
_SINK = 10
_SINK_SHARE = 0.05
# Arrows that an eye can follow.
_MOST_ARROWS = 60


def plot_reachability(
    archive: Archive,
    chain: NicheChain,
    ax: Axes | None = None,
    *,
    threshold: float = 0.05,
    most: int = _MOST_ARROWS,
) -> Axes:
    """Niches at their centres, and arrows for the strongest transitions that births made.

    The size of a niche shows its births and its fill how many children stay; width and opacity
    of an arrow show its probability; jumps over a quarter of the grid's diagonal, the paper's
    "wormholes", have a colour of their own. Arrows to the outside state are not drawn, nor those to
    sinks: the niche of the start, and niches that at least ten others and a twentieth of all lead to.
    They are ringed, with the number of niches that lead there.

    Parameters
    ----------
    archive : Archive
    chain : NicheChain
    ax : matplotlib.axes.Axes, optional
        By default one of its own.
    threshold : float
        Smallest probability of an arrow, in [0, 1].
    most : int
        Arrows at most, the strongest first, at least 1. The title says how many there would be.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If a number is out of range, or behavior does not have two axes.
    """
    from matplotlib.lines import Line2D

    check_at_least(1, most=most)
    ax = axes_of(ax)
    behavior_axes(ax, archive, strip=False)
    graph = chain.graph(threshold)
    graph.remove_nodes_from([node for node, x in graph.nodes(data="x") if x is None])
    borders(ax, archive.niches)
    seen = [edge for edge in graph.edges if graph.edges[edge]["count"]]
    sinks = _sinks(archive, graph, seen)
    others = [edge for edge in seen if edge[1] not in sinks]
    strongest = sorted(others, key=lambda edge: -graph.edges[edge]["probability"])[:most]
    near = [edge for edge in strongest if not graph.edges[edge]["long_jump"]]
    far = [edge for edge in strongest if graph.edges[edge]["long_jump"]]
    _arrows(ax, graph, near, EDGE, 6)
    _arrows(ax, graph, far, LONG_JUMP, 7)
    _nodes(ax, graph)
    note = f"{chain.estimator}; size: births"
    for sink, number in sinks.items():
        _ring(ax, archive, sink, number)
    if sinks:
        note += "; ringed: that many niches lead there, by arrows that are not drawn"
    leaving = archive.counts.births_outside / max(1, archive.counts.visits.sum())
    if leaving:
        note += f"; outside ({leaving:.0%} of births) not drawn"
    key(
        ax,
        Line2D([], [], color=EDGE, label=f"transition, probability ≥ {threshold:g}"),
        Line2D([], [], color=LONG_JUMP, label="long jump"),
        note=note,
    )
    what = "the" if len(strongest) == len(others) else f"the {len(strongest)} strongest of"
    ax.set_title(
        f"Reachability: {what} {some(len(others), 'transition')}\n"
        f"between {some(graph.number_of_nodes(), 'niche')}, {some(len(far), 'long jump')}"
    )
    return ax


def _sinks(archive: Archive, graph: nx.DiGraph, edges: list[tuple[int, int]]) -> dict[int, int]:
    """Niches whose arrows are counted, not drawn, and how many lead to each."""
    leading = Counter(child for _, child in edges)
    least = max(_SINK, _SINK_SHARE * graph.number_of_nodes())
    found = {niche: number for niche, number in leading.items() if number >= least}
    start = archive.meta.facts.start
    if start is not None:
        back = int(archive.niches.of([start])[0])
        if leading[back]:
            found[back] = leading[back]
    return found


def _ring(ax: Axes, archive: Archive, niche: int, number: int) -> None:
    from matplotlib.patheffects import withStroke

    x, y = archive.niches.centers[niche]
    ax.plot(x, y, "o", markersize=17, markerfacecolor="none", color=START, markeredgewidth=2.2, zorder=8)
    ax.annotate(
        str(number),
        (x, y),
        (0, -9),
        textcoords="offset points",
        fontweight="bold",
        ha="center",
        va="top",
        zorder=9,
        path_effects=[withStroke(linewidth=3.0, foreground="white")],
    )


def _nodes(ax: Axes, graph: nx.DiGraph) -> None:
    from matplotlib.colors import PowerNorm

    nodes = sorted(graph.nodes, key=lambda node: graph.nodes[node]["visits"], reverse=True)
    if not nodes:
        return
    at = np.array([_place(graph, node) for node in nodes])
    visits = np.array([graph.nodes[node]["visits"] for node in nodes], float)
    known = np.array([graph.nodes[node]["births"] > 0 for node in nodes])
    stay = np.array([graph.nodes[node]["stay"] for node in nodes])
    # Births differ by orders of magnitude, and so would areas.
    sizes = _SMALLEST + (_LARGEST - _SMALLEST) * (np.log1p(visits) / max(1.0, np.log1p(visits.max()))) ** 2
    # A niche that was never a parent has no children that could stay.
    x, y = at.T
    ax.scatter(
        x[~known], y[~known], s=sizes[~known], facecolor="white", edgecolor="#999999", linewidth=0.5, zorder=3
    )
    dots = ax.scatter(
        x[known],
        y[known],
        s=sizes[known],
        c=stay[known],
        cmap="YlGn",
        norm=PowerNorm(0.5, 0.0, 1.0),
        edgecolor="#777777",
        linewidth=0.5,
        zorder=3,
    )
    colorbar(ax, dots, "probability that a child stays in the niche")


def _place(graph: nx.DiGraph, node: int) -> tuple[float, float]:
    return graph.nodes[node]["x"], graph.nodes[node]["y"]


def _arrows(ax: Axes, graph: nx.DiGraph, edges: list[tuple[int, int]], color: str, layer: int) -> None:
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.patheffects import withStroke

    for i, j in sorted(edges, key=lambda edge: graph.edges[edge]["probability"]):
        strength = float(np.sqrt(graph.edges[i, j]["probability"]))
        width = 0.6 + _WIDEST * strength
        ax.add_patch(
            FancyArrowPatch(
                _place(graph, i),
                _place(graph, j),
                # Curved, so that an arrow and its opposite do not lie on each other.
                connectionstyle="arc3,rad=0.12",
                arrowstyle="-|>",
                mutation_scale=9 + 8 * strength,
                linewidth=width,
                color=color,
                shrinkA=2,
                shrinkB=2,
                zorder=layer,
                path_effects=[withStroke(linewidth=width + 1.2, foreground="#ffffffc0")],
            )
        )


_BEND = 0.15
_MOST_LABELS = 12
# Size of a label, as shares of the map's width and height.
_LABEL = np.array([0.15, 0.035])


def plot_wormholes(archive: Archive, found: pd.DataFrame, ax: Axes | None = None) -> Axes:
    """An arrow for every wormhole, over the births of every niche.

    Width shows the probability of the transition, colour how surely it is a wormhole; singletons
    are dotted. The number beside an arrow is how many of how many births took it.

    Parameters
    ----------
    archive : Archive
    found : pandas.DataFrame
        From :func:`nichechain.chain.structure.wormholes.wormholes`; only flagged rows are drawn.
    ax : matplotlib.axes.Axes, optional
        By default one of its own.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If behavior does not have two axes.
    """
    ax = axes_of(ax)
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
    from matplotlib.lines import Line2D
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.patheffects import withStroke

    behavior_axes(ax, archive, strip=False)
    ax.set_facecolor("white")
    visits = archive.counts.visits[: len(archive.niches)].astype(float)
    shown = np.where(visits > 0, visits, np.nan)
    # Births in faint grey: where there are many, a jump means less. White: nobody was born there.
    fill(ax, archive.niches, shown, "Greys", LogNorm(0.05, 5000.0 * max(2.0, visits.max())), width=0.6)
    flagged = found[found["wormhole"]].sort_values("exceeds", kind="stable")
    low = min(0.5, float(flagged["exceeds"].min())) if len(flagged) else 0.5
    # The lightest colours would be lost on a light map.
    colors = LinearSegmentedColormap.from_list("sure", colormaps["plasma_r"](np.linspace(0.25, 1.0, 64)))
    scale = ScalarMappable(Normalize(low, 1.0), colors)
    centers = archive.niches.centers
    for row in flagged.itertuples():
        strength = float(np.sqrt(row.probability))
        color = scale.to_rgba(row.exceeds)
        ax.add_patch(
            FancyArrowPatch(
                tuple(centers[row.parent]),
                tuple(centers[row.child]),
                # Curved, so that an arrow and its opposite do not lie on each other.
                connectionstyle=f"arc3,rad={_BEND}",
                arrowstyle="-|>",
                mutation_scale=15 + 10 * strength,
                linewidth=1.8 + _WIDEST * strength,
                linestyle=":" if row.singleton else "-",
                color=color,
                shrinkA=0,
                shrinkB=1,
                zorder=5,
                path_effects=[withStroke(linewidth=4.2 + _WIDEST * strength, foreground="#ffffffe0")],
            )
        )
        ax.plot(*centers[row.parent], "o", color=color, markersize=6, markeredgecolor="white", zorder=6)
    surest = flagged.tail(_MOST_LABELS)
    curves = [_curve(centers[row.parent], centers[row.child]) for row in flagged.itertuples()]
    for row, place in zip(surest.itertuples(), _label_places(curves, len(surest), ax), strict=True):
        ax.annotate(
            f"{row.count}/{row.exposure}",
            tuple(place),
            fontsize="medium",
            fontweight="bold",
            color=INK,
            ha="center",
            va="center",
            zorder=7,
            path_effects=[withStroke(linewidth=3.5, foreground="white")],
        )
    colorbar(ax, scale, "posterior probability of being one")
    singles = int(flagged["singleton"].sum())
    ax.set_title(f"Wormholes: {len(flagged)} of {some(len(found), 'observed transition')}", pad=10)
    handles = []
    if len(flagged) > singles:
        handles.append(Line2D([], [], color=INK, label="wormhole: births that took it / births"))
    if singles:
        handles.append(Line2D([], [], color=INK, linestyle=":", label=f"by a single birth: {singles}"))
    false = float(flagged["cumulated_false"].max()) if len(flagged) else 0.0
    key(ax, *handles, note=f"shade: births; {false:.2g} of the {len(flagged)} are expected to be none")
    return ax


def _curve(start: Floats, end: Floats) -> Floats:
    """Points along an arrow, (21, 2)."""
    way = end - start
    corner = start + way / 2 + _BEND * np.array([way[1], -way[0]])
    t = np.linspace(0.0, 1.0, 21)[:, None]
    curve: Floats = (1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end
    return curve


def _label_places(curves: list[Floats], labels: int, ax: Axes) -> list[Floats]:
    """Where the last so many arrows have their labels: on their own or beside it, away from all others."""
    low, high = np.transpose([ax.get_xlim(), ax.get_ylim()])
    size = _LABEL * (high - low)
    places: list[Floats] = []
    for number in range(len(curves) - labels, len(curves)):
        # Neither at the arrowhead nor where it begins.
        along = curves[number][2:18]
        aside = np.array([[0.0, 0.0], [-0.65, 0.0], [0.65, 0.0]]) * size
        options = (along + aside[:, None]).reshape(-1, 2)
        others = np.concatenate(
            [np.empty((0, 2)), *(curve for place, curve in enumerate(curves) if place != number)]
        )
        cost = 0.1 * np.tile(np.abs(np.linspace(-1.0, 1.0, len(along))), 3)
        cost += np.repeat([0.0, 0.3, 0.3], len(along))
        cost += 2.0 * ((options - 0.45 * size < low) | (options + 0.45 * size > high)).any(axis=1)
        cost += 1.0 * (_nearest(options, others, size / 2) < 1.0)
        # A label belongs to the arrow that is nearest to it.
        cost += 3.0 * (_nearest(options, others, size) < _nearest(options, along, size))
        if places:
            # One line of space between two labels.
            cost += 4.0 * (_nearest(options, np.array(places), size * (1.0, 2.0)) < 1.0)
        places.append(options[int(np.argmin(cost))])
    return places


def _nearest(points: Floats, taken: Floats, size: Floats) -> Floats:
    """Distance of each point to the nearest that is taken, in sizes, along the axis that parts them more."""
    if not len(taken):
        return np.full(len(points), np.inf)
    apart: Floats = (np.abs(points[:, None] - taken[None]) / size).max(axis=2).min(axis=1)
    return apart
