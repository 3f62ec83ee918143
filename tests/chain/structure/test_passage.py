"""Hitting, first passage, staying: closed forms, deeptime, dense solutions, simulation-free laws."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from nichechain import GridNiches, NicheChain, NichechainError
from nichechain.chain.structure.passage import (
    hitting_probabilities,
    mean_first_passage_times,
    quasi_stationary_distribution,
)

from .samples import MIXED, transitions


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
