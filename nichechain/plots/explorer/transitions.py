"""T as the page keeps it: in parts, rounded, and of large grids the strongest entries."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.archive.archive import Archive
from nichechain.chain import NicheChain
from nichechain.chain.displacement import GridDisplacement
from nichechain.chain.operator import PooledTransition
from nichechain.chain.structure.wormholes import wormholes
from nichechain.evolvability.question import MOST_EXACT
from nichechain.evolvability.returns import all_return_probabilities
from nichechain.plots.explorer.packing import packed

Floats = NDArray[np.float64]

# Entries of T, and pairs of births, that a page keeps of all rows together.
_MOST_ENTRIES = 200_000
_MOST_ENTRIES_OF_MANY = 120_000


def rounded_transition(chain: NicheChain) -> tuple[PooledTransition, int]:
    """T in parts, each rounded to single precision.

    Returns
    -------
    PooledTransition
    int
        Of every row only so many of its strongest entries were kept, scaled up to the sum of all; 0 if
        nothing was left out.
    """
    whole = chain.operator
    if not isinstance(whole, PooledTransition):
        nothing = np.zeros(chain.states)
        whole = PooledTransition.shared(sparse.csr_array(whole), nothing, nothing)
    if whole.displacement is not None and not isinstance(whole.displacement, GridDisplacement):
        whole = _spelled_out(whole)
    kept, each = _strongest(whole.kept, chain.states)
    kept = kept.astype(np.float32).astype(np.float64)
    kept.eliminate_zeros()
    kept.sort_indices()
    displacement = whole.displacement
    if displacement is not None:
        assert isinstance(displacement, GridDisplacement)
        displacement = replace(displacement, kernel=_rounded(displacement.kernel))
    rounded = replace(
        whole,
        kept=kept,
        shares=_rounded(whole.shares),
        pools=_rounded(whole.pools),
        spread=_rounded(whole.spread),
        displacement=displacement,
    )
    return rounded, each


def transition(chain: NicheChain) -> dict[str, Any]:
    """What the page computes with."""
    T, each = rounded_transition(chain)
    kernel, known = np.zeros(0), np.zeros(0, bool)
    if isinstance(T.displacement, GridDisplacement):
        kernel, known = T.displacement.kernel, T.displacement.known
    dense = T.toarray()
    if chain.states > MOST_EXACT:
        # Whole matrices multiply twice as fast; what a page shows has three digits.
        dense = dense.astype(np.float32)
    return {
        "rowStart": packed(T.kept.indptr, np.uint32),
        "column": packed(T.kept.indices, np.uint16),
        "probability": packed(T.kept.data, np.float32),
        "shares": packed(T.shares, np.float32),
        "pools": packed(T.pools, np.float32),
        "spread": packed(T.spread, np.float32),
        "kernel": packed(kernel, np.float32),
        "known": packed(known, np.uint8),
        "returns": packed(all_return_probabilities(dense, LONGEST - 1), np.float64),
        "strongest": each,
    }


LONGEST = 10
"""Generations that the page's slider goes up to."""


def observed(archive: Archive, chain: NicheChain) -> dict[str, Any]:
    """Births of every pair of states, and which pairs are wormholes."""
    matrix, each = _strongest(archive.counts.matrix.tocsr(), chain.states, scaled=False)
    matrix.sort_indices()
    found: dict[str, Any] = {
        "countStart": packed(matrix.indptr, np.uint32),
        "countColumn": packed(matrix.indices, np.uint16),
        "count": packed(matrix.data, np.uint32),
        "pairsLeftOut": each > 0,
        "wormholes": None,
    }
    if chain.posterior is not None:
        flagged = wormholes(chain, beyond="both")
        flagged = flagged[flagged["wormhole"]]
        pairs = zip(flagged["parent"], flagged["child"], flagged["exceeds"], strict=True)
        found["wormholes"] = [[int(i), int(j), round(float(p), 4)] for i, j, p in pairs]
    return found


def _strongest(matrix: sparse.csr_array, states: int, *, scaled: bool = True) -> tuple[sparse.csr_array, int]:
    """The largest entries of every row, as many as a page has room for; 0 if that is all of them."""
    room = _MOST_ENTRIES if states <= MOST_EXACT else _MOST_ENTRIES_OF_MANY
    if matrix.nnz <= room:
        return matrix, 0
    each = max(1, room // states)
    row = np.repeat(np.arange(states), np.diff(matrix.indptr))
    order = np.lexsort((-matrix.data, row))
    rank = np.arange(row.size) - np.repeat(matrix.indptr[:-1], np.diff(matrix.indptr))
    chosen = order[rank < each]
    data, row = matrix.data[chosen], row[chosen]
    if scaled:
        sums = np.asarray(matrix.sum(axis=1)).ravel()
        data = data * (sums / np.maximum(np.bincount(row, data, states), 1e-300))[row]
    index = row, matrix.indices[chosen]
    return sparse.coo_array((data, index), shape=matrix.shape).tocsr(), each


def _spelled_out(whole: PooledTransition) -> PooledTransition:
    """The part that is displaced, entry by entry, where it is no kernel over a grid."""
    assert whole.displacement is not None
    near = np.zeros(whole.shape)
    for row in np.flatnonzero(whole.spread):
        there = whole.displacement.rows(whole.cell[[row]])[0]
        near[row, : there.size] = whole.spread[row] * there
    kept = sparse.csr_array(whole.kept + sparse.csr_array(near))
    return replace(whole, kept=kept, spread=np.zeros(whole.spread.size), displacement=None)


def _rounded(values: Floats) -> Floats:
    return values.astype(np.float32).astype(np.float64)
