"""Graphs over behavior space: which niches lead to which, and wormholes among them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nichechain.core.checks import check_at_least
from nichechain.core.text import some
from nichechain.plots.cells import borders, fill
from nichechain.plots.style import EDGE, EMPTY, INK, LONG_JUMP, START, axes_of, behavior_axes, colorbar, key

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd
    from matplotlib.axes import Axes

    from nichechain.archive.archive import Archive
    from nichechain.chain import NicheChain

_WIDEST = 3.0
_LARGEST = 110.0
_SMALLEST = 5.0
# A niche that so many of all births fall into is a sink: arrows to it would hide all others.
_SINK = 0.2
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
    the sink, which is the niche of the start or one that a fifth of all births fall into: it is ringed,
    and the note says how many niches lead there.

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
    sink = _sink(archive)
    seen = [edge for edge in graph.edges if graph.edges[edge]["count"]]
    falls = [edge for edge in seen if edge[1] == sink]
    others = [edge for edge in seen if edge[1] != sink]
    strongest = sorted(others, key=lambda edge: -graph.edges[edge]["probability"])[:most]
    near = [edge for edge in strongest if not graph.edges[edge]["long_jump"]]
    far = [edge for edge in strongest if graph.edges[edge]["long_jump"]]
    _arrows(ax, graph, near, EDGE, 6)
    _arrows(ax, graph, far, LONG_JUMP, 7)
    _nodes(ax, graph)
    note = f"{chain.estimator}; size: births"
    if sink is not None:
        ax.plot(
            *archive.niches.centers[sink], "o", markersize=15, markerfacecolor="none", color=START, zorder=5
        )
        share = np.mean([graph.edges[edge]["probability"] for edge in falls]) if falls else 0.0
        note += (
            f"\nringed: {some(len(falls), 'niche leads', 'niches lead')} there, with {share:.0%} on average"
        )
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


def _sink(archive: Archive) -> int | None:
    """The niche that births return to: of the start, or one that many of them fall into."""
    start = archive.meta.facts.start
    if start is not None:
        back = int(archive.niches.of([start])[0])
        return back if back < len(archive.niches) else None
    visits = archive.counts.visits[: len(archive.niches)]
    fullest = int(np.argmax(visits))
    return fullest if visits[fullest] >= _SINK * max(1, archive.counts.visits.sum()) else None


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
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.lines import Line2D
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.patheffects import withStroke

    behavior_axes(ax, archive, strip=False)
    ax.set_facecolor(EMPTY)
    visits = archive.counts.visits[: len(archive.niches)].astype(float)
    shown = np.where(visits > 0, visits, np.nan)
    # Births in faint grey: where there are many, a jump means less.
    fill(ax, archive.niches, shown, "Greys", LogNorm(1.0, 1000.0 * max(2.0, visits.max())))
    flagged = found[found["wormhole"]].sort_values("exceeds", kind="stable")
    low = min(0.5, float(flagged["exceeds"].min())) if len(flagged) else 0.5
    scale = ScalarMappable(Normalize(low, 1.0), colormaps["plasma_r"])
    centers = archive.niches.centers
    for number, row in enumerate(flagged.itertuples()):
        strength = float(np.sqrt(row.probability))
        color = scale.to_rgba(row.exceeds)
        ax.add_patch(
            FancyArrowPatch(
                tuple(centers[row.parent]),
                tuple(centers[row.child]),
                # Curved, so that an arrow and its opposite do not lie on each other.
                connectionstyle=f"arc3,rad={_BEND}",
                arrowstyle="-|>",
                mutation_scale=8 + 8 * strength,
                linewidth=0.8 + _WIDEST * strength,
                linestyle=":" if row.singleton else "-",
                color=color,
                shrinkA=2,
                shrinkB=2,
                zorder=3,
                path_effects=[withStroke(linewidth=2.5 + _WIDEST * strength, foreground="#ffffffb0")],
            )
        )
        if number >= len(flagged) - _MOST_LABELS:
            way = centers[row.child] - centers[row.parent]
            # The middle of the curve.
            middle = centers[row.parent] + way / 2 + _BEND / 2 * np.array([way[1], -way[0]])
            ax.annotate(
                f"{row.count}/{row.exposure}",
                middle,
                fontsize="x-small",
                ha="center",
                va="center",
                zorder=4,
                path_effects=[withStroke(linewidth=2.0, foreground="white")],
            )
    colorbar(ax, scale, "posterior probability of being one")
    singles = int(flagged["singleton"].sum())
    ax.set_title(f"Wormholes: {len(flagged)} of {some(len(found), 'observed transition')}")
    handles = []
    if len(flagged) > singles:
        handles.append(Line2D([], [], color=INK, label="wormhole (births that took it / births)"))
    if singles:
        handles.append(Line2D([], [], color=INK, linestyle=":", label=f"by a single birth: {singles}"))
    false = float(flagged["cumulated_false"].max()) if len(flagged) else 0.0
    key(ax, *handles, note=f"shade: births; {false:.2g} of the wormholes are expected to be none")
    return ax
