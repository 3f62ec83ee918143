"""Reach: against enumeration of all paths, against l-evolvability, and simulation."""

from __future__ import annotations

import importlib
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate, l_evolvability
from nichechain.evolvability.reach import reach, visit_probability
from nichechain.evolvability.returns import return_probabilities

reach_module = importlib.import_module("nichechain.evolvability.reach")

GOLDEN = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]])


@st.composite
def transitions(draw, largest=6):
    n = draw(st.integers(1, largest))
    row = st.lists(st.integers(0, 3), min_size=n, max_size=n).filter(any)
    weights = np.array(draw(st.lists(row, min_size=n, max_size=n)), float)
    return weights / weights.sum(axis=1, keepdims=True)


def _by_enumeration(transition, first, steps):
    """Visit probabilities and expected visits, by walking along every path there is."""
    size = len(first)
    visit, passes = np.zeros(size), np.zeros(size)
    for path in itertools.product(range(size), repeat=steps):
        probability = first[path[0]]
        for i, j in itertools.pairwise(path):
            probability *= transition[i, j]
        visit[list(set(path))] += probability
        np.add.at(passes, list(path), probability)
    return visit, passes


@pytest.mark.parametrize("dense", [0.0, 1.0], ids=["recursion", "renewal"])
@pytest.mark.parametrize("form", [np.array, sparse.csr_array])
@given(transition=transitions(4), steps=st.integers(1, 5), data=st.data())
@settings(max_examples=20, deadline=None)
def test_visit_probability_equals_enumeration(form, dense, transition, steps, data):
    weights = data.draw(
        st.lists(st.integers(0, 3), min_size=len(transition), max_size=len(transition)).filter(any)
    )
    first = np.array(weights) / sum(weights)
    with pytest.MonkeyPatch.context() as patch:
        # Small matrices are never sparse by the usual measure.
        patch.setattr(reach_module, "_DENSE", dense)
        visit, passes = visit_probability(form(transition), first, steps)
    expected_visit, expected_passes = _by_enumeration(transition, first, steps)
    np.testing.assert_allclose(visit, expected_visit, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(passes, expected_passes, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("form", [np.array, sparse.csr_array])
def test_long_walks_are_followed_until_nothing_changes(form):
    # A half of the walk moves on from 0 to 1 at each step, and nothing comes back from 2.
    transition = np.array([[0.5, 0.5, 0.0], [0.0, 0.8, 0.2], [0.0, 0.0, 1.0]])
    first = np.array([1.0, 0.0, 0.0])
    short, long = (visit_probability(form(transition), first, steps) for steps in (1000, 1001))
    np.testing.assert_allclose(long[0], short[0], rtol=1e-12)
    np.testing.assert_allclose(long[1], short[1] + [0, 0, 1], rtol=1e-12)
    visit, passes = visit_probability(form(transition), first, 10**18)
    np.testing.assert_allclose(visit, 1.0)
    np.testing.assert_allclose(passes, [2.0, 5.0, 1e18], rtol=1e-12)


@given(transition=transitions(), longest=st.integers(1, 12))
@settings(max_examples=40, deadline=None)
def test_returns_are_diagonals_of_powers(transition, longest):
    states = np.arange(len(transition))
    wanted = 1 + (states + longest) % longest
    found = return_probabilities(sparse.csr_array(transition), states, wanted)
    assert found.shape == (wanted.max(), states.size)
    for k in range(wanted.max()):
        expected = np.diag(np.linalg.matrix_power(transition, k + 1)) * (wanted > k)
        np.testing.assert_allclose(found[k], expected, rtol=1e-12, atol=1e-15)


def test_returns_of_tiny_probabilities():
    # Products that underflow to nothing must not be counted, nor counted twice.
    tiny = 1e-200
    transition = sparse.csr_array([[1 - 2 * tiny, tiny, tiny], [tiny, 1 - tiny, 0], [tiny, 0, 1 - tiny]])
    found = return_probabilities(transition, np.arange(3), np.full(3, 6))
    np.testing.assert_allclose(found, np.ones((6, 3)), rtol=1e-12)


@pytest.mark.parametrize(
    ("convention", "l", "lineages", "value"),
    [
        ("definition", 1, 1, 1.0),
        ("definition", 1, 10, 1.998046875),
        ("definition", 2, 2, 2.125),
        ("definition", 2, 10, 2.942708969),
        ("procedure", 1, 2, 1.75),
        ("procedure", 2, 10, 2.943685532),
    ],
)
def test_goldens(convention, l, lineages, value):
    found = reach(NicheChain(GOLDEN), niche=0, l=l, lineages=lineages, convention=convention)
    assert found.evolvability == pytest.approx(value, abs=1e-9)


def test_by_hand():
    found = reach(NicheChain(GOLDEN), niche=0, l=2, lineages=2)
    # Paths of two generations from 0: 00, 01, 11, 12, a quarter each.
    np.testing.assert_allclose(found.visit, [0.5, 0.75, 0.25])
    np.testing.assert_allclose(found.at_least_one, [0.75, 15 / 16, 7 / 16])
    np.testing.assert_allclose(found.expected_visits, [1.5, 2.0, 0.5])
    assert np.isnan([found.low, found.high]).all()
    assert found.births is None
    frame = found.to_frame(NicheChain(GOLDEN))
    assert frame["niche"].tolist() == [1, 0, 2]
    assert frame["index"].tolist() == ["1", "0", "2"]


@given(transitions(), st.integers(1, 7), st.integers(1, 50), st.sampled_from(["definition", "procedure"]))
@settings(max_examples=60, deadline=None)
def test_sums_to_l_evolvability(transition, l, lineages, convention):
    outside = len(transition) - 1 if len(transition) > 1 else None
    chain = NicheChain(transition, outside=outside)
    options = {"l": l, "lineages": lineages, "convention": convention}
    even = np.full(chain.n_niches, 1.0 / chain.n_niches)
    for root in ({"niche": 0}, {"offspring": even}):
        found = reach(chain, **root, **options)
        assert found.evolvability == pytest.approx(l_evolvability(chain, **root, **options).value, rel=1e-12)
        assert found.visit.shape == (chain.n_niches,)
        assert (found.at_least_one >= found.visit - 1e-15).all()
        assert (found.expected_visits >= lineages * found.visit * (1 - 1e-12)).all()


def _estimated(outside="state"):
    niches = GridNiches((4, 3), ((0.0, 4.0), (0.0, 3.0)), outside)
    rng = np.random.default_rng(2)
    parent = rng.integers(0, 8, 300)
    child = np.minimum(parent + rng.integers(-2, 4, 300) % 13, niches.states - 1)
    return estimate(TransitionCounts.from_pairs(parent, child, niches))


@pytest.mark.parametrize("outside", ["state", "absorb", "clip"])
@pytest.mark.parametrize("convention", ["definition", "procedure"])
def test_sums_to_l_evolvability_of_the_same_draws(outside, convention, monkeypatch):
    monkeypatch.setattr(reach_module, "_DENSE", 1.0)
    chain = _estimated(outside)
    options = {"l": 4, "lineages": 30, "convention": convention, "draws": 7, "seed": 5}
    for root in ({"niche": (1, 2)}, {"offspring": np.full(12, 1 / 12)}):
        found, scored = reach(chain, **root, **options), l_evolvability(chain, **root, **options)
        assert found.evolvability == pytest.approx(scored.value, rel=1e-12)
        assert found.births == scored.births
        assert found.estimator == scored.estimator
        assert (found.low <= found.high).all()
        assert (found.low < found.high).any()
        # Each visit of the 30 · 4 descendants is somewhere, outside included.
        generations = 5 if convention == "procedure" else 4
        assert found.expected_visits.sum() <= 30 * generations * (1 + 1e-12)


def test_many_states_equal_the_recursion_over_all():
    rng = np.random.default_rng(8)
    size = 500
    i = np.repeat(np.arange(size), 6)
    weight = sparse.csr_array((rng.random(i.size), (i, rng.integers(size, size=i.size))), shape=(size, size))
    chain = NicheChain(sparse.csr_array(sparse.diags_array(1 / weight.sum(axis=1)) @ weight))
    for l in (1, 2, 3, 6, 11):
        value = l_evolvability(chain, niche=9, l=l).value
        assert reach(chain, niche=9, l=l).evolvability == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "either a niche or"),
        ({"niche": 0, "offspring": [1, 0, 0]}, "either a niche or"),
        ({"niche": 3}, "niche is 3"),
        ({"offspring": [1.0]}, r"offspring has shape \(1,\)"),
        ({"offspring": [0.5, 0.5, 0.5]}, "offspring sums to 1.5"),
        ({"offspring": [1.5, -0.5, 0.0]}, "not negative"),
        ({"offspring": [np.nan, 0.5, 0.5]}, "offspring sums to nan"),
        ({"niche": 0, "l": 0}, "l is 0"),
        ({"niche": 0, "lineages": 0}, "lineages is 0"),
        ({"niche": 0, "draws": 0}, "draws is 0"),
        ({"niche": 0, "convention": "literal"}, "convention is 'literal'"),
    ],
)
def test_bad_input(options, message):
    with pytest.raises(NichechainError, match=message):
        reach(NicheChain(GOLDEN), **options)
