"""Rank correlation with a p-value that small samples can be believed with."""

from __future__ import annotations

from functools import cache
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

EXACT_BELOW = 10
"""Samples smaller than this have exact or permutation p-values: the usual ones are asymptotic."""


def rank_correlation(first: Floats, second: Floats) -> tuple[float, float]:
    """Spearman's rank correlation of two samples, and the p-value of its two-sided test.

    Below :data:`EXACT_BELOW` pairs, p is the share of all orders of the second sample in which the
    correlation is as far from 0 as observed; from there on, that of Student's t (SciPy's).

    Parameters
    ----------
    first, second : (N,) arrays
        At least 2 numbers each, not all alike.
    """
    from scipy import stats

    found = stats.spearmanr(first, second)
    rho = float(found.statistic)
    if len(first) >= EXACT_BELOW:
        return rho, float(found.pvalue)
    ranks = [stats.rankdata(sample) - (len(first) + 1) / 2 for sample in (first, second)]
    products = ranks[1][_orders(len(first))] @ ranks[0]
    # Ranks are halves of whole numbers, so their products are exact.
    return rho, float(np.mean(np.abs(products) >= abs(ranks[1] @ ranks[0])))


@cache
def _orders(n: int) -> NDArray[np.int8]:
    """All orders of n things, (n!, n)."""
    return np.array(list(permutations(range(n))), np.int8)
