"""Noise against the distributions it is named after, whole and truncated."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from nichechain import NichechainError, variation
from nichechain.variation.noise import BallNoise, CauchyNoise, GaussianNoise, StudentTNoise, truncated

INDEPENDENT = [
    (CauchyNoise(), stats.cauchy),
    (GaussianNoise(), stats.norm),
    (StudentTNoise(), stats.t(3)),
    (StudentTNoise(0.7), stats.t(0.7)),
    (StudentTNoise(30), stats.t(30)),
]


@pytest.mark.parametrize(("noise", "distribution"), INDEPENDENT)
def test_tails_and_their_inverses_are_those_of_scipy(noise, distribution):
    x = np.array([0.0, 1e-6, 0.3, 1.0, 4.0, 7.5])
    np.testing.assert_allclose(noise.tail(x), distribution.sf(x), rtol=1e-9)
    p = np.array([1e-12, 1e-5, 0.01, 0.2, 0.49])
    np.testing.assert_allclose(noise.from_tail(p), distribution.isf(p), rtol=1e-6)


@pytest.mark.parametrize(("noise", "distribution"), INDEPENDENT)
@pytest.mark.parametrize("limit", [1e-3, 0.5, 2.0, 40.0])
def test_truncated_noise_is_the_distribution_conditioned_on_the_interval(noise, distribution, limit):
    steps = truncated(noise, np.random.default_rng(1), np.full(20_000, limit))
    assert np.abs(steps).max() <= limit
    low, high = distribution.cdf([-limit, limit])
    assert stats.kstest(steps, lambda x: (distribution.cdf(x) - low) / (high - low)).pvalue > 1e-3


def test_moments_of_truncated_noise_are_those_in_closed_form():
    # Var of a standard Cauchy within ±c is c / atan(c) − 1; of a normal 1 − 2cφ(c) / (2Φ(c) − 1).
    for c in (0.5, 3.0):
        cauchy = truncated(CauchyNoise(), np.random.default_rng(2), np.full(200_000, c))
        assert cauchy.var() == pytest.approx(c / np.arctan(c) - 1, rel=0.02)
        normal = truncated(GaussianNoise(), np.random.default_rng(3), np.full(200_000, c))
        expected = 1 - 2 * c * stats.norm.pdf(c) / (2 * stats.norm.cdf(c) - 1)
        assert normal.var() == pytest.approx(expected, rel=0.02)
        for steps in (cauchy, normal):
            assert abs(steps.mean()) < 5 * steps.std() / np.sqrt(steps.size)


def test_every_coordinate_has_a_limit_of_its_own():
    limits = np.geomspace(1e-3, 1e3, 7)
    steps = np.array([truncated(CauchyNoise(), np.random.default_rng(k), limits) for k in range(4000)])
    # Half of a symmetric truncated distribution lies within its quartile.
    quartile = np.tan(np.arctan(limits) / 2)
    within = (np.abs(steps) <= quartile).mean(axis=0)
    np.testing.assert_allclose(within, 0.5, atol=5 * 0.5 / np.sqrt(4000))


def test_a_limit_that_nothing_lies_beyond_still_holds():
    steps = truncated(GaussianNoise(), np.random.default_rng(4), np.full(1000, 1e6))
    assert stats.kstest(steps, stats.norm.cdf).pvalue > 1e-3
    assert np.abs(steps).max() < 6


@pytest.mark.parametrize("df", [0.0, -1.0, np.nan, np.inf])
def test_degrees_of_freedom_are_positive(df):
    with pytest.raises(NichechainError, match="df is"):
        StudentTNoise(df)


def test_student_t_with_one_degree_of_freedom_is_cauchy():
    step = variation.student_t(0.5, df=1)(np.zeros(20_000), np.random.default_rng(5)) / 0.5
    assert stats.kstest(step, stats.cauchy.cdf).pvalue > 1e-3


def test_degrees_of_freedom_belong_to_student_t_alone():
    assert variation.noise_of("student-t", 5) == StudentTNoise(5)
    assert variation.noise_of("uniform-ball") == BallNoise()
    with pytest.raises(NichechainError, match="df is 5, but cauchy has no degrees of freedom"):
        variation.noise_of("cauchy", 5)
