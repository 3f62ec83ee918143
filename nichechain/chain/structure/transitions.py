"""Which transitions of a chain can happen, and which states they lead to in the end."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order

from nichechain.chain.model import NicheChain
from nichechain.chain.operator import PooledTransition

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

Rows: TypeAlias = "sparse.csr_array | PooledTransition"
"""T to compute with: its entries, or its parts where its entries would be too many."""

# Up to here a posterior mean, which has no zeros, is kept whole: 72 MB and as much again for indices.
_WHOLE = 3_000
# Rows of a larger one are made together up to so many numbers.
_AT_ONCE = 4_000_000


def rows_of(chain: NicheChain) -> Rows:
    """T with exactly the transitions that can happen, or in parts where there are too many of these.

    Returns
    -------
    (S, S) scipy.sparse.csr_array or PooledTransition
    """
    if isinstance(chain.operator, PooledTransition) and chain.states > _WHOLE:
        return chain.operator
    entries = sparse.csr_array(chain.T, copy=True)
    entries.eliminate_zeros()
    return entries


def entries_above(chain: NicheChain, threshold: float) -> sparse.csr_array:
    """T with only the transitions of a larger probability than the threshold, (S, S)."""
    rows = rows_of(chain)
    if isinstance(rows, sparse.csr_array):
        rows.data = np.where(rows.data > threshold, rows.data, 0.0)
        rows.eliminate_zeros()
        return rows
    step = max(1, _AT_ONCE // chain.states)
    blocks = []
    for start in range(0, chain.states, step):
        block = rows[np.arange(start, min(start + step, chain.states))].toarray()
        block[block <= threshold] = 0.0
        blocks.append(sparse.csr_array(block))
    return sparse.vstack(blocks, format="csr")


def staying(chain: NicheChain) -> Floats:
    """T_ii, the probability of a child in its parent's state, (S,)."""
    rows = rows_of(chain)
    if isinstance(rows, sparse.csr_array):
        return np.asarray(rows.diagonal())
    stay: Floats = rows.kept.diagonal() + np.einsum("ir,ri->i", rows.shares, rows.pools)
    displaced = np.flatnonzero(rows.spread)
    if displaced.size:
        assert rows.displacement is not None
        cell = rows.cell[displaced]
        stay[displaced] += rows.spread[displaced] * rows.displacement.at(cell, cell)
    return stay


def leaving_alone(rows: sparse.csr_array, state: int) -> float:
    """Probability that a child is not in its parent's state."""
    entries = slice(rows.indptr[state], rows.indptr[state + 1])
    return float(rows.data[entries][rows.indices[entries] != state].sum())


def graph_of(rows: Rows, chain: NicheChain) -> sparse.csr_array:
    """A graph with the paths of T between states: nodes 0 to S − 1 are the states.

    Where T is kept in parts, further nodes stand for what many rows lead to alike.
    """
    if isinstance(rows, sparse.csr_array):
        return rows
    everywhere = ((rows.shares > 0.0) & (rows.pools > 0.0).all(axis=1)).any(axis=1)
    if (rows.spread[~everywhere] > 0.0).any():
        # Displacements reach some niches only, which no node can stand for.
        return sparse.csr_array(chain.T)
    to_pool = sparse.csr_array((rows.shares > 0.0).astype(np.float64))
    from_pool = sparse.csr_array((rows.pools > 0.0).astype(np.float64))
    kept = rows.kept.copy()
    kept.eliminate_zeros()
    return sparse.block_array([[kept, to_pool], [from_pool, None]], format="csr")


def reachable(graph: sparse.csr_array, start: Ints, states: int) -> Ints:
    """States below ``states`` that paths from the starting nodes lead to, these included, sorted."""
    size = graph.shape[0]
    # One more node, from which the search sets out to all starting ones.
    door = sparse.csr_array((np.ones(start.size), (np.zeros(start.size, int), start)), shape=(1, size))
    extended = sparse.block_array([[graph, None], [door, sparse.csr_array((1, 1))]], format="csr")
    order = breadth_first_order(extended, size, directed=True, return_predecessors=False)
    return np.sort(order[order < states]).astype(np.int64)
