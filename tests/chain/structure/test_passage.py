"""Hitting and first passage: closed forms, exact arithmetic, deeptime, simulation-free laws."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate
from nichechain.chain.structure import transitions as rows_
from nichechain.chain.structure.passage import hitting_probabilities, mean_first_passage_times

from .samples import exact_solution, exact_system, graded, ladder, transitions


def _gambler(size, up):
    """Fortune 0 … size − 1, up by one with probability ``up``, down else; both ends absorb."""
    i = np.arange(1, size - 1)
    data = np.concatenate([np.full(i.size, up), np.full(i.size, 1 - up), [1.0, 1.0]])
    where = np.concatenate([i, i, [0, size - 1]]), np.concatenate([i + 1, i - 1, [0, size - 1]])
    return NicheChain(sparse.csr_array((data, where), shape=(size, size)))


@pytest.mark.parametrize("size", [2, 3, 11, 400, 3000])
@pytest.mark.parametrize("up", [0.5, 0.49, 0.6])
def test_gamblers_ruin(size, up):
    chain = _gambler(size, up)
    i, top = np.arange(size, dtype=float), size - 1
    odds = (1 - up) / up
    # Feller I, chapter XIV: ruin and duration of play; in logarithms, as odds^top overflows.
    if up == 0.5:
        ruin, duration = 1.0 - i / top, i * (top - i)
    else:
        high = max(odds, 1.0)
        a, b = (odds / high) ** i * high ** (i - top), high ** (-float(top)) if high > 1 else 1.0
        ruin = ((odds / high) ** top - a) / ((odds / high) ** top - b)
        duration = i / (1 - 2 * up) - top / (1 - 2 * up) * (1.0 - ruin)
    found = hitting_probabilities(chain, 0)
    assert found[0] == 1.0
    assert found[-1] == 0.0
    np.testing.assert_allclose(found, ruin, atol=1e-7)
    np.testing.assert_allclose(hitting_probabilities(chain, size - 1), 1.0 - ruin, atol=1e-7)
    np.testing.assert_allclose(mean_first_passage_times(chain, [0, size - 1]), duration, rtol=1e-7, atol=1e-6)
    # Either end may catch a lineage for good, so the other one is not surely reached.
    one_end = mean_first_passage_times(chain, 0)
    assert one_end[0] == 0.0
    assert np.isinf(one_end[1:]).all()


@pytest.mark.parametrize("size", [3, 12, 1001, 5000])
def test_random_walk_on_a_cycle(size):
    i = np.arange(size)
    where = np.concatenate([i, i]), np.concatenate([(i + 1) % size, (i - 1) % size])
    chain = NicheChain(sparse.csr_array((np.full(2 * size, 0.5), where), shape=(size, size)))
    np.testing.assert_allclose(mean_first_passage_times(chain, 0), i * (size - i), rtol=1e-7)
    assert (hitting_probabilities(chain, 2) == 1.0).all()


def _long_way_round(rng, size):
    """Steps to a neighbour on a ring or to anywhere: no narrow band, so that iterations must do."""
    i = np.repeat(np.arange(size), 4)
    j = np.stack([(np.arange(size) + 1) % size, *rng.integers(size, size=(3, size))], axis=1).ravel()
    weight = sparse.csr_array((rng.random(i.size), (i, j)), shape=(size, size))
    return sparse.csr_array(sparse.diags_array(1.0 / weight.sum(axis=1)) @ weight)


def test_large_chains_equal_a_dense_solution():
    rng = np.random.default_rng(6)
    size, target = 1300, 17
    transition = _long_way_round(rng, size)
    rest = np.delete(np.arange(size), target)
    dense = np.eye(size - 1) - transition.toarray()[np.ix_(rest, rest)]
    found = mean_first_passage_times(NicheChain(transition), target)
    assert found[target] == 0.0
    np.testing.assert_allclose(found[rest], np.linalg.solve(dense, np.ones(size - 1)), rtol=1e-9)
    # Two traps share all lineages.
    trapped = transition.tolil()
    for trap in (5, 900):
        trapped[trap] = 0.0
        trapped[trap, trap] = 1.0
    chain = NicheChain(sparse.csr_array(trapped))
    first, second = hitting_probabilities(chain, 5), hitting_probabilities(chain, 900)
    np.testing.assert_allclose(first + second, 1.0, rtol=1e-9)
    free = np.setdiff1d(np.arange(size), [5, 900])
    inner = trapped.toarray()[np.ix_(free, free)]
    expected = np.linalg.solve(np.eye(free.size) - inner, trapped.toarray()[free, 5])
    np.testing.assert_allclose(first[free], expected, rtol=1e-8)


@given(st.integers(0, 10_000), st.integers(2, 9))
@settings(max_examples=30, deadline=None)
def test_equals_deeptime(seed, size):
    analysis = pytest.importorskip("deeptime.markov.tools.analysis")
    transition = np.random.default_rng(seed).dirichlet(np.full(size, 0.7), size)
    chain = NicheChain(transition)
    np.testing.assert_allclose(mean_first_passage_times(chain, 0), analysis.mfpt(transition, 0), rtol=1e-8)
    several = [0, size - 1]
    np.testing.assert_allclose(
        mean_first_passage_times(chain, several), analysis.mfpt(transition, several), rtol=1e-8
    )


@given(transitions(), st.data())
@settings(max_examples=80, deadline=None)
def test_laws_of_passage(transition, data):
    size = len(transition)
    target = data.draw(st.sets(st.integers(0, size - 1), min_size=1))
    chain = NicheChain(transition)
    inside = np.isin(np.arange(size), list(target))
    hit = hitting_probabilities(chain, sorted(target))
    # Many steps of the recursion for "within k generations" close in on it from below.
    within = inside.astype(float)
    for _ in range(3000):
        within = np.where(inside, 1.0, transition @ within)
    np.testing.assert_allclose(hit, within, atol=1e-6)
    time = mean_first_passage_times(chain, sorted(target))
    assert (time[inside] == 0.0).all()
    np.testing.assert_array_equal(np.isinf(time), hit < 1.0)
    finite = np.isfinite(time) & ~inside
    onward = transition[finite][:, np.isfinite(time)] @ time[np.isfinite(time)]
    np.testing.assert_allclose(time[finite], 1.0 + onward, rtol=1e-9)


def test_parts_that_do_not_meet():
    chain = NicheChain(sparse.block_diag([np.full((2, 2), 0.5), np.roll(np.eye(3), 1, axis=1)]))
    assert hitting_probabilities(chain, 0).tolist() == [1.0, 1.0, 0.0, 0.0, 0.0]
    assert mean_first_passage_times(chain, 0).tolist() == [0.0, 2.0, np.inf, np.inf, np.inf]
    assert mean_first_passage_times(chain, 2).tolist() == [np.inf, np.inf, 0.0, 2.0, 1.0]


def test_targets_are_named_like_niches():
    niches = GridNiches((2, 2), ((0.0, 1.0), (0.0, 1.0)))
    transition = np.full((5, 5), 0.2)
    chain = NicheChain(transition, niches=niches, outside=4)
    assert mean_first_passage_times(chain, (1, 1)).tolist() == mean_first_passage_times(chain, 3).tolist()
    assert mean_first_passage_times(chain, [(1, 1), 0])[0] == 0.0
    # The outside state goes by its number. From anywhere else it is a fifth each time.
    np.testing.assert_allclose(mean_first_passage_times(chain, 4), [5, 5, 5, 5, 0])
    np.testing.assert_allclose(mean_first_passage_times(chain, np.array([0, 4])), [0, 2.5, 2.5, 2.5, 0])
    for target, message in (
        (5, "niche is 5"),
        ((2, 0), "niche is 2,0"),
        ([], "target is empty"),
        (-1, "niche"),
    ):
        with pytest.raises(NichechainError, match=message):
            hitting_probabilities(chain, target)


def test_a_ladder_that_is_hardly_ever_climbed():
    """Σ over levels of times from one to the next, in rational arithmetic: 1.7e19, no negative number."""
    chain = NicheChain(ladder(20, 0.1))
    up, down = Fraction(0.1), Fraction(0.9)
    step, total = Fraction(0), Fraction(0)
    for _ in range(20):
        step = (1 + down * step) / up
        total += step
    assert float(total) == pytest.approx(1.7096717051798807e19, rel=1e-15)
    assert mean_first_passage_times(chain, 20)[0] == pytest.approx(float(total), rel=1e-14)


@pytest.mark.parametrize("top", [300, 5000, 72_000])
def test_long_ladders(top):
    # From level i to the next it takes Σ (q/p)^k / p for k = 0 … i.
    up = 0.51
    times = mean_first_passage_times(NicheChain(ladder(top, up)), top)
    odds = (1 - up) / up
    level = np.arange(top)
    steps = (1 - odds ** (level + 1)) / (up * (1 - odds))
    np.testing.assert_allclose(times[:-1], np.cumsum(steps[::-1])[::-1], rtol=1e-9)


@pytest.mark.parametrize("top", [400, 3000])
def test_a_time_beyond_floating_point_is_refused(top):
    with pytest.raises(NichechainError, match=r"(1e308|underflow|below 1e-308)"):
        mean_first_passage_times(NicheChain(ladder(top, 0.1)), top)


def test_two_steps_that_hardly_ever_happen():
    e = 1e-9
    slow = NicheChain([[1 - e, e, 0], [1 - e, 0, e], [0, 0, 1]])
    assert mean_first_passage_times(slow, 2)[0] == pytest.approx(1.000000001e18, rel=1e-15)


@given(graded(), st.data())
@settings(max_examples=60, deadline=None)
def test_every_entry_is_right(transition, data):
    """Probabilities from 1 to 1e-30 in one matrix, against rational arithmetic on the same floats."""
    size = len(transition)
    target = data.draw(st.integers(0, size - 1))
    rest = [i for i in range(size) if i != target]
    exact = exact_solution(exact_system(transition, rest), [Fraction(1)] * len(rest))
    found = mean_first_passage_times(NicheChain(transition), target)
    np.testing.assert_allclose(found[rest], [float(x) for x in exact], rtol=1e-12)
    if size == 2:
        return
    # The target competes with a trap.
    trap = rest[0]
    trapped = transition.copy()
    trapped[trap] = np.eye(size)[trap]
    others = rest[1:]
    right = [Fraction(float(transition[i, target])) for i in others]
    exact = exact_solution(exact_system(trapped, others), right)
    found = hitting_probabilities(NicheChain(trapped), target)
    np.testing.assert_allclose(found[others], [float(x) for x in exact], rtol=1e-12)
    assert found.max() <= 1.0


def test_a_posterior_mean_in_parts_answers_alike(monkeypatch):
    niches = GridNiches((12, 12), ((0.0, 1.0), (0.0, 1.0)), "absorb")
    rng = np.random.default_rng(0)
    pairs = rng.integers(niches.states, size=(2, 4000))
    chain = estimate(TransitionCounts.from_pairs(*pairs, niches), strength=5.0)
    target = [3, 70]
    hit, times = hitting_probabilities(chain, target), mean_first_passage_times(chain, 144)
    monkeypatch.setattr(rows_, "_WHOLE", 10)
    np.testing.assert_allclose(hitting_probabilities(chain, target), hit, atol=1e-8)
    np.testing.assert_allclose(mean_first_passage_times(chain, 144), times, rtol=1e-8)
    assert np.isinf(mean_first_passage_times(chain, target)).sum() == 145 - 2
