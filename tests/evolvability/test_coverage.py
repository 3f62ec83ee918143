"""Expected coverage: against enumeration of all paths, closed forms and laws; its simulation; rarefaction."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from nichechain import NichechainError
from nichechain.evolvability import coverage
from nichechain.evolvability.coverage import (
    expected_coverage,
    rarefied_coverage,
    sampled_coverage,
    visit_probabilities,
)

from ..choices import mean_distinct


@st.composite
def chains(draw, largest=6):
    """Row-stochastic matrices with many zeros, rows of one entry among them."""
    n = draw(st.integers(1, largest))
    row = st.lists(st.integers(0, 4), min_size=n, max_size=n).filter(any)
    weights = np.array(draw(st.lists(row, min_size=n, max_size=n)), float)
    return weights / weights.sum(axis=1, keepdims=True)


def _random_chain(rng, n):
    weights = rng.gamma(0.7, size=(n, n)) * (rng.random((n, n)) < 0.7)
    weights[np.arange(n), rng.integers(n, size=n)] += 0.1
    return weights / weights.sum(axis=1, keepdims=True)


def _visited_sets(transition, first, generations):
    """P(the set of states that one lineage visits), by walking along every path there is."""
    found = Counter()
    states = range(len(first))
    for path in itertools.product(states, repeat=generations):
        probability = first[path[0]]
        for i, j in itertools.pairwise(path):
            probability *= transition[i, j]
        if probability:
            found[frozenset(path)] += probability
    return found


def _by_enumeration(transition, first, generations, lineages, counted):
    """Expected size of the union over independent lineages, one tuple of visited sets at a time."""
    sets = _visited_sets(transition, first, generations)
    niches = frozenset(range(counted))
    total = 0.0
    for chosen in itertools.product(sets, repeat=lineages):
        probability = math.prod(sets[visited] for visited in chosen)
        total += probability * len(frozenset().union(*chosen) & niches)
    return total


@pytest.mark.parametrize("outside", [0, 1])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_equals_enumeration_of_all_paths(n, outside):
    rng = np.random.default_rng(10 * n + outside)
    transition = _random_chain(rng, n + outside)
    first = rng.dirichlet(np.ones(n + outside))
    for generations, lineages in itertools.product((1, 2, 3), (1, 2, 3)):
        value = expected_coverage(transition, first[None], generations, lineages, counted=n)
        expected = _by_enumeration(transition, first, generations, lineages, n)
        np.testing.assert_allclose(value, [expected], rtol=1e-12)


def test_visit_probabilities_equal_enumeration():
    rng = np.random.default_rng(3)
    transition = _random_chain(rng, 4)
    expected = [
        [sum(p for visited, p in _visited_sets(transition, row, 4).items() if j in visited) for j in range(4)]
        for row in transition
    ]
    blocks = list(visit_probabilities(transition, transition, 4, columns=3))
    assert [targets.tolist() for targets, _ in blocks] == [[0, 1, 2], [3]]
    np.testing.assert_allclose(np.hstack([visited for _, visited in blocks]), expected, rtol=1e-12)


@pytest.mark.parametrize("n", [2, 7])
def test_a_cycle_is_walked_one_niche_a_generation(n):
    transition = np.roll(np.eye(n), 1, axis=1)
    for generations in range(1, 2 * n):
        value = expected_coverage(transition, transition, generations, 5)
        np.testing.assert_array_equal(value, np.full(n, min(generations, n)))


def test_gamblers_ruin():
    # From i of N, a fair gambler reaches all with probability i/N and ruin with 1 − i/N; a lineage
    # long enough has reached the one or the other.
    n = 6
    transition = np.zeros((n + 1, n + 1))
    transition[0, 0] = transition[n, n] = 1.0
    for i in range(1, n):
        transition[i, i - 1] = transition[i, i + 1] = 0.5
    blocks = visit_probabilities(transition, np.eye(n + 1), 2000)
    hit = np.hstack([visited for _, visited in blocks])
    np.testing.assert_allclose(hit[:, n], np.arange(n + 1) / n, atol=1e-12)
    np.testing.assert_allclose(hit[:, 0], 1 - np.arange(n + 1) / n, atol=1e-12)


def test_uniform_chain_is_the_coupon_collector():
    n, generations, lineages = 30, 4, 25
    transition = np.full((n, n), 1 / n)
    # l·U independent uniform draws.
    expected = n * (1 - (1 - 1 / n) ** (generations * lineages))
    value = expected_coverage(transition, transition, generations, lineages)
    np.testing.assert_allclose(value, expected, rtol=1e-12)


@pytest.mark.parametrize("lineages", [1, 1000, 10**6])
def test_tiny_probabilities_keep_their_digits(lineages):
    h = 2.0**-60
    transition = np.array([[1.0, 0.0], [h, 1.0]])
    exact = float(1 - (1 - Fraction(1, 2**60)) ** lineages) if lineages <= 1000 else lineages * h
    value = expected_coverage(transition, transition[[1]], 1, lineages, counted=1)
    np.testing.assert_allclose(value, [exact], rtol=1e-10)


@given(chains(), st.integers(1, 5), st.integers(1, 40))
@settings(deadline=None, max_examples=60)
def test_grows_with_generations_and_lineages_within_bounds(transition, generations, lineages):
    value = expected_coverage(transition, transition, generations, lineages)
    assert (expected_coverage(transition, transition, generations + 1, lineages) >= value - 1e-12).all()
    assert (expected_coverage(transition, transition, generations, lineages + 1) >= value - 1e-12).all()
    assert (value >= 1 - 1e-12).all()
    reachable = (transition > 0).astype(int)
    for _ in range(generations - 1):
        reachable = ((reachable + reachable @ (transition > 0)) > 0).astype(int)
    assert (value <= reachable.sum(axis=1) + 1e-12).all()
    assert (value <= min(len(transition), generations * lineages) + 1e-12).all()


@given(chains(), st.integers(1, 50))
@settings(deadline=None, max_examples=60)
def test_one_generation_is_the_coverage_of_children(transition, lineages):
    value = expected_coverage(transition, transition, 1, lineages)
    np.testing.assert_allclose(value, (1 - (1 - transition) ** lineages).sum(axis=1), rtol=1e-12)


@given(chains(), st.integers(1, 5), st.integers(1, 40), st.randoms(use_true_random=False))
@settings(deadline=None, max_examples=60)
def test_the_names_of_niches_do_not_matter(transition, generations, lineages, random):
    order = list(range(len(transition)))
    random.shuffle(order)
    renamed = transition[np.ix_(order, order)]
    np.testing.assert_allclose(
        expected_coverage(renamed, renamed, generations, lineages),
        expected_coverage(transition, transition, generations, lineages)[order],
        rtol=1e-12,
    )


@given(chains(), st.integers(1, 5), st.integers(1, 40), st.integers(1, 7))
@settings(deadline=None, max_examples=60)
def test_sparse_or_dense_in_blocks_of_any_width(transition, generations, lineages, columns):
    expected = expected_coverage(transition, transition, generations, lineages)
    as_sparse = sparse.csr_array(transition)
    for matrix, first in itertools.product((transition, as_sparse), repeat=2):
        value = expected_coverage(matrix, first, generations, lineages, columns=columns)
        np.testing.assert_allclose(value, expected, rtol=1e-12)


@given(chains(), st.integers(1, 5), st.lists(st.integers(1, 40), min_size=1, max_size=4))
@settings(deadline=None, max_examples=30)
def test_several_numbers_of_lineages_at_once(transition, generations, lineages):
    together = expected_coverage(transition, transition, generations, lineages)
    assert together.shape == (len(transition), len(lineages))
    for k, size in enumerate(lineages):
        np.testing.assert_allclose(
            together[:, k], expected_coverage(transition, transition, generations, size), rtol=1e-14
        )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("counted", [None, 5])
def test_simulation_agrees_with_the_closed_form(seed, counted):
    rng = np.random.default_rng(seed)
    transition = _random_chain(rng, 6)
    first = rng.dirichlet(np.ones(6))
    for generations, lineages in ((1, 4), (3, 1), (4, 3)):
        found = sampled_coverage(transition, first, generations, lineages, 4000, rng, counted=counted)
        exact = expected_coverage(transition, first[None], generations, lineages, counted=counted)[0]
        assert abs(found.mean() - exact) <= 4 * found.std(ddof=1) / math.sqrt(found.size)


def test_simulated_numbers_have_the_enumerated_distribution():
    # Two lineages of two generations: the whole distribution, which the mean does not fix.
    rng = np.random.default_rng(8)
    transition = _random_chain(rng, 4)
    sets = _visited_sets(transition, transition[0], 2)
    expected = Counter()
    for one, other in itertools.product(sets, repeat=2):
        expected[len(one | other)] += sets[one] * sets[other]
    repeats = 20_000
    found = Counter(sampled_coverage(transition, transition[0], 2, 2, repeats, rng).tolist())
    assert set(found) == {size for size, p in expected.items() if p > 0}
    for size, p in expected.items():
        assert abs(found[size] / repeats - p) <= 4 * math.sqrt(p * (1 - p) / repeats)


def test_simulation_never_takes_an_impossible_step():
    # Zeros kept in the sparse matrix, at the start, the middle and the end of rows.
    transition = sparse.csr_array(
        (
            np.array([0.0, 1.0, 0.0, 0.5, 0.0, 0.5, 1.0, 0.0]),
            np.array([0, 1, 2, 0, 1, 2, 0, 2]),
            np.array([0, 3, 6, 8]),
        ),
        shape=(3, 3),
    )
    rng = np.random.default_rng(0)
    assert set(sampled_coverage(transition, np.array([1.0, 0, 0]), 2, 1, 500, rng)) == {2}
    assert set(sampled_coverage(transition, np.array([1.0, 0, 0]), 2, 50, 500, rng, counted=1)) == {1}
    assert set(sampled_coverage(transition, np.array([0, 0, 1.0]), 1, 50, 500, rng, counted=2)) == {0}


def test_simulation_stays_in_its_row_for_the_largest_random_number():
    # Added to the number of a row, 1 − 2⁻⁵³ rounds to the number of the next.
    largest = SimpleNamespace(random=lambda size: np.full(size, 1 - 2.0**-53))
    transition = np.roll(np.eye(6), 1, axis=1)
    for start in np.eye(6):
        assert sampled_coverage(transition, start, 6, 1, 1, largest).tolist() == [6]


def test_simulation_in_pieces_of_bounded_memory(monkeypatch):
    monkeypatch.setattr(coverage, "_CELLS", 70)
    rng = np.random.default_rng(2)
    transition = _random_chain(rng, 5)
    found = sampled_coverage(transition, transition[0], 3, 4, 3001, rng)
    exact = expected_coverage(transition, transition[[0]], 3, 4)[0]
    assert found.shape == (3001,)
    assert abs(found.mean() - exact) <= 4 * found.std(ddof=1) / math.sqrt(found.size)


def test_simulation_is_a_function_of_its_generator():
    transition = _random_chain(np.random.default_rng(1), 5)
    runs = [
        sampled_coverage(transition, transition[0], 3, 2, 50, np.random.default_rng(seed))
        for seed in (4, 4, 5)
    ]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


@given(st.lists(st.integers(0, 4), min_size=1, max_size=5).filter(lambda c: 1 <= sum(c) <= 10), st.data())
@settings(deadline=None, max_examples=60)
def test_rarefaction_is_the_mean_over_all_subsets(counts, data):
    size = data.draw(st.integers(1, sum(counts)))
    counted = data.draw(st.integers(1, len(counts)))
    offspring = [niche for niche, count in enumerate(counts) for _ in range(count)]
    expected = mean_distinct(offspring, size, nowhere=range(counted, len(counts)))
    assert rarefied_coverage(counts, size, counted=counted) == pytest.approx(expected, rel=1e-10, abs=1e-12)


@given(st.lists(st.integers(0, 1000), min_size=1, max_size=50).filter(any))
def test_rarefaction_to_all_offspring_is_the_observed_number_exactly(counts):
    assert rarefied_coverage(counts, sum(counts)) == np.count_nonzero(counts)
    inside = np.count_nonzero(counts[:-1])
    assert rarefied_coverage(counts, sum(counts), counted=len(counts) - 1) == inside


def test_rarefaction_does_not_count_the_outside_but_draws_from_it():
    # Of 4 offspring 2 are outside: one drawn is inside with probability 1/2.
    assert rarefied_coverage([1, 1, 2], 1, counted=2) == pytest.approx(0.5, rel=1e-12)
    assert rarefied_coverage([0, 0, 5], 3, counted=2) == 0.0


@pytest.mark.parametrize("size", [0, -1, 6])
def test_rarefaction_refuses(size):
    with pytest.raises(NichechainError, match=f"size is {size}, but must be between 1 and the 5"):
        rarefied_coverage([2, 3, 0], size)


@pytest.mark.parametrize(
    ("generations", "lineages", "message"),
    [(0, 1, "steps is 0"), (-3, 1, "steps is -3"), (1, 0, "lineages is 0"), (1, [5, 0], "lineages is 0")],
)
def test_lengths_are_refused(generations, lineages, message):
    with pytest.raises(NichechainError, match=message):
        expected_coverage(np.eye(2), np.eye(2), generations, lineages)


@pytest.mark.parametrize(
    ("generations", "lineages", "repeats", "message"),
    [(0, 1, 1, "steps is 0"), (1, 0, 1, "lineages is 0"), (1, 1, 0, "repeats is 0")],
)
def test_simulation_refuses(generations, lineages, repeats, message):
    with pytest.raises(NichechainError, match=message):
        sampled_coverage(np.eye(2), np.eye(2)[0], generations, lineages, repeats, np.random.default_rng(0))


def test_a_billion_generations_end_when_nothing_changes_any_more():
    # From 0, one step in four leads to 1, and one in four to 2: each is hit first half of the time.
    T = np.array([[0.5, 0.25, 0.25], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    found = expected_coverage(T, T[[0]], 10**9, [1, 10])
    stays = 0.5  # P(a child stays in 0)
    assert found[0, 0] == pytest.approx(1.0 + stays, rel=1e-13)
    np.testing.assert_allclose(found[0, 1], (1 - stays**10) + 2 * (1 - 0.5**10), rtol=1e-13)
