"""What some of a sample would have shown, against all ways to draw them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from nichechain.core.rarefaction import distinct_among, mean_product

from ..choices import mean_distinct


@pytest.mark.parametrize("size", range(1, 8))
def test_distinct_kinds_are_those_of_all_subsets(size):
    # Two of the sample are of no kind that counts.
    sample = [0, 0, 0, 1, 2, None, None]
    expected = mean_distinct(sample, size, nowhere=[None])
    np.testing.assert_allclose(distinct_among(np.array([3, 1, 1, 0]), 7, size), expected, rtol=1e-12)


@pytest.mark.parametrize("size", range(6))
def test_mean_products_are_those_of_all_subsets(size):
    values = np.random.default_rng(0).random((5, 3))
    every = [values[list(rows)].prod(axis=0) for rows in combinations(range(5), size)]
    np.testing.assert_allclose(mean_product(values, size), np.mean(every, axis=0), rtol=1e-12)


def test_both_agree_where_values_say_who_is_there():
    kinds = np.random.default_rng(1).integers(0, 6, 40)
    absent = 1.0 - (kinds[:, None] == np.arange(6))
    found = (1.0 - mean_product(absent, 7)).sum()
    np.testing.assert_allclose(found, distinct_among(np.bincount(kinds), 40, 7), rtol=1e-12)
