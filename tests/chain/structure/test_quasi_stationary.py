"""Staying: closed forms, by hand, and what cannot be."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from scipy import sparse

from nichechain import NicheChain
from nichechain.chain.structure import inside
from nichechain.chain.structure.quasi_stationary import quasi_stationary_distribution

from .samples import MIXED, graded, ladder
from .test_passage import _gambler


def test_quasi_stationary_by_hand():
    # Of 0 ⇄ 1 in MIXED; 5 only leads in, so nobody who stays long is there.
    found = quasi_stationary_distribution(NicheChain(MIXED))
    inner = MIXED[:2, :2]
    # The larger root of λ² − 0.7 λ − 0.02.
    survival = (0.7 + np.sqrt(0.49 + 0.08)) / 2
    assert found.survival == pytest.approx(survival)
    np.testing.assert_allclose(found.distribution[:2] @ inner, survival * found.distribution[:2])
    assert found.distribution[2:].tolist() == [0, 0, 0, 0]
    assert found.distribution.sum() == pytest.approx(1.0)
    assert found.reason == ""


def test_quasi_stationary_downstream():
    # 0 is left slowly into 1, which is left fast: v_1 = 0.5 · 0.9 / (0.9 − 0.2) relative to v_0.
    chain = NicheChain([[0.9, 0.05, 0.05], [0.0, 0.2, 0.8], [0.0, 0.0, 1.0]])
    found = quasi_stationary_distribution(chain)
    ratio = 0.05 / (0.9 - 0.2)
    np.testing.assert_allclose(found.distribution, [1 / (1 + ratio), ratio / (1 + ratio), 0.0])
    assert found.survival == pytest.approx(0.9)


@pytest.mark.parametrize("size", [2, 9, 200, 801])
def test_quasi_stationary_of_a_walk_between_two_traps(size):
    # A fair walk on 1 … size between absorbing ends: cos(π/(size + 1)) and a sine; it is periodic.
    found = quasi_stationary_distribution(_gambler(size + 2, 0.5))
    assert found.survival == pytest.approx(np.cos(np.pi / (size + 1)), rel=1e-10)
    sine = np.sin(np.pi * np.arange(size + 2) / (size + 1))
    np.testing.assert_allclose(found.distribution, sine / sine.sum(), atol=1e-8 / size)


def test_quasi_stationary_where_there_is_none():
    ergodic = quasi_stationary_distribution(NicheChain(np.full((3, 3), 1 / 3)))
    assert np.isnan(ergodic.distribution).all()
    assert np.isnan(ergodic.survival)
    assert "no state is transient" in ergodic.reason
    street = quasi_stationary_distribution(NicheChain([[0, 1.0, 0], [0, 0, 1.0], [0, 0, 1.0]]))
    assert street.survival == 0.0
    assert "within a few generations" in street.reason
    twins = quasi_stationary_distribution(NicheChain([[0.5, 0, 0.5], [0, 0.5, 0.5], [0, 0, 1.0]]))
    assert np.isnan(twins.distribution).all()
    assert twins.survival == 0.5
    assert "2 parts" in twins.reason


def test_quasi_stationary_of_chosen_states():
    transition = np.array([[0.5, 0.25, 0.25], [0.1, 0.6, 0.3], [0.2, 0.2, 0.6]])
    chain = NicheChain(transition)
    found = quasi_stationary_distribution(chain, [0, 1])
    inner = transition[:2, :2]
    assert found.survival == pytest.approx(max(np.linalg.eigvals(inner).real))
    np.testing.assert_allclose(found.distribution[:2] @ inner, found.survival * found.distribution[:2])
    # All states are never left: the stationary distribution.
    whole = quasi_stationary_distribution(chain, [0, 1, 2])
    assert whole.survival == pytest.approx(1.0)
    np.testing.assert_allclose(whole.distribution @ transition, whole.distribution)


def test_a_set_that_is_hardly_ever_left():
    """The survival of a ladder's lower rungs is 1 to the last digit of a float, and not above it."""
    found = quasi_stationary_distribution(NicheChain(ladder(20, 0.1)), range(20))
    assert found.survival == 1.0
    # From mpmath, with 60 digits: 1 less the largest eigenvalue of T within.
    mpmath = pytest.importorskip("mpmath")
    with mpmath.workdps(60):
        inner = mpmath.matrix(ladder(20, 0.1).toarray()[:20, :20].tolist())
        for i in range(20):
            # The diagonal as the floats off it say, the way out at the top included.
            inner[i, i] = (
                1 - sum(inner[i, j] for j in range(20) if j != i) - (mpmath.mpf(0.1) if i == 19 else 0)
            )
        values, vectors = mpmath.eig(inner.T)
        best = max(range(20), key=lambda k: mpmath.re(values[k]))
        leaving = float(1 - mpmath.re(values[best]))
        vector = [float(mpmath.re(vectors[i, best] / sum(vectors[:, best]))) for i in range(20)]
    assert leaving == pytest.approx(5.85e-20, rel=1e-3)
    assert found.leaving == pytest.approx(leaving, rel=1e-12)
    np.testing.assert_allclose(found.distribution[:20], vector, rtol=1e-10)


@given(graded(5))
@example(np.array([[0.5, 0.5, 5e-14], [0.5 - 2.5e-9, 0.5 - 2.5e-9, 5e-9], [1 / 3, 1 / 3, 1 / 3]]))
@example(np.array([[0.5, 5e-28, 0.5], [0.4999975, 5e-6, 0.4999975], [1 / 3, 1 / 3, 1 / 3]]))
@settings(max_examples=40, deadline=None)
def test_laws_of_staying(transition):
    size = len(transition)
    found = quasi_stationary_distribution(NicheChain(transition), range(size - 1))
    if found.reason:
        return
    assert 0.0 <= found.survival <= 1.0
    share = found.distribution[:-1]
    # What leaves in a generation, without a subtraction.
    np.testing.assert_allclose(share @ transition[:-1, -1], found.leaving, rtol=1e-9)
    # Balance of each state: what comes in is what goes out and what the whole set loses.
    inner = transition[:-1, :-1].copy()
    np.fill_diagonal(inner, 0.0)
    out = inner.sum(axis=1) + transition[:-1, -1]
    np.testing.assert_allclose(share * out, share @ inner + found.leaving * share, rtol=1e-8)


def test_many_states_are_left_at_the_rate_that_few_are(monkeypatch):
    rng = np.random.default_rng(4)
    weights = sparse.random_array((300, 300), density=0.05, rng=rng) + 0.01 * sparse.eye_array(300)
    weights = sparse.csr_array(
        weights + sparse.diags_array([np.full(299, 0.1)], offsets=[1], shape=(300, 300))
    )
    chain = NicheChain(weights, normalize=True)
    by_elimination = quasi_stationary_distribution(chain, range(250))
    monkeypatch.setattr(inside, "_SMALL", 10)
    monkeypatch.setattr(inside, "_LITTLE_WORK", 10)
    by_iteration = quasi_stationary_distribution(chain, range(250))
    assert by_iteration.leaving == pytest.approx(by_elimination.leaving, rel=1e-8)
    np.testing.assert_allclose(by_iteration.distribution, by_elimination.distribution, atol=1e-9)
