"""Births by family: the children of one elite, which take after each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.counts import TransitionCounts

Ints = NDArray[np.int64]


def families_of(counts: TransitionCounts) -> Ints:
    """Rows (state, elite, child, children); children of nobody in particular are elites' only ones."""
    known = TransitionCounts.from_pairs(
        counts.families[:, 0], counts.families[:, 2], counts.niches, counts.families[:, 3]
    )
    orphans = (counts.matrix - known.matrix).tocoo()
    parent, child = (np.repeat(axis, orphans.data) for axis in orphans.coords)
    number = counts.families[:, 1].max(initial=-1) + 1 + np.arange(parent.size)
    alone = np.stack([parent, number, child, np.ones_like(number)], axis=1)
    return np.concatenate([counts.families, alone]).astype(np.int64)


def counts_of_families(families: Ints, counts: TransitionCounts) -> TransitionCounts:
    """Counts of some families (F, 4), over the niches of the counts that they come from."""
    pairs = TransitionCounts.from_pairs(families[:, 0], families[:, 2], counts.niches, families[:, 3])
    return TransitionCounts(pairs.matrix, counts.niches, pairs.visits, families)
