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
    if threshold <= 0.0:
        return sparse.csr_array(chain.T)
    # Of so many parts, one at least must be above its share of the threshold.
    least = threshold / (rows.pools.shape[0] + 2)
    pairs = [np.stack(rows.kept.nonzero()).astype(np.int64)]
    for share, pool in zip(rows.shares.T, rows.pools, strict=True):
        many = np.flatnonzero(pool * share.max() > least)
        starts, column = np.nonzero(share[:, None] * pool[many] > least)
        pairs.append(np.stack([starts, many[column]]))
    for row in np.flatnonzero(rows.spread).tolist():
        assert rows.displacement is not None
        near = np.flatnonzero(rows.displacement.rows(rows.cell[[row]])[0] > least / rows.spread[row])
        pairs.append(np.stack([np.full(near.size, row), near]))
    places = np.concatenate(pairs, axis=1)
    parent, child = np.divmod(np.unique(places[0] * chain.states + places[1]), chain.states)
    values = _at(rows, parent, child)
    above = values > threshold
    return sparse.csr_array((values[above], (parent[above], child[above])), shape=rows.shape)


def staying(chain: NicheChain) -> Floats:
    """T_ii, the probability of a child in its parent's state, (S,)."""
    rows = rows_of(chain)
    if isinstance(rows, sparse.csr_array):
        return np.asarray(rows.diagonal())
    states = np.arange(chain.states)
    return _at(rows, states, states)


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


def _at(rows: PooledTransition, parent: Ints, child: Ints) -> Floats:
    """T_ij of some pairs of states, (N,)."""
    values: Floats = np.asarray(rows.kept[parent, child]).ravel()
    values = values + np.einsum("nr,rn->n", rows.shares[parent], rows.pools[:, child])
    if rows.displacement is not None:
        inside = child < len(rows.displacement.within)
        displaced = np.flatnonzero((rows.spread[parent] > 0.0) & inside)
        near = rows.displacement.at(rows.cell[parent[displaced]], child[displaced])
        values[displaced] += rows.spread[parent[displaced]] * near
    return values


def reachable(graph: sparse.csr_array, start: Ints, states: int) -> Ints:
    """States below ``states`` that paths from the starting nodes lead to, these included, sorted."""
    size = graph.shape[0]
    # One more node, from which the search sets out to all starting ones.
    door = sparse.csr_array((np.ones(start.size), (np.zeros(start.size, int), start)), shape=(1, size))
    extended = sparse.block_array([[graph, None], [door, sparse.csr_array((1, 1))]], format="csr")
    order = breadth_first_order(extended, size, directed=True, return_predecessors=False)
    return np.sort(order[order < states]).astype(np.int64)
