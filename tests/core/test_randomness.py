"""Generators keyed by seed, purpose and index."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy import stats

from nichechain.core.randomness import Purpose, keyed


def test_equal_keys_give_equal_draws():
    for key in itertools.product((0, 7, 2**40), Purpose, (0, 1, 2**35)):
        np.testing.assert_array_equal(keyed(*key).random(5), keyed(*key).random(5))


def test_distinct_keys_give_distinct_draws():
    # Seeds and indices of one word and of two, which naive concatenation of words would confuse.
    numbers = (0, 1, 2, 3, 2**32 - 1, 2**32, 2**32 + 1, 2**40)
    keys = list(itertools.product(numbers, Purpose, numbers))
    drawn = {keyed(*key).bytes(16) for key in keys}
    assert len(drawn) == len(keys)


def test_the_index_is_zero_unless_given():
    assert keyed(3, Purpose.WALKS).random() == keyed(3, Purpose.WALKS, 0).random()


def test_purposes_are_numbered_as_archives_have_them():
    # An old number with a new meaning would replay old archives differently.
    written = {
        "INITIAL": 0,
        "SELECTION": 1,
        "MUTATION": 2,
        "REPLACEMENT": 3,
        "POSTERIOR": 4,
        "WALKS": 5,
        "OFFSPRING": 6,
        "FIRST_GENERATION": 7,
    }
    assert written.items() <= {name: int(purpose) for name, purpose in Purpose.__members__.items()}.items()
    # Two names for one number would share their draws.
    assert len(set(Purpose.__members__.values())) == len(Purpose.__members__)


@pytest.mark.parametrize("purpose", [Purpose.MUTATION, Purpose.POSTERIOR])
def test_generators_of_neighbouring_indices_are_independent(purpose):
    first = np.array([keyed(0, purpose, index).random(2) for index in range(4000)])
    assert stats.kstest(first[:, 0], "uniform").pvalue > 1e-3
    # First draw against the next generator's first, and against its own second.
    assert abs(np.corrcoef(first[:-1, 0], first[1:, 0])[0, 1]) < 4 / np.sqrt(4000)
    assert abs(np.corrcoef(first[:, 0], first[:, 1])[0, 1]) < 4 / np.sqrt(4000)
