"""The kernel density metric: against SciPy's estimate, and the paper's remark on two points."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from nichechain import NichechainError
from nichechain.walks.diversity import KernelDensity, KNearest, Surroundings, kernel_density


def _around(siblings, archive, age=None):
    siblings, archive = np.asarray(siblings, float), np.asarray(archive, float)
    age = np.ones(archive.shape[:2], np.int64) if age is None else np.asarray(age)
    path = siblings[:, None, :1]
    return Surroundings(siblings, archive, age, path, np.ones(siblings.shape[2]))


def _score(metric, around):
    count = around.siblings.shape[1]
    return metric(around.siblings, np.zeros(count, np.int64), np.arange(count), around)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 3), st.sampled_from([0.2, 0.5, 2.0]))
def test_a_factor_is_scipys_bw_method(seed, axes, factor):
    rng = np.random.default_rng(seed)
    siblings, archive = rng.normal(size=(2, 6, axes)), rng.normal(size=(2, 5, axes)) + 1
    score = _score(KernelDensity(factor), _around(siblings, archive))
    for walk in range(2):
        pool = np.concatenate([siblings[walk], archive[walk]])
        estimate = stats.gaussian_kde(pool.T, bw_method=factor)
        peak = 1 / math.sqrt((2 * math.pi) ** axes * np.linalg.det(estimate.covariance))
        # SciPy's estimate is the mean over all, each point's own kernel among them.
        others = (len(pool) * estimate(siblings[walk].T) - peak) / (len(pool) - 1)
        np.testing.assert_allclose(score[walk], -others, rtol=1e-6, atol=1e-9 * peak)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32), st.booleans())
def test_a_length_and_a_matrix_are_sums_of_normal_densities(seed, archive):
    rng = np.random.default_rng(seed)
    siblings, remembered = rng.normal(size=(3, 5, 2)), rng.normal(size=(3, 4, 2))
    siblings[1, 2] = remembered[0, 3] = np.nan
    age = rng.integers(1, 9, (3, 4))
    around = _around(siblings, remembered, age)
    slanted = ((0.5, 0.2), (0.2, 0.3))
    for metric, matrix in (
        (KernelDensity(0.7, "length", 0.9, archive), 0.49 * np.eye(2)),
        (KernelDensity(slanted, "matrix", 0.9, archive), np.array(slanted)),
    ):
        score = _score(metric, around)
        for walk, i in np.ndindex(3, 5):
            point = siblings[walk, i]
            others = [(other, 0) for j, other in enumerate(siblings[walk]) if j != i]
            if archive:
                others += list(zip(remembered[walk], age[walk], strict=True))
            densities = [
                stats.multivariate_normal.pdf(point, other, matrix) * 0.9**years
                for other, years in others
                if not np.isnan(other).any()
            ]
            expected = math.nan if np.isnan(point).any() else -np.mean(densities)
            assert score[walk, i] == pytest.approx(expected, nan_ok=True, rel=1e-9)


def test_between_two_points_neighbours_are_indifferent_and_kernels_prefer_the_middle():
    """The paper's remark on points A and B, which holds where they are far apart."""
    ends = np.array([[[0.0, 0.0], [1.0, 1.0]]])
    share = np.linspace(0.1, 0.9, 9)[:, None]
    # Each point alone with A and B: nine walks of one sibling.
    between = (share * ends[0, 1])[:, None, :]
    around = _around(between, np.repeat(ends, 9, axis=0))
    np.testing.assert_allclose(_score(KNearest(2), around), math.sqrt(2), rtol=1e-12)
    far = _score(KernelDensity(0.3, "length"), around)[:, 0]
    assert far.argmax() == 4
    # The kernels of points closer than two bandwidths merge into one bump: the middle is the worst.
    close = _score(KernelDensity(0.8, "length"), around)[:, 0]
    assert close.argmin() == 4


