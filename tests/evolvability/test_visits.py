"""Metrics on visited niches: against SciPy, closed forms, and l-evolvability of the same walks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.distance import jensenshannon
from scipy.stats import entropy

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate, l_evolvability
from nichechain.evolvability.visits import uniformity, visit_entropy, visit_metrics

LINE = GridNiches((4,), ((0.0, 8.0),), "clip")


@given(st.lists(st.integers(0, 50), min_size=1, max_size=12).filter(any))
def test_uniformity_and_entropy_equal_scipy(visits):
    visits = np.array(visits, float)
    even = np.full(visits.size, 1.0 / visits.size)
    # SciPy takes the root of a divergence that may be a rounding error of either sign.
    expected = 1.0 - np.nan_to_num(jensenshannon(visits, even, base=2))
    assert uniformity(visits) == pytest.approx(expected, abs=1e-7)
    seen = visits[visits > 0]
    expected = 1.0 - np.nan_to_num(jensenshannon(seen, np.full(seen.size, 1 / seen.size), base=2))
    assert uniformity(visits, occupied=True) == pytest.approx(expected, abs=1e-7)
    assert visit_entropy(visits) == pytest.approx(entropy(visits, base=2), abs=1e-12)


def test_uniformity_by_hand():
    assert uniformity([3, 3, 3]) == pytest.approx(1.0)
    assert uniformity([5, 0, 5, 0], occupied=True) == pytest.approx(1.0)
    # All in one of two niches: mean distribution (3/4, 1/4) of 0.811 bits, less half a bit.
    divergence = 2 - 0.75 * math.log2(3) - 0.5
    assert uniformity([7, 0]) == pytest.approx(1.0 - math.sqrt(divergence))
    assert visit_entropy([[1, 1], [4, 0]]).tolist() == [1.0, 0.0]
    assert np.isnan(uniformity([0, 0]))
    assert np.isnan(uniformity([0, 0], occupied=True))
    assert np.isnan(visit_entropy([0, 0]))


def _walk(up):
    """Up with a probability, else stay; the top absorbs."""
    return np.diag([1 - up] * 3 + [1.0]) + np.diag([up] * 3, 1)


def test_a_certain_walk():
    found = visit_metrics(NicheChain(_walk(1.0), niches=LINE), niche=0, l=2, lineages=3, repeats=4)
    # 0 → 1 → 2 every time, cells of width 2; three visits each to two of four niches.
    assert found.coverage == (2.0, 0.0)
    assert found.distance == (4.0, 0.0)
    assert found.entropy == (1.0, 0.0)
    assert found.uniformity_occupied == (1.0, 0.0)
    assert found.uniformity.value == pytest.approx(1.0 - jensenshannon([0, 1, 1, 0], [1] * 4, base=2))
    assert (found.inside, found.repeats) == (1.0, 4)
    literal = visit_metrics(
        NicheChain(_walk(1.0), niches=LINE), niche=0, l=2, lineages=3, repeats=4, convention="procedure"
    )
    assert literal.coverage == (3.0, 0.0)
    assert literal.distance == (4.0, 0.0)


def test_from_a_distribution_the_way_begins_with_generation_1():
    chain = NicheChain(_walk(1.0), niches=LINE)
    found = visit_metrics(chain, offspring=[0, 1, 0, 0], l=2, lineages=1, repeats=2)
    assert found.coverage == (2.0, 0.0)
    assert found.distance == (2.0, 0.0)


@pytest.mark.parametrize("convention", ["definition", "procedure"])
def test_means_within_four_standard_errors(convention):
    chain = NicheChain(_walk(0.3), niches=LINE)
    found = visit_metrics(chain, niche=0, l=3, lineages=8, repeats=4000, seed=1, convention=convention)
    exact = l_evolvability(chain, niche=0, l=3, lineages=8, convention=convention).value
    assert abs(found.coverage.value - exact) < 4 * found.coverage.standard_error
    # Three steps of 0.3 each, none past the top in three: 2 · 0.9.
    assert abs(found.distance.value - 1.8) < 4 * found.distance.standard_error
    assert 0 < found.distance.standard_error < 0.02


def test_coverage_is_that_of_the_same_walks():
    niches = GridNiches((3, 3), ((0.0, 3.0), (0.0, 3.0)))
    rng = np.random.default_rng(0)
    chain = estimate(
        TransitionCounts.from_pairs(rng.integers(10, size=80), rng.integers(10, size=80), niches)
    )
    options = {"l": 4, "lineages": 12, "repeats": 50, "draws": 5, "seed": 3}
    for root in ({"niche": 4}, {"offspring": np.full(9, 1 / 9)}):
        found = visit_metrics(chain, **root, **options)
        scored = l_evolvability(chain, method="monte-carlo", **root, **options)
        assert found.coverage.value == pytest.approx(scored.value)
        assert found.coverage.standard_error == pytest.approx(scored.standard_error)
        assert found.repeats == 50


def test_walks_that_end_outside():
    niches = GridNiches((2,), ((0.0, 2.0),))
    gone = NicheChain([[0, 0, 1.0], [0, 0, 1.0], [0, 0, 1.0]], niches=niches, outside=2)
    found = visit_metrics(gone, niche=0, l=3, lineages=2, repeats=3)
    assert found.coverage == (0.0, 0.0)
    assert found.distance == (0.0, 0.0)
    assert found.inside == 0.0
    assert np.isnan([found.uniformity.value, found.uniformity_occupied.value, found.entropy.value]).all()


def test_without_centres_there_is_no_distance():
    found = visit_metrics(NicheChain(_walk(0.5)), niche=0, repeats=3)
    assert math.isnan(found.distance.value)
    assert found.coverage.value > 0


def test_one_repeat_has_no_standard_error():
    found = visit_metrics(NicheChain(_walk(0.5), niches=LINE), niche=0, repeats=1)
    assert math.isnan(found.coverage.standard_error)
    assert not math.isnan(found.coverage.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"niche": 0, "repeats": 0}, "repeats is 0"),
        ({"niche": 0, "l": 0}, "l is 0"),
        ({"niche": 0, "lineages": -1}, "lineages is -1"),
        ({"niche": 0, "draws": 0}, "draws is 0"),
        ({"niche": 0, "convention": "x"}, "convention is 'x'"),
        ({}, "either a niche or"),
        ({"niche": 9}, "niche is 9"),
    ],
)
def test_bad_input(options, message):
    with pytest.raises(NichechainError, match=message):
        visit_metrics(NicheChain(_walk(0.5)), **options)
