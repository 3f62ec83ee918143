"""Mutation operators, against the distributions they are named after."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from nichechain import NichechainError, variation

NAMES = ["cauchy", "gaussian", "student-t", "uniform-ball"]


@pytest.mark.parametrize(
    ("name", "distribution"),
    [("cauchy", stats.cauchy), ("gaussian", stats.norm), ("student-t", stats.t(3))],
)
@pytest.mark.parametrize("scale", [1.0, 0.01, 25.0])
def test_noise_has_its_distribution_around_the_parent(name, distribution, scale):
    rng = np.random.default_rng(5)
    parent = rng.normal(size=20_000)
    child = variation.make(name, scale)(parent, rng)
    step = (child - parent) / scale
    assert stats.kstest(step, distribution.cdf).pvalue > 1e-3
    assert abs(np.corrcoef(stats.rankdata(step), stats.rankdata(parent))[0, 1]) < 4 / np.sqrt(step.size)


def test_noise_is_independent_across_weights():
    mutate = variation.gaussian()
    rng = np.random.default_rng(6)
    steps = np.array([mutate(np.zeros(4), rng) for _ in range(4000)])
    off_diagonal = np.corrcoef(steps.T)[~np.eye(4, dtype=bool)]
    assert np.abs(off_diagonal).max() < 4 / np.sqrt(4000)


@pytest.mark.parametrize(("n", "scale"), [(1, 1.0), (2, 0.3), (5, 4.0), (50, 1.0)])
def test_ball_steps_are_uniform_in_the_ball(n, scale):
    mutate = variation.uniform_ball(scale)
    rng = np.random.default_rng(n)
    steps = np.array([mutate(np.zeros(n), rng) for _ in range(3000)])
    radius = np.linalg.norm(steps, axis=1) / scale
    assert radius.max() <= 1 + 1e-15
    # A ball of r times the radius holds r^n of the volume.
    assert stats.kstest(radius**n, "uniform").pvalue > 1e-3
    # A coordinate x of a uniform point has density proportional to (1 − x²)^((n − 1) / 2).
    coordinate = stats.beta((n + 1) / 2, (n + 1) / 2, loc=-scale, scale=2 * scale)
    for axis in range(min(n, 3)):
        assert stats.kstest(steps[:, axis], coordinate.cdf).pvalue > 1e-3


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", NAMES)
def test_a_child_has_its_parents_shape_and_type_and_leaves_it_alone(name, dtype):
    parent = np.linspace(-1, 1, 1952).astype(dtype)
    before = parent.copy()
    child = variation.make(name, 0.1)(parent, np.random.default_rng(0))
    assert child.shape == parent.shape
    assert child.dtype == dtype
    assert not np.shares_memory(child, parent)
    np.testing.assert_array_equal(parent, before)


@given(name=st.sampled_from(NAMES), seed=st.integers(0, 2**32), n=st.integers(1, 40))
@settings(max_examples=40, deadline=None)
def test_a_child_is_a_function_of_parent_and_generator(name, seed, n):
    parent = np.arange(n, dtype=np.float32)
    mutate = variation.make(name, 0.7)
    first, second = np.random.default_rng(seed), np.random.default_rng(seed)
    np.testing.assert_array_equal(mutate(parent, first), mutate(parent, second))
    assert first.bit_generator.state == second.bit_generator.state
    assert not np.array_equal(mutate(parent, first), mutate(parent, np.random.default_rng(seed + 1)))


@pytest.mark.parametrize("name", NAMES)
def test_the_sum_is_rounded_once(name):
    # Parent and step differ so much in size that rounding the step first would give other bits.
    parent = np.linspace(0.5, 2.0, 500).astype(np.float32)
    child = variation.make(name, 0.3)(parent, np.random.default_rng(9))
    exact = variation.make(name, 0.3)(parent.astype(np.float64), np.random.default_rng(9))
    np.testing.assert_array_equal(child, exact.astype(np.float32))


@pytest.mark.parametrize("scale", [0.0, -1.0, np.nan, np.inf])
@pytest.mark.parametrize("name", NAMES)
def test_a_scale_must_be_positive(name, scale):
    with pytest.raises(NichechainError, match="scale is"):
        variation.make(name, scale)


def test_an_unknown_operator_is_named_with_those_there_are():
    with pytest.raises(
        NichechainError, match="'levy', but must be one of cauchy, gaussian, student-t, uniform-ball"
    ):
        variation.make("levy", 1.0)
