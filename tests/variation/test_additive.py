"""Bounded neighbourhoods and scales by layer."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from nichechain import NichechainError, variation
from nichechain.variation import AdditiveMutation, Bound
from nichechain.variation.noise import BallNoise, CauchyNoise, GaussianNoise

NAMES = ["cauchy", "gaussian", "student-t", "uniform-ball"]
INDEPENDENT = NAMES[:3]


def distances(child, parent):
    return np.abs(child.astype(np.float64) - parent.astype(np.float64))


@given(
    name=st.sampled_from(INDEPENDENT),
    scale=st.floats(1e-3, 1e3),
    size=st.floats(1e-6, 1e6),
    magnitude=st.floats(-8, 8),
    dtype=st.sampled_from([np.float32, np.float64]),
    seed=st.integers(0, 2**32),
)
@settings(max_examples=150, deadline=None)
def test_a_child_never_leaves_the_cube(name, scale, size, magnitude, dtype, seed):
    rng = np.random.default_rng(seed)
    parent = (10**magnitude * rng.normal(size=60)).astype(dtype)
    child = variation.make(name, scale, bound=Bound("per-coordinate", size))(parent, rng)
    assert child.dtype == dtype
    assert distances(child, parent).max() <= size


@given(
    name=st.sampled_from(NAMES),
    scale=st.floats(1e-3, 1e3),
    size=st.floats(1e-6, 1e6),
    magnitude=st.floats(-8, 8),
    n=st.sampled_from([1, 2, 60, 1952]),
    dtype=st.sampled_from([np.float32, np.float64]),
    seed=st.integers(0, 2**32),
)
@settings(max_examples=150, deadline=None)
def test_a_child_never_leaves_the_ball(name, scale, size, magnitude, n, dtype, seed):
    rng = np.random.default_rng(seed)
    parent = (10**magnitude * rng.normal(size=n)).astype(dtype)
    child = variation.make(name, scale, bound=Bound("rescaled", size))(parent, rng)
    assert child.dtype == dtype
    # math.hypot is correctly rounded, so that the bound is tested and not the test's own sum.
    assert math.hypot(*distances(child, parent)) < size


@pytest.mark.parametrize("name", INDEPENDENT)
@pytest.mark.parametrize(("scale", "size"), [(1.0, 2.0), (0.1, 2.0), (5.0, 0.3)])
def test_a_cube_truncates_the_noise_at_its_scale(name, scale, size):
    distribution = {"cauchy": stats.cauchy, "gaussian": stats.norm, "student-t": stats.t(3)}[name]
    mutate = variation.make(name, scale, bound=Bound("per-coordinate", size))
    step = mutate(np.zeros(20_000), np.random.default_rng(7)) / scale
    low, high = distribution.cdf([-size / scale, size / scale])
    assert stats.kstest(step, lambda x: (distribution.cdf(x) - low) / (high - low)).pvalue > 1e-3


@pytest.mark.parametrize("name", NAMES)
def test_a_rescaled_step_keeps_its_direction_and_a_short_one_its_bits(name):
    parent = np.linspace(-1, 1, 300)
    free = variation.make(name, 1.0)(parent, np.random.default_rng(8))
    length = np.linalg.norm(free - parent)
    for size in (0.01 * length, 0.99 * length):
        near = variation.make(name, 1.0, bound=Bound("rescaled", size))(parent, np.random.default_rng(8))
        np.testing.assert_allclose(near - parent, (free - parent) * size / length, rtol=1e-6, atol=1e-12)
    wide = variation.make(name, 1.0, bound=Bound("rescaled", 1.01 * length))
    np.testing.assert_array_equal(wide(parent, np.random.default_rng(8)), free)


def test_rejection_is_hopeless_for_the_papers_operator():
    rng = np.random.default_rng(0)
    shortest = min(np.linalg.norm(rng.standard_cauchy(1952)) for _ in range(200))
    # The largest of n Cauchy coordinates is below x with probability (1 − 2/(πx))^n, about e^(−2n/(πx)).
    assert 0.5 < shortest / 515 < 1.5
    assert np.exp(-2 * 1952 / (np.pi * 50)) < 1e-10


def test_scales_of_layers_multiply_the_scale():
    layers, factors = (4000, 5000, 6000), (1.0, 0.1, 20.0)
    mutate = AdditiveMutation(GaussianNoise(), 0.5, None, layers, factors)
    step = mutate(np.zeros(15_000), np.random.default_rng(9))
    for part, factor in zip(np.split(step, [4000, 9000]), factors, strict=True):
        assert stats.kstest(part / (0.5 * factor), stats.norm.cdf).pvalue > 1e-3


@pytest.mark.parametrize("bound", [None, Bound("per-coordinate", 0.7), Bound("rescaled", 3.0)])
def test_layers_of_scale_1_change_no_bit(bound):
    parent = np.linspace(-2, 2, 500).astype(np.float32)
    plain = AdditiveMutation(CauchyNoise(), 0.3, bound)
    layered = AdditiveMutation(CauchyNoise(), 0.3, bound, (200, 300), (1.0, 1.0))
    np.testing.assert_array_equal(
        plain(parent, np.random.default_rng(1)), layered(parent, np.random.default_rng(1))
    )


def test_a_cube_is_the_same_in_every_layer():
    bound = Bound("per-coordinate", 0.2)
    mutate = AdditiveMutation(CauchyNoise(), 1.0, bound, (2000, 2000), (0.01, 100.0))
    narrow, wide = np.split(np.abs(mutate(np.zeros(4000), np.random.default_rng(2))), 2)
    assert narrow.max() <= 0.2
    # Noise far wider than the cube fills it evenly.
    assert stats.kstest(wide / 0.2, "uniform").pvalue > 1e-3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: Bound("sphere", 1.0),
            "kind of step bound is 'sphere', but must be one of per-coordinate, rescaled",
        ),
        (lambda: Bound("rescaled", 0.0), "step_bound is 0.0, but must be a positive number"),
        (lambda: Bound("rescaled", math.inf), "step_bound is inf"),
        (lambda: Bound("per-coordinate", math.nan), "step_bound is nan"),
        (
            lambda: variation.make("uniform-ball", 1.0, bound=Bound("per-coordinate", 1.0)),
            "uniform-ball cannot be bounded per coordinate",
        ),
        (
            lambda: AdditiveMutation(BallNoise(), 1.0, None, (3, 4), (1.0,)),
            r"layer scales are 1, but there are 2 layers \(3, 4 weights\): one scale per layer",
        ),
        (lambda: AdditiveMutation(BallNoise(), 1.0, None, (3,), (0.0,)), "layer_scale is 0"),
        (
            lambda: AdditiveMutation(BallNoise(), 1.0, None, (3, 4), (1.0, 2.0))(
                np.zeros(8), np.random.default_rng(0)
            ),
            "the layers have 3, 4 weights, 7 together, but the genotype has 8",
        ),
    ],
)
def test_what_does_not_fit_is_named(make, message):
    with pytest.raises(NichechainError, match=message):
        make()
