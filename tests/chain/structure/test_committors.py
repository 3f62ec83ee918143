"""Committors and flux: deeptime, a simulation-free law, a ladder in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nichechain import NicheChain, NichechainError
from nichechain.chain.structure.committors import committor, reactive_flux
from nichechain.chain.structure.passage import hitting_probabilities

from .samples import MIXED, ladder, transitions


@given(st.integers(0, 10_000), st.integers(3, 9))
@settings(max_examples=30, deadline=None)
def test_equals_deeptime(seed, size):
    msm = pytest.importorskip("deeptime.markov.msm")
    transition = np.random.default_rng(seed).dirichlet(np.full(size, 0.7), size)
    source, target = [0], [size - 2, size - 1]
    theirs = msm.MarkovStateModel(transition).reactive_flux(source, target)
    found = reactive_flux(NicheChain(transition), source, target)
    np.testing.assert_allclose(found.forward, theirs.forward_committor, atol=1e-10)
    np.testing.assert_allclose(found.backward, theirs.backward_committor, atol=1e-8)
    np.testing.assert_allclose(found.stationary, theirs.stationary_distribution, atol=1e-10)
    np.testing.assert_allclose(found.gross.toarray(), theirs.gross_flux, atol=1e-10)
    np.testing.assert_allclose(found.net.toarray(), theirs.net_flux, atol=1e-10)
    assert found.total == pytest.approx(theirs.total_flux, rel=1e-8)
    assert found.rate == pytest.approx(theirs.rate, rel=1e-8)


@pytest.mark.parametrize("top", [20, 400, 5000])
def test_the_ruin_of_a_ladder(top):
    # Feller I, chapter XIV: 1 in 9^20 get up before they are down. Entries down to 1e-300 are right.
    up = 0.1 if top == 20 else 0.49
    odds = (1 - up) / up
    found = committor(NicheChain(ladder(top, up)), 0, top)
    level = np.arange(top + 1)
    expected = np.expm1(level * np.log(odds)) / np.expm1(top * np.log(odds))
    np.testing.assert_allclose(found, expected, rtol=1e-10)


@given(transitions(), st.data())
@settings(max_examples=60, deadline=None)
def test_is_hitting_where_the_source_is_a_trap(transition, data):
    size = len(transition)
    if size < 2:
        return
    source, target = data.draw(st.permutations(range(size)))[:2]
    trapped = transition.copy()
    trapped[source] = np.eye(size)[source]
    np.testing.assert_allclose(
        committor(NicheChain(transition), source, target),
        hitting_probabilities(NicheChain(trapped), target),
        atol=1e-12,
    )


def test_flux_is_kept_between_source_and_target():
    rng = np.random.default_rng(3)
    transition = rng.dirichlet(np.full(12, 0.5), 12)
    found = reactive_flux(NicheChain(transition), [0, 3], [7])
    flux = found.gross.toarray()
    between = np.setdiff1d(np.arange(12), [0, 3, 7])
    np.testing.assert_allclose(flux.sum(axis=0)[between], flux.sum(axis=1)[between], atol=1e-15)
    assert flux[:, [0, 3]].sum() == 0.0
    assert flux[:, 7].sum() == pytest.approx(found.total)
    assert (np.minimum(found.net.toarray(), found.net.toarray().T) == 0.0).all()


def test_states_that_are_left_for_good():
    # 0 is left for good into 1 ⇄ 2 ⇄ 3; nobody is found there, so nothing is known of where it came from.
    chain = NicheChain([[0, 1, 0, 0], [0, 0.5, 0.5, 0], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5]])
    found = reactive_flux(chain, 1, 3)
    assert np.isnan(found.backward[0])
    np.testing.assert_allclose(found.backward[1:], [1.0, 0.5, 0.0])
    np.testing.assert_allclose(found.forward, [0.0, 0.0, 0.5, 1.0])
    # A third in 1, half of it to 2, half of those on to 3.
    assert found.total == pytest.approx(1 / 12)
    assert found.rate == pytest.approx(1 / 12 / (1 / 3 + 1 / 6))
    with pytest.raises(NichechainError, match="the target has only niches that lineages leave for good"):
        reactive_flux(chain, 1, 0)


def test_sets_that_cannot_be():
    with pytest.raises(NichechainError, match="niche 2 is in the source and in the target"):
        committor(NicheChain(MIXED), [0, 2], [2, 3])
    with pytest.raises(NichechainError, match="2 recurrent classes, but a flux"):
        reactive_flux(NicheChain(MIXED), 0, 2)
