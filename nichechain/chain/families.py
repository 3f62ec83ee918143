"""Births by family: the children of one elite, which take after each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.counts import TransitionCounts

Ints = NDArray[np.int64]


def orphans_of(counts: TransitionCounts) -> tuple[Ints, Ints, Ints]:
    """Births that do not say whose they are: states of parent and child, and how many, (E,) each."""
    index = counts.families[:, 0], counts.families[:, 2]
    known = sparse.coo_array((counts.families[:, 3], index), shape=counts.matrix.shape).tocsr()
    left = (counts.matrix - known).tocoo()
    some = left.data > 0
    parent, child = (axis[some].astype(np.int64) for axis in left.coords)
    return parent, child, left.data[some]


def families_of(counts: TransitionCounts) -> Ints:
    """Rows (state, elite, child, children); children of nobody in particular are elites' only ones."""
    *states, number = orphans_of(counts)
    parent, child = (np.repeat(axis, number) for axis in states)
    elite = counts.families[:, 1].max(initial=-1) + 1 + np.arange(parent.size)
    alone = np.stack([parent, elite, child, np.ones_like(elite)], axis=1)
    return np.concatenate([counts.families, alone]).astype(np.int64)


def counts_of_families(families: Ints, counts: TransitionCounts) -> TransitionCounts:
    """Counts of some families (F, 4), over the niches of the counts that they come from."""
    pairs = TransitionCounts.from_pairs(families[:, 0], families[:, 2], counts.niches, families[:, 3])
    return TransitionCounts(pairs.matrix, counts.niches, pairs.visits, families)
