"""Metastable sets: chains whose groups are known, and laws that any answer keeps."""

from __future__ import annotations

import os
import sys
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nichechain as nc
from nichechain.chain.structure.metastable import metastable_sets
from nichechain.chain.structure.passage import hitting_probabilities
from nichechain.core.errors import NichechainError

from .samples import MIXED, transitions

pytest.importorskip("pygpcca")
# Two pairs of niches; one lineage in a hundred leaves its pair.
PAIRS = nc.NicheChain(
    [[0.80, 0.19, 0.01, 0.00], [0.20, 0.79, 0.00, 0.01], [0.01, 0.00, 0.70, 0.29], [0.00, 0.01, 0.30, 0.69]]
)
# A cycle, and a niche that feeds it.
CYCLE = nc.NicheChain([[0, 1.0, 0, 0], [0, 0, 1.0, 0], [1.0, 0, 0, 0], [0.5, 0, 0, 0.5]])


def test_two_pairs():
    found = metastable_sets(PAIRS, 2)
    assert found.group.tolist() == [0, 0, 1, 1]
    np.testing.assert_allclose(found.membership.sum(axis=1), 1.0)
    # Both pairs lose exactly one in a hundred, whichever of their niches a lineage is in.
    np.testing.assert_allclose(found.transition, [[0.99, 0.01], [0.01, 0.99]], atol=1e-12)
    assert found.crispness == pytest.approx(1.0)


def test_two_pairs_that_swap():
    swap = [[0, 0.95, 0.05, 0], [0.95, 0, 0, 0.05], [0.05, 0, 0, 0.95], [0, 0.05, 0.95, 0]]
    found = metastable_sets(nc.NicheChain(swap), 2)
    assert found.group.tolist() == [0, 0, 1, 1]
    np.testing.assert_allclose(found.transition, [[0.95, 0.05], [0.05, 0.95]], atol=1e-12)


def test_recurrent_classes_come_first():
    apart = nc.NicheChain([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]])
    found = metastable_sets(apart, 3)
    assert found.group.tolist() == [0, 1, 2, 2]
    np.testing.assert_array_equal(found.transition, np.eye(3))
    with pytest.raises(NichechainError, match="groups is 2, but this chain has 3 recurrent classes"):
        metastable_sets(apart, 2)
    with pytest.raises(NichechainError, match="not so many sets that lineages stay in"):
        metastable_sets(apart, 4)


def test_transient_niches_share_in_the_classes_that_they_lead_to():
    chain = nc.NicheChain(MIXED)
    found = metastable_sets(chain, 2)
    ends = np.stack([hitting_probabilities(chain, 2), hitting_probabilities(chain, [3, 4])], axis=1)
    np.testing.assert_allclose(found.membership, ends, atol=1e-12)
    # The pair 0 ⇄ 1 is stayed in with its survival, (0.7 + √0.57) / 2.
    third = metastable_sets(chain, 3)
    assert third.group.tolist() == [0, 0, 1, 2, 2, 0]
    assert third.transition[0, 0] == pytest.approx((0.7 + np.sqrt(0.57)) / 2)
    np.testing.assert_array_equal(third.transition[1:], [[0, 1, 0], [0, 0, 1]])


def test_a_niche_that_feeds_a_cycle():
    found = metastable_sets(CYCLE, 2)
    assert found.group.tolist() == [0, 0, 0, 1]
    np.testing.assert_allclose(found.transition, [[1.0, 0.0], [0.5, 0.5]])
    with pytest.raises(NichechainError, match="split a pair of complex eigenvalues"):
        metastable_sets(CYCLE, 3)


@given(transitions(), st.integers(2, 7), st.floats(0.0, 5.0))
@settings(max_examples=60, deadline=None)
def test_laws(transition, groups, lazy):
    """An answer is a partition that is stayed in, or there is one sentence."""
    size = len(transition)
    lazier = (transition + lazy * np.eye(size)) / (1.0 + lazy)
    found, sentence = None, ""
    try:
        found = metastable_sets(nc.NicheChain(lazier), groups)
    except NichechainError as error:
        sentence = str(error)
    if found is None:
        assert sentence.startswith(("groups is", "a class of"))
        return
    assert np.unique(found.group).tolist() == list(range(groups))
    assert found.membership.min() >= 0.0
    np.testing.assert_allclose(found.membership.sum(axis=1), 1.0)
    assert found.transition.min() >= 0.0
    np.testing.assert_allclose(found.transition.sum(axis=1), 1.0)
    assert found.transition.diagonal().min() >= 0.5
    assert 0.0 < found.crispness <= 1.0 + 1e-12


def test_the_shipped_archive():
    archive = nc.load("fetch-pick-and-place")
    with pytest.raises(NichechainError, match=r"110 recurrent classes, 109 of them niches without births"):
        metastable_sets(archive.chain(estimator="mle", unvisited="self"), 3)
    with pytest.raises(NichechainError, match="not so many sets that lineages stay in"):
        metastable_sets(archive.chain(), 2)


def test_a_library_changes_nothing_and_says_nothing(capfd):
    for name in [name for name in sys.modules if name.startswith("pygpcca")]:
        del sys.modules[name]
    before, filters = os.environ.get("PYTHONWARNINGS"), list(warnings.filters)
    metastable_sets(PAIRS, 3)
    assert os.environ.get("PYTHONWARNINGS") == before
    assert warnings.filters == filters
    assert capfd.readouterr() == ("", "")


def test_not_installed_only_where_it_is_not(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("pygpcca")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pygpcca", None)
    with pytest.raises(NichechainError, match="pyGPCCA is not installed"):
        metastable_sets(PAIRS, 2)
    # Where classes are the groups, it is not needed.
    assert metastable_sets(CYCLE, 2).group.tolist() == [0, 0, 0, 1]


def test_a_broken_installation_is_not_taken_for_none(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("pygpcca")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    with pytest.raises(ImportError, match=r"scipy\.optimize"):
        metastable_sets(PAIRS, 2)


def test_a_given_chain_is_left_alone():
    before = np.array(PAIRS.T)
    metastable_sets(PAIRS, 3)
    np.testing.assert_array_equal(PAIRS.T, before)


@pytest.mark.parametrize("groups", [0, 1, 5, -2, 1.5, "two"])
def test_number_of_groups(groups):
    with pytest.raises(NichechainError, match="groups is"):
        metastable_sets(PAIRS, groups)
