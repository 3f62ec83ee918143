"""The chain as a graph of niches."""

from __future__ import annotations

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from nichechain.chain.model import NicheChain
from nichechain.chain.structure.transitions import entries_above, staying
from nichechain.core.checks import check_numbers
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]

# Two-step paths of probability 1 would have no length, and paths of no length no number.
_SHORTEST = 1e-12
LONG_JUMP = 0.25
"""A jump is long if it spans this share of the grid's diagonal."""


def reachability_graph(chain: NicheChain, threshold: float = 0.05) -> nx.DiGraph:
    """Niches and the transitions between them that are at least as probable as the threshold.

    Parameters
    ----------
    chain : NicheChain
    threshold : float
        Smallest probability of an edge, in [0, 1].

    Returns
    -------
    networkx.DiGraph
        Nodes are states, those that were visited or have an edge, with attributes ``label``,
        ``x``, ``y``, ``z`` and then ``x3``, ``x4``, … (centre of the niche, where it has a place),
        ``visits`` (births there), ``births`` (of parents there) and ``stay`` (probability of a child in
        the same niche). All edges have ``probability``, ``count`` (births), ``distance`` (between
        centres, in units of behavior; NaN where there are none) and ``long_jump``: whether that is at
        least a quarter of the grid's diagonal. All are plain values, which networkx can write.
        Self-loops are the attribute ``stay``, not edges.

    Raises
    ------
    NichechainError
        If the threshold is not a probability.
    """
    check_numbers(threshold=threshold)
    if not 0.0 <= threshold <= 1.0:
        raise NichechainError(f"threshold is {threshold}, but must be between 0 and 1")
    stay = staying(chain)
    # Transitions of the threshold itself belong as well.
    entries = entries_above(chain, np.nextafter(threshold, -1.0)).tocoo()
    parent, child = entries.coords
    kept = parent != child
    parent, child, probability = parent[kept], child[kept], entries.data[kept]
    counts = None if chain.counts is None else chain.counts.matrix
    graph = nx.DiGraph()
    nodes = set(parent) | set(child)
    if chain.counts is not None:
        # A row without births is the prior's word alone: nothing to draw an arrow from.
        known = chain.counts.births > 0
        parent, child, probability = (a[known[parent]] for a in (parent, child, probability))
        nodes = set(parent) | set(child) | set(np.flatnonzero(chain.counts.visits))
    else:
        nodes = set(range(chain.states))
    for state in sorted(nodes):
        graph.add_node(
            int(state),
            label=chain.label(state),
            stay=float(stay[state]),
            visits=0 if chain.counts is None else int(chain.counts.visits[state]),
            births=0 if chain.counts is None else int(chain.counts.births[state]),
        )
        if chain.niches is not None and state != chain.outside:
            center = chain.niches.centers[state]
            graph.nodes[int(state)].update({axis_name(k): float(x) for k, x in enumerate(center)})
    far = np.inf
    if chain.niches is not None:
        far = LONG_JUMP * float(np.linalg.norm(chain.niches.upper - chain.niches.lower))
    for i, j, p in zip(parent.tolist(), child.tolist(), probability.tolist(), strict=True):
        gap = _apart(chain, i, j)
        graph.add_edge(
            i,
            j,
            probability=p,
            count=0 if counts is None else int(counts[i, j]),
            distance=gap,
            long_jump=bool(gap >= far),
        )
    return graph


def axis_name(axis: int) -> str:
    """How a node's place along an axis of behavior is called: x, y, z, and x3 after these."""
    return "xyz"[axis] if axis < 3 else f"x{axis}"


def _apart(chain: NicheChain, i: int, j: int) -> float:
    """Distance of two centres; NaN for the outside, which is nowhere, and without niches."""
    if chain.niches is None or chain.outside in (i, j):
        return float("nan")
    return float(np.linalg.norm(chain.niches.centers[i] - chain.niches.centers[j]))


def betweenness(chain: NicheChain, *, threshold: float = 0.01) -> Floats:
    """How often a niche lies on the most probable path between two others.

    Parameters
    ----------
    chain : NicheChain
    threshold : float
        Only transitions at least this probable count, in [0, 1]. Time grows with S times the
        transitions that are left.

    Returns
    -------
    (S,) float64 array
        Share of ordered pairs of other states whose most probable path passes through, 0 to 1;
        equally probable paths share a pair. A state that the graph leaves out, or that no path
        passes through, has 0.

    Raises
    ------
    NichechainError
        If the threshold is not a probability.

    Notes
    -----
    Betweenness centrality (Freeman 1977; Brandes 2001) of :meth:`NicheChain.graph` with edges
    of length −log T_ij, which makes the shortest path the most probable one. Rows without births
    have no edges there.
    """
    graph = reachability_graph(chain, threshold)
    for _, _, edge in graph.edges(data=True):
        edge["length"] = max(-np.log(edge["probability"]), _SHORTEST)
    found = np.zeros(chain.states)
    for state, share in nx.betweenness_centrality(graph, weight="length", normalized=False).items():
        found[state] = share
    others = chain.states - 1
    # All states are counted, those that the graph leaves out too.
    return found / (others * (others - 1)) if others > 1 else found
