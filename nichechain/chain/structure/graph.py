"""The chain as a graph of niches."""

from __future__ import annotations

import networkx as nx
import numpy as np
from scipy import sparse

from nichechain.chain.model import NicheChain
from nichechain.core.checks import check_numbers
from nichechain.core.errors import NichechainError

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
        ``position`` (centre of the niche, where there is a grid), ``visits`` (births there),
        ``births`` (of parents there) and ``stay`` (probability of a child in the same niche).
        Edges have ``probability``, ``count`` (births), ``distance`` (between centres, in units of
        behavior) and ``long_jump``: at least a quarter of the grid's diagonal. Self-loops are the
        attribute ``stay``, not edges.

    Raises
    ------
    NichechainError
        If the threshold is not a probability.
    """
    check_numbers(threshold=threshold)
    if not 0.0 <= threshold <= 1.0:
        raise NichechainError(f"threshold is {threshold}, but must be between 0 and 1")
    transition = sparse.csr_array(chain.T)
    stay = transition.diagonal()
    entries = transition.tocoo()
    parent, child = entries.coords
    kept = (entries.data >= threshold) & (parent != child) & (entries.data > 0)
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
            graph.nodes[int(state)]["position"] = tuple(float(x) for x in chain.niches.centers[state])
    for i, j, p in zip(parent.tolist(), child.tolist(), probability.tolist(), strict=True):
        graph.add_edge(i, j, probability=p, count=0 if counts is None else int(counts[i, j]))
        if "position" in graph.nodes[i] and "position" in graph.nodes[j]:
            assert chain.niches is not None
            span = np.linalg.norm(chain.niches.upper - chain.niches.lower)
            gap = np.linalg.norm(np.subtract(graph.nodes[i]["position"], graph.nodes[j]["position"]))
            graph.edges[i, j]["distance"] = float(gap)
            graph.edges[i, j]["long_jump"] = bool(gap >= LONG_JUMP * span)
    return graph
