"""Classes of a chain: by hand, by brute force, and what QuantEcon says."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from scipy import sparse

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate
from nichechain.chain.structure.classes import (
    absorbing_niches,
    communicating_classes,
    period,
    recurrent_classes,
)
from nichechain.chain.structure.stationary import stationary_distribution

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


def test_a_posterior_mean_has_one_class():
    niches = GridNiches((3,), ((0.0, 1.0),))
    chain = estimate(TransitionCounts.from_pairs([0, 1, 3], [1, 1, 0], niches))
    assert _as_lists(communicating_classes(chain)) == [[0, 1, 2, 3]]
    assert absorbing_niches(chain).size == 0
    np.testing.assert_allclose(stationary_distribution(chain) @ chain.T, stationary_distribution(chain))


@given(transitions())
@settings(max_examples=60, deadline=None)
def test_periods_equal_quantecon(transition):
    quantecon = pytest.importorskip("quantecon")
    chain = NicheChain(transition)
    classes = recurrent_classes(chain)
    theirs = [quantecon.MarkovChain(transition[np.ix_(states, states)]).period for states in classes]
    assert period(chain).tolist() == theirs


def test_periods_by_hand():
    both = sparse.block_diag([np.roll(np.eye(6), 1, axis=1), np.full((2, 2), 0.5), [[1.0]]])
    assert period(NicheChain(both)).tolist() == [6, 1, 1]
    # Cycles of 4 and of 6 generations have 2 in common.
    cycles = np.zeros((8, 8))
    for i, j in [(0, 1), (1, 2), (2, 3), (3, 0), (2, 4), (4, 5), (5, 6), (6, 0), (7, 0)]:
        cycles[i, j] = 1.0
    cycles /= cycles.sum(axis=1, keepdims=True)
    assert period(NicheChain(cycles)).tolist() == [2]
    # With 7 in place of 6, nothing.
    cycles[6] = np.eye(8)[7]
    assert period(NicheChain(cycles)).tolist() == [1]
