"""Classes and long run of a chain: closed forms, brute force, and what QuantEcon and deeptime say."""

from __future__ import annotations

import itertools
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from scipy import sparse

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate
from nichechain.chain.structure.classes import (
    absorbing_niches,
    betweenness,
    communicating_classes,
    entropy_rate,
    recurrent_classes,
    stationary_distribution,
    to_deeptime,
)

from .samples import MIXED, transitions


def _as_lists(classes):
    return [states.tolist() for states in classes]


@pytest.mark.parametrize("form", [np.array, sparse.csr_array])
def test_classes_by_hand(form):
    chain = NicheChain(form(MIXED), outside=5)
    assert _as_lists(communicating_classes(chain)) == [[0, 1], [2], [3, 4], [5]]
    assert _as_lists(recurrent_classes(chain)) == [[2], [3, 4]]
    assert absorbing_niches(chain).tolist() == [2]


def test_classes_above_a_threshold():
    chain = NicheChain(MIXED)
    # Without 0 → 1 (0.3) the two no longer communicate; the threshold itself does not count.
    assert _as_lists(communicating_classes(chain, threshold=0.24)) == [[0, 1], [2], [3, 4], [5]]
    assert _as_lists(communicating_classes(chain, threshold=0.3)) == [[0], [1], [2], [3], [4], [5]]
    assert _as_lists(recurrent_classes(chain, threshold=0.3)) == [[0], [2], [4]]
    for threshold in (-0.1, 1.0, np.nan):
        with pytest.raises(NichechainError, match="threshold is"):
            communicating_classes(chain, threshold=threshold)


def test_explicit_zeros_are_no_transitions():
    stored = sparse.csr_array((np.array([1.0, 0.0, 1.0]), ([0, 0, 1], [0, 1, 1])), shape=(2, 2))
    chain = NicheChain(stored)
    assert _as_lists(recurrent_classes(chain)) == [[0], [1]]
    assert absorbing_niches(chain).tolist() == [0, 1]


@given(transitions())
@settings(max_examples=60, deadline=None)
def test_classes_and_stationary_distributions_equal_quantecon(transition):
    quantecon = pytest.importorskip("quantecon")
    oracle = quantecon.MarkovChain(transition)
    chain = NicheChain(transition)
    expected = sorted(sorted(c.tolist()) for c in oracle.communication_classes)
    assert _as_lists(communicating_classes(chain)) == expected
    recurrent = _as_lists(recurrent_classes(chain))
    assert recurrent == sorted(sorted(c.tolist()) for c in oracle.recurrent_classes)
    theirs = {tuple(np.flatnonzero(row > 0)): row for row in oracle.stationary_distributions}
    for states, row in zip(recurrent, stationary_distribution(chain), strict=True):
        np.testing.assert_allclose(row, theirs[tuple(states)], atol=1e-12)


@given(transitions())
@settings(max_examples=60, deadline=None)
def test_laws_of_classes(transition):
    chain = NicheChain(transition)
    classes = communicating_classes(chain)
    assert sorted(itertools.chain.from_iterable(_as_lists(classes))) == list(range(len(transition)))
    # The reachability of the graph, by repeated squaring.
    reach = np.linalg.matrix_power(np.eye(len(transition)) + transition, len(transition)) > 0
    for states in classes:
        assert reach[np.ix_(states, states)].all()
        others = np.setdiff1d(np.arange(len(transition)), states)
        assert not (reach[np.ix_(states, others)] & reach[np.ix_(others, states)].T).any()
    assert recurrent_classes(chain)
    distributions = stationary_distribution(chain)
    np.testing.assert_allclose(distributions @ transition, distributions, atol=1e-12)
    np.testing.assert_allclose(distributions.sum(axis=1), 1.0)


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


def _most_probable_paths(transition, i, j):
    """All simple paths from i to j of the largest probability, by enumeration."""
    best, found = 0.0, []
    others = [k for k in range(len(transition)) if k not in (i, j)]
    for size in range(len(others) + 1):
        for middle in itertools.permutations(others, size):
            path = (i, *middle, j)
            probability = np.prod([transition[a, b] for a, b in itertools.pairwise(path)])
            if probability > best * (1 + 1e-12):
                best, found = probability, [path]
            elif probability > 0 and probability > best * (1 - 1e-12):
                found.append(path)
    return found


def test_betweenness_equals_enumeration_of_paths():
    rng = np.random.default_rng(4)
    n = 5
    transition = rng.dirichlet(np.full(n, 0.5), n)
    expected = np.zeros(n)
    for i, j in itertools.permutations(range(n), 2):
        paths = _most_probable_paths(transition, i, j)
        for path in paths:
            expected[list(path[1:-1])] += 1.0 / len(paths)
    found = betweenness(NicheChain(transition), threshold=0.0)
    np.testing.assert_allclose(found, expected / ((n - 1) * (n - 2)))


def test_betweenness_of_certain_steps_and_of_lonely_states():
    # A one-way street 0 → 1 → 2 → 3 of certain steps: 1 and 2 lie on two of six ordered pairs of others.
    street = NicheChain(np.eye(4, k=1) + np.diag([0, 0, 0, 1.0]))
    np.testing.assert_allclose(betweenness(street), [0.0, 2 / 6, 2 / 6, 0.0])
    assert betweenness(NicheChain(np.eye(3))).tolist() == [0.0, 0.0, 0.0]
    assert betweenness(NicheChain([[1.0]])).tolist() == [0.0]
    with pytest.raises(NichechainError, match="threshold"):
        betweenness(street, threshold=2.0)


def test_betweenness_counts_states_that_the_graph_leaves_out():
    niches = GridNiches((5,), ((0.0, 1.0),))
    counts = TransitionCounts.from_births([-1, 0, 1], [0, 1, 2], niches)
    found = betweenness(estimate(counts, "mle"))
    # Only the path 0 → 1 → 2 exists, among 5 · 4 ordered pairs of the other five states.
    assert found.shape == (6,)
    np.testing.assert_allclose(found, [0, 1 / 20, 0, 0, 0, 0])


def test_to_deeptime():
    pytest.importorskip("deeptime")
    transition = np.array([[0.5, 0.5, 0.0], [0.2, 0.5, 0.3], [0.0, 0.4, 0.6]])
    for form in (np.array, sparse.csr_array):
        chain = NicheChain(form(transition))
        model = to_deeptime(chain)
        assert model.n_states == 3
        np.testing.assert_allclose(model.stationary_distribution, stationary_distribution(chain)[0])
    assert to_deeptime(NicheChain(MIXED)).n_states == 6


def test_to_deeptime_without_deeptime(monkeypatch):
    monkeypatch.setitem(sys.modules, "deeptime", None)
    monkeypatch.setitem(sys.modules, "deeptime.markov.msm", None)
    with pytest.raises(NichechainError, match="deeptime is not installed"):
        to_deeptime(NicheChain(MIXED))


def test_a_posterior_mean_has_one_class():
    niches = GridNiches((3,), ((0.0, 1.0),))
    chain = estimate(TransitionCounts.from_pairs([0, 1, 3], [1, 1, 0], niches))
    assert _as_lists(communicating_classes(chain)) == [[0, 1, 2, 3]]
    assert absorbing_niches(chain).size == 0
    np.testing.assert_allclose(stationary_distribution(chain) @ chain.T, stationary_distribution(chain))
