"""Broods: children that whoever evaluates them grows."""

from __future__ import annotations

import numpy as np
import pytest

from nichechain import variation
from nichechain.core.randomness import Purpose, keyed
from nichechain.variation.unborn import Unborn, grown, litters

PARENTS = np.random.default_rng(0).normal(size=(3, 7)).astype(np.float32)
SEEDS = (5, 2**80, 6)
ROWS = np.array([2, 0, 0, 1, 2, 1])
NUMBERS = np.array([0, 9, 2**33, 4, 0, 2**62])


@pytest.fixture
def unborn() -> Unborn:
    return Unborn(variation.cauchy(), Purpose.MUTATION, PARENTS, SEEDS, ROWS, NUMBERS)


def expected() -> np.ndarray:
    mutate = variation.cauchy()
    return np.stack(
        [
            mutate(PARENTS[row], keyed(SEEDS[row], Purpose.MUTATION, number))
            for row, number in zip(ROWS.tolist(), NUMBERS.tolist(), strict=True)
        ]
    )


def test_a_child_is_a_function_of_its_parent_its_seed_and_its_number(unborn: Unborn) -> None:
    assert len(unborn) == 6
    assert unborn.grow().dtype == np.float32
    np.testing.assert_array_equal(unborn.grow(), expected())
    np.testing.assert_array_equal(np.asarray(unborn), expected())
    np.testing.assert_array_equal(grown(unborn), expected())
    assert np.asarray(unborn, np.float64).dtype == np.float64


@pytest.mark.parametrize("rows", [slice(1, 4), np.array([5, 0]), np.arange(6) % 2 == 0, slice(0, 0)])
def test_some_of_the_unborn_are_the_same_children(unborn: Unborn, rows: slice | np.ndarray) -> None:
    np.testing.assert_array_equal(unborn[rows].grow(), expected()[rows])


def test_siblings_of_litters_share_their_noise() -> None:
    unborn = litters(variation.gaussian(), Purpose.OFFSPRING, PARENTS, 4, 5)
    steps = unborn.grow().reshape(3, 5, 7) - PARENTS[:, None]
    for i in range(5):
        noise = keyed(4, Purpose.OFFSPRING, i).standard_normal(7)
        np.testing.assert_allclose(steps[:, i], np.broadcast_to(noise, (3, 7)), atol=1e-6)
    assert litters(variation.gaussian(), Purpose.OFFSPRING, PARENTS[:0], 4, 5).grow().shape == (0, 7)


def test_genotypes_that_are_grown_stay_as_they_are() -> None:
    assert grown(PARENTS) is PARENTS


def test_no_operator_changes_a_parent_that_siblings_share() -> None:
    def careless(parent: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        parent += rng.standard_normal(parent.size).astype(np.float32)
        return parent

    unborn = Unborn(careless, Purpose.MUTATION, PARENTS.copy(), SEEDS, ROWS, NUMBERS)
    with pytest.raises(ValueError, match="read-only"):
        unborn.grow()
