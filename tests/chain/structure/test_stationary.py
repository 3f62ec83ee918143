"""The long run: closed forms, exact arithmetic, and what QuantEcon says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate
from nichechain.chain.structure import transitions as rows
from nichechain.chain.structure.passage import hitting_probabilities
from nichechain.chain.structure.stationary import (
    entropy_rate,
    long_run_distribution,
    stationary_distribution,
)

from .samples import MIXED, exact_stationary, graded, ladder


def test_stationary_distribution_of_each_class():
    found = stationary_distribution(NicheChain(MIXED))
    # Detailed balance of the pair: π_3 · 1 = π_4 · 1/4.
    np.testing.assert_allclose(found, [[0, 0, 1, 0, 0, 0], [0, 0, 0, 0.2, 0.8, 0]], atol=1e-15)


@pytest.mark.parametrize("size", [3, 50, 1500])
def test_stationary_distribution_of_a_birth_death_chain(size):
    # Up with p, down with q: π_i ∝ (p/q)^i, and uniform where p = q; periodic without the lazy ends.
    up, down = 0.3, 0.31
    transition = np.zeros((size, size))
    for i in range(size):
        transition[i, min(i + 1, size - 1)] += up
        transition[i, max(i - 1, 0)] += down
        transition[i, i] += 1.0 - up - down
    expected = (up / down) ** np.arange(size)
    found = stationary_distribution(NicheChain(sparse.csr_array(transition)))
    np.testing.assert_allclose(found, [expected / expected.sum()], rtol=1e-8)


def test_stationary_distribution_of_many_states_is_uniform_on_a_torus():
    # Doubly stochastic: every step is as probable as its opposite.
    n = 40
    i = np.arange(n * n)
    x, y = divmod(i, n)
    to = [((x + dx) % n) * n + (y + dy) % n for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))]
    where = np.tile(i, 4), np.concatenate(to)
    transition = sparse.csr_array((np.full(4 * i.size, 0.25), where), shape=(n * n, n * n))
    found = stationary_distribution(NicheChain(transition))
    np.testing.assert_allclose(found, np.full((1, n * n), 1.0 / n**2), rtol=1e-8)


def test_entropy_rates():
    # A fair coin is one bit a toss; a cycle without choice none; T of iid rows the entropy of a row.
    coin = np.full((2, 2), 0.5)
    both = sparse.block_diag([coin, np.roll(np.eye(3), 1, axis=1), np.tile([0.5, 0.25, 0.25], (3, 1))])
    np.testing.assert_allclose(entropy_rate(NicheChain(both)), [1.0, 0.0, 1.5], atol=1e-12)
    # Cover and Thomas, two states: H = (β h(α) + α h(β)) / (α + β).
    alpha, beta = 0.3, 0.1

    def bits(p):
        return -p * np.log2(p) - (1 - p) * np.log2(1 - p)

    two = NicheChain([[1 - alpha, alpha], [beta, 1 - beta]])
    expected = (beta * bits(alpha) + alpha * bits(beta)) / (alpha + beta)
    np.testing.assert_allclose(entropy_rate(two), [expected])


@pytest.mark.parametrize("exponent", [9, 14, 100, 290])
def test_states_that_are_hardly_ever_left(exponent):
    e = 10.0**-exponent
    chain = NicheChain([[1 - e, e], [e / 10, 1 - e / 10]])
    np.testing.assert_allclose(stationary_distribution(chain), [[1 / 11, 10 / 11]], rtol=1e-15)


@given(graded())
@settings(max_examples=40, deadline=None)
def test_every_entry_is_right(transition):
    """Probabilities from 1 to 1e-30 in one matrix, against rational arithmetic on the same floats."""
    found = stationary_distribution(NicheChain(transition))
    np.testing.assert_allclose(found[0], exact_stationary(transition), rtol=1e-13)


@given(st.integers(0, 1000), st.integers(2, 90))
@settings(max_examples=20, deadline=None)
def test_equals_elimination_by_quantecon(seed, size):
    gth = pytest.importorskip("quantecon.markov.gth_solve")
    transition = np.random.default_rng(seed).dirichlet(np.full(size, 0.05) + 1e-3, size)
    transition = 0.999 * transition + 0.001 / size
    found = stationary_distribution(NicheChain(transition))
    np.testing.assert_allclose(found[0], gth.gth_solve(transition), rtol=1e-12)


@pytest.mark.parametrize(("top", "up"), [(20, 0.1), (400, 0.1), (400, 0.9), (72_000, 0.49)])
def test_the_long_run_of_a_ladder(top, up):
    # Detailed balance: π_i ∝ (p/q)^i, from 1 down to what floats do not hold any more.
    found = stationary_distribution(NicheChain(ladder(top, up)))[0]
    exponent = np.arange(top + 1) * np.log(up / (1 - up))
    expected = np.exp(exponent - exponent.max())
    expected /= expected.sum()
    held = expected > 1e-300
    np.testing.assert_allclose(found[held], expected[held], rtol=1e-9)


def test_the_long_run_of_a_root():
    chain = NicheChain(MIXED)
    each = stationary_distribution(chain)
    ends = np.stack([hitting_probabilities(chain, 2), hitting_probabilities(chain, 3)], axis=1)
    for root in range(6):
        np.testing.assert_allclose(long_run_distribution(chain, root), ends[root] @ each, atol=1e-15)
    both = long_run_distribution(chain, [2, 3])
    np.testing.assert_allclose(both, 0.5 * each.sum(axis=0))
    # A long walk agrees.
    walked = np.linalg.matrix_power(0.5 * (np.eye(6) + MIXED), 4000)
    np.testing.assert_allclose(walked[5], long_run_distribution(chain, 5), atol=1e-12)


def test_many_classes_are_refused_before_memory_is_asked_for():
    chain = NicheChain(sparse.eye_array(72_001, format="csr"), outside=72_000)
    with pytest.raises(NichechainError, match=r"72001 recurrent classes of a chain of 72001 states.*39 GiB"):
        stationary_distribution(chain)
    assert long_run_distribution(chain, 5)[5] == 1.0


def _estimated(shape, births=4000):
    niches = GridNiches(shape, ((0.0, 1.0), (0.0, 1.0)))
    rng = np.random.default_rng(0)
    pairs = rng.integers(niches.states, size=(2, births))
    return estimate(TransitionCounts.from_pairs(*pairs, niches), strength=5.0)


def test_a_posterior_mean_in_parts_has_the_same_long_run(monkeypatch):
    chain = _estimated((12, 12))
    whole = stationary_distribution(chain)
    monkeypatch.setattr(rows, "_WHOLE", 10)
    np.testing.assert_allclose(stationary_distribution(chain), whole, rtol=1e-8)


def test_a_posterior_mean_of_many_states():
    chain = _estimated((268, 268))
    with pytest.raises(NichechainError, match=r"T of 71825 states would take 38\.4 GiB"):
        _ = chain.T
    found = stationary_distribution(chain)
    assert found.shape == (1, 71_825)
    np.testing.assert_allclose(found[0] @ chain.operator, found[0], rtol=1e-8)
