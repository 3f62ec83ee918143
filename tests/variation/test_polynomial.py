"""Deb's polynomial mutation against DEAP's and against its distribution."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate, stats

from nichechain.core.errors import NichechainError
from nichechain.variation.polynomial import PolynomialMutation

gene = st.floats(-5, 5, width=32)


class Fixed:
    """A generator whose numbers are known."""

    def __init__(self, numbers):
        self.numbers = np.array(numbers)

    def random(self, shape):
        assert shape == self.numbers.shape
        return self.numbers


@given(gene, st.floats(0, 1, exclude_max=True), st.sampled_from([0.0, 1.0, 20.0, 45.0]))
def test_is_that_of_deap(value, number, eta):
    tools = pytest.importorskip("deap.tools")
    random = __import__("random")
    numbers = iter([0.0, number])
    original = random.random
    random.random = lambda: next(numbers)
    try:
        (expected,) = tools.mutPolynomialBounded([value], eta=eta, low=-5.0, up=5.0, indpb=1.0)
    finally:
        random.random = original
    child = PolynomialMutation(-5, 5, eta)(np.array([value]), Fixed([number]))
    np.testing.assert_allclose(child, expected, atol=1e-12)


@given(gene, gene, st.integers(0, 2**32))
def test_stays_within_bounds_and_keeps_the_type(low, width, seed):
    mutate = PolynomialMutation(low, low + abs(width) + 1, eta=2.0)
    parents = np.random.default_rng(seed).uniform(mutate.low, mutate.high, (50, 3)).astype(np.float32)
    children = mutate(parents, np.random.default_rng(seed))
    assert children.dtype == np.float32
    assert children.shape == parents.shape
    slack = np.spacing(np.float32(max(abs(mutate.low), abs(mutate.high))))
    assert (children >= mutate.low - slack).all()
    assert (children <= mutate.high + slack).all()


def test_steps_have_debs_distribution():
    """Far from the bounds the density of a step δ, as a share of the range, is (η + 1)/2·(1 − |δ|)^η."""
    eta = 45.0
    parents = np.zeros(20_000)
    steps = PolynomialMutation(-1, 1, eta)(parents, np.random.default_rng(0)) / 2

    def distribution(x):
        return np.where(
            x < 0, 0.5 * (1 + np.minimum(x, 0)) ** (eta + 1), 1 - 0.5 * (1 - np.abs(x)) ** (eta + 1)
        )

    assert stats.kstest(steps, distribution).pvalue > 0.01
    mean, _ = integrate.quad(lambda d: d * (eta + 1) * (1 - d) ** eta, 0, 1)
    assert mean == pytest.approx(1 / (eta + 2))
    assert np.abs(steps).mean() == pytest.approx(mean, rel=0.03)


def test_every_gene_moves_on_its_own():
    children = PolynomialMutation(-5, 5)(np.zeros((4000, 2)), np.random.default_rng(1))
    assert (children != 0).all()
    assert abs(np.corrcoef(children.T)[0, 1]) < 4 / math.sqrt(4000)


def test_a_gene_outside_is_taken_to_the_nearest_bound():
    mutate = PolynomialMutation(-5, 5)
    inside = mutate(np.array([5.0, -5.0]), np.random.default_rng(2))
    np.testing.assert_array_equal(mutate(np.array([9.0, -7.0]), np.random.default_rng(2)), inside)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((1, 1), "genes are from 1 to 1"),
        ((2, 1), "genes are from 2 to 1"),
        ((-math.inf, 1), "must have finite bounds"),
        ((0, math.nan), "must have finite bounds"),
        ((0, 1, -1), "eta is -1"),
        ((0, 1, math.inf), "eta is inf"),
    ],
)
def test_bad_input_is_one_sentence(values, message):
    with pytest.raises(NichechainError, match=message):
        PolynomialMutation(*values)
