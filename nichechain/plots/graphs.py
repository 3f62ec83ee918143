"""Graphs over behavior space: which niches lead to which, and wormholes among them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nichechain.plots.cells import borders, fill
from nichechain.plots.style import EDGE, EMPTY, FAINT, INK, LONG_JUMP, behavior_axes, colorbar, key

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd
    from matplotlib.axes import Axes

    from nichechain.archive.archive import Archive
    from nichechain.chain import NicheChain

_WIDEST = 3.0
_LARGEST = 130.0
_SMALLEST = 6.0


def plot_reachability(archive: Archive, chain: NicheChain, ax: Axes, *, threshold: float = 0.05) -> Axes:
    """Niches at their centres, and an arrow for every transition of a birth that is probable enough.

    The size of a niche shows its births and its fill how many children stay; width and opacity
    of an arrow show its probability; jumps over a quarter of the grid's diagonal, the paper's
    "wormholes", have a colour of their own. Arrows back to the niche of the start are faint, and
    arrows to the outside state are not drawn.

    Parameters
    ----------
    archive : Archive
    chain : NicheChain
    ax : matplotlib.axes.Axes
    threshold : float
        Smallest probability of an arrow, in [0, 1].

    Returns
    -------
    matplotlib.axes.Axes
    """
    from matplotlib.lines import Line2D

    behavior_axes(ax, archive, strip=False)
    graph = chain.graph(threshold)
    graph.remove_nodes_from([node for node, at in graph.nodes(data="position") if at is None])
    borders(ax, archive.niches)
    facts = archive.meta.facts
    back = None if facts.start is None else int(archive.niches.of([facts.start])[0])
    drawn = [edge for edge in graph.edges if graph.edges[edge]["count"]]
    # Doing nothing is what most broken children do; arrows back to it would hide all others.
    falls = [edge for edge in drawn if edge[1] == back]
    near = [edge for edge in drawn if edge[1] != back and not graph.edges[edge]["long_jump"]]
    far = [edge for edge in drawn if edge[1] != back and graph.edges[edge]["long_jump"]]
    _arrows(ax, graph, falls, FAINT, 1, widest=1.0)
    _arrows(ax, graph, near, EDGE, 2)
    _arrows(ax, graph, far, LONG_JUMP, 3)
    _nodes(ax, graph)
    leaving = archive.counts.births_outside / max(1, archive.counts.visits.sum())
    key(
        ax,
        Line2D([], [], color=EDGE, label=f"transition, probability ≥ {threshold:g}"),
        Line2D([], [], color=LONG_JUMP, label="long jump"),
        *([Line2D([], [], color=FAINT, label="back to the start")] if falls else []),
        note=f"{chain.estimator}; size: births; outside ({leaving:.0%} of births) not drawn",
    )
    ax.set_title(
        f"Reachability: {graph.number_of_nodes()} niches, {len(near)} transitions, {len(far)} long jumps"
    )
    return ax


def _nodes(ax: Axes, graph: nx.DiGraph) -> None:
    from matplotlib.colors import PowerNorm

    nodes = sorted(graph.nodes, key=lambda node: graph.nodes[node]["visits"], reverse=True)
    if not nodes:
        return
    at = np.array([graph.nodes[node]["position"] for node in nodes])
    visits = np.array([graph.nodes[node]["visits"] for node in nodes], float)
    known = np.array([graph.nodes[node]["births"] > 0 for node in nodes])
    stay = np.array([graph.nodes[node]["stay"] for node in nodes])
    # Births differ by orders of magnitude, and so would areas.
    sizes = _SMALLEST + (_LARGEST - _SMALLEST) * np.log1p(visits) / max(1.0, np.log1p(visits.max()))
    # A niche that was never a parent has no children that could stay.
    x, y = at.T
    ax.scatter(
        x[~known], y[~known], s=sizes[~known], facecolor="white", edgecolor=INK, linewidth=0.6, zorder=5
    )
    dots = ax.scatter(
        x[known],
        y[known],
        s=sizes[known],
        c=stay[known],
        cmap="YlGn",
        norm=PowerNorm(0.5, 0.0, 1.0),
        edgecolor=INK,
        linewidth=0.6,
        zorder=5,
    )
    colorbar(ax, dots, "probability that a child stays in the niche")


def _arrows(
    ax: Axes, graph: nx.DiGraph, edges: list[tuple[int, int]], color: str, layer: int, widest: float = _WIDEST
) -> None:
    from matplotlib.patches import FancyArrowPatch

    for i, j in sorted(edges, key=lambda edge: graph.edges[edge]["probability"]):
        probability = graph.edges[i, j]["probability"]
        strength = float(np.sqrt(probability))
        ax.add_patch(
            FancyArrowPatch(
                graph.nodes[i]["position"],
                graph.nodes[j]["position"],
                # Curved, so that an arrow and its opposite do not lie on each other.
                connectionstyle="arc3,rad=0.12",
                arrowstyle="-|>",
                mutation_scale=4 + 5 * strength,
                linewidth=0.3 + widest * strength,
                alpha=0.12 + 0.75 * strength,
                color=color,
                shrinkA=3,
                shrinkB=3,
                zorder=layer,
            )
        )


_BEND = 0.15
_MOST_LABELS = 12


def plot_wormholes(archive: Archive, found: pd.DataFrame, ax: Axes) -> Axes:
    """An arrow for every wormhole, over the births of every niche.

    Width shows the probability of the transition, colour how surely it is a wormhole; singletons
    are dotted. The number beside an arrow is how many of how many births took it.

    Parameters
    ----------
    archive : Archive
    found : pandas.DataFrame
        From :func:`nichechain.chain.structure.wormholes.wormholes`; only flagged rows are drawn.
    ax : matplotlib.axes.Axes

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    NichechainError
        If behavior does not have two axes.
    """
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
    ax.set_title(f"Wormholes: {len(flagged)} of {len(found)} observed transitions")
    handles = []
    if len(flagged) > singles:
        handles.append(Line2D([], [], color=INK, label="wormhole (births that took it / births)"))
    if singles:
        handles.append(Line2D([], [], color=INK, linestyle=":", label=f"by a single birth: {singles}"))
    false = float(flagged["cumulated_false"].max()) if len(flagged) else 0.0
    key(ax, *handles, note=f"shade: births; {false:.2g} of the wormholes are expected to be none")
    return ax