def test_what_was_long_ago_weighs_less():
    siblings = np.array([[[0.0], [1.0]]])
    ages = np.array([[1, 10]])
    for decay, expected in ((1.0, 0), (0.5, 1)):
        around = _around(siblings, [[[0.0], [1.0]]], ages)
        score = _score(KernelDensity(0.1, "length", decay), around)[0]
        assert (score[1] > score[0]) == bool(expected)
    # Nobody else is near: each sibling sees its twin in the archive, of three others.
    np.testing.assert_allclose(score, -stats.norm.pdf(0, scale=0.1) * np.array([0.5, 0.5**10]) / 3)


def test_a_ridge_keeps_offspring_that_did_not_move_apart_from_one_that_did():
    still = np.repeat([[[0.3, 0.7]]], 30, axis=1)
    score = _score(KernelDensity(), _around(still, np.empty((1, 0, 2))))
    # All at one point: the value at 0 of a kernel of the ridge alone.
    np.testing.assert_allclose(score, -1 / (2 * math.pi * 1e-12), rtol=1e-9)
    still[0, 4] += [0.01, 0.0]
    score = _score(KernelDensity(), _around(still, np.empty((1, 0, 2))))[0]
    assert score.argmax() == 4
    assert np.isfinite(score).all()


def test_offspring_far_out_leave_the_bandwidth_regular():
    siblings = np.random.default_rng(0).normal(size=(1, 5, 2)) * 1e-9
    siblings[0, 0] = [1e6, 1e6]
    score = _score(KernelDensity(), _around(siblings, np.empty((1, 0, 2))))[0]
    assert np.isfinite(score).all()
    assert score.argmax() == 0


def test_nobody_there_is_no_density():
    alone = np.array([[[1.0, 2.0]]])
    assert _score(KernelDensity(), _around(alone, np.empty((1, 0, 2)))).item() == 0.0
    gone = np.full((1, 3, 2), np.nan)
    assert kernel_density(alone, gone, np.eye(2)).item() == 0.0


def test_many_walks_are_scored_block_by_block():
    rng = np.random.default_rng(0)
    pool = rng.normal(size=(3, 1200, 2))
    matrix = np.array([[0.3, 0.1], [0.1, 0.2]])
    density = kernel_density(pool, pool, matrix, itself=np.arange(1200))
    estimate = stats.multivariate_normal.pdf(pool[2, 1100] - pool[2], cov=matrix)
    assert density[2, 1100] == pytest.approx((estimate.sum() - estimate[1100]) / 1199)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: KernelDensity(0.0), "bandwidth is 0.0"),
        (lambda: KernelDensity(-1.0, "length"), "bandwidth is -1.0"),
        (lambda: KernelDensity(math.nan), "bandwidth is nan"),
        (lambda: KernelDensity(((1.0,),)), "must be a number"),
        (lambda: KernelDensity(0.5, "scott"), "mode is 'scott'"),
        (lambda: KernelDensity(decay=0.0), "decay is 0.0"),
        (lambda: KernelDensity(decay=1.1), "decay is 1.1"),
        (lambda: KernelDensity(((1.0, 1.0), (1.0, 1.0)), "matrix"), "singular"),
        (lambda: KernelDensity(((1.0, 0.0), (0.0, -1.0)), "matrix"), "smallest eigenvalue -1"),
        (lambda: KernelDensity(((1.0, 0.5), (0.0, 1.0)), "matrix"), "not symmetric"),
        (lambda: KernelDensity(((1.0, math.nan), (math.nan, 1.0)), "matrix"), "must be finite"),
        (lambda: KernelDensity(0.5, "matrix"), "must be square"),
        (lambda: kernel_density(np.zeros((1, 1, 3)), np.zeros((1, 1, 3)), np.eye(2)), r"needs \(3, 3\)"),
    ],
)
def test_bad_input_is_one_sentence(call, message):
    with pytest.raises(NichechainError, match=message):
        call()
