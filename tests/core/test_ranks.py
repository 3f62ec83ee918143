"""Rank correlation against tables of the exact distribution and against SciPy's own permutations."""

from itertools import permutations

import numpy as np
import pytest
from scipy import stats

from nichechain.core.ranks import EXACT_BELOW, rank_correlation


@pytest.mark.parametrize(("n", "p"), [(3, 2 / 6), (4, 2 / 24), (5, 2 / 120), (7, 2 / 5040)])
def test_perfect_order_is_one_of_all_orders_and_its_mirror(n, p):
    assert rank_correlation(np.arange(n), np.arange(n) ** 3) == (pytest.approx(1), pytest.approx(p))
    assert rank_correlation(np.arange(n), -np.arange(n)) == (pytest.approx(-1), pytest.approx(p))


def test_ties_are_counted_by_brute_force():
    rng = np.random.default_rng(3)
    first, second = rng.integers(0, 4, (2, 6)).astype(float)
    rho, p = rank_correlation(first, second)
    every = [stats.spearmanr(first, order).statistic for order in permutations(second)]
    assert p == pytest.approx(np.mean(np.abs(every) >= abs(rho) - 1e-12))


def test_from_ten_on_it_is_scipys():
    first, second = np.random.default_rng(0).normal(size=(2, EXACT_BELOW))
    found = stats.spearmanr(first, second)
    assert rank_correlation(first, second) == (found.statistic, found.pvalue)
