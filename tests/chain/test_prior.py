"""The fitted prior: what neighbours say, what births are attributed to, coverage of intervals."""

from __future__ import annotations

import numpy as np
import pytest

from nichechain import CVTNiches, GridNiches, TransitionCounts, estimate, niche_evolvability
from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.neighbours import Neighbours
from nichechain.chain.prior import fit_prior
from nichechain.evolvability.coverage import expected_coverage

PLANE = GridNiches((4, 3), ((0.0, 4.0), (0.0, 3.0)))


def _pairs(counts):
    entries = counts.matrix.tocoo()
    order = np.lexsort(entries.coords[::-1])
    return (axis[order].astype(np.int64) for axis in entries.coords)


def _said_by_neighbours(niches, landing, reach):
    """Rows by a loop over rows, neighbours and children: as they landed, and as they moved, (2, S, S)."""
    n, states = len(niches), niches.states
    said = np.zeros((2, states, states))
    for i in range(n):
        for k in range(n):
            away = np.subtract(niches.index(k), niches.index(i))
            if not 0 < away @ away <= reach**2:
                continue
            weight = np.exp(-0.5 * away @ away / (reach / 2) ** 2)
            for j in range(states):
                said[0, i, j] += weight * landing[k, j]
                if j == n:
                    said[1, i, n] += weight * landing[k, j]
                    continue
                there = np.array(niches.index(j)) - away
                if ((there >= 0) & (there < niches.shape)).all():
                    said[1, i, niches.flat(tuple(there.tolist()))] += weight * landing[k, j]
    return said / (said.sum(axis=2, keepdims=True) + 1.0)


@pytest.mark.parametrize(("far", "reach"), [(False, 2), (True, 3)])
def test_neighbours_say_what_a_loop_over_them_says(far, reach):
    rng = np.random.default_rng(0)
    parent, child = rng.integers(13, size=(2, 70))
    counts = TransitionCounts.from_pairs(parent, child, PLANE)
    i, j = _pairs(counts)
    births = rng.gamma(2.0, size=i.size)
    landing = np.zeros((13, 13))
    landing[i, j] = births
    expected = _said_by_neighbours(PLANE, landing, reach)
    neighbours = Neighbours(PLANE, i, j, np.arange(i.size), far=far)
    np.testing.assert_allclose(neighbours.shares(births, births), expected[:, i, j], atol=1e-14)
    near = neighbours.rows(births, births, np.array([0.3, 0.5]))
    np.testing.assert_allclose(near.matrix.toarray(), 0.3 * expected[0] + 0.5 * expected[1], atol=1e-14)
    some = rng.integers(13, size=(2, 300))
    np.testing.assert_allclose(near.at(*some), near.matrix.toarray()[*some], atol=1e-14)
    # A row's own births say nothing of it.
    landing[4] = 0.0
    alone = _said_by_neighbours(PLANE, landing, reach)[:, 4]
    np.testing.assert_allclose(expected[:, 4], alone, atol=1e-14)


@pytest.mark.parametrize("outside", ["state", "absorb", "clip"])
def test_base_and_its_draws_are_distributions_and_parts_of_one_matrix(outside):
    niches = GridNiches((4, 3), ((0.0, 4.0), (0.0, 3.0)), outside)
    rng = np.random.default_rng(1)
    parent, child = rng.integers(12, size=(2, 200))
    chain = estimate(TransitionCounts.from_pairs(parent, child, niches))
    prior = chain.posterior.prior
    drawn, strength = prior.draw(np.random.default_rng(2))
    assert strength > 0
    for base in (prior.base, drawn):
        rows = base.rows(np.arange(niches.states))
        assert (rows > 0).all()
        np.testing.assert_allclose(rows.sum(axis=1), 1.0, rtol=1e-12)
        i, j = np.divmod(np.arange(niches.states**2), niches.states)
        np.testing.assert_allclose(base.probability(i, j), rows.ravel(), rtol=1e-12)
    np.testing.assert_allclose(chain.operator.toarray(), chain.posterior.mean(), atol=1e-14)


def test_draws_of_states_follow_rows_in_which_neighbours_have_a_say():
    rng = np.random.default_rng(3)
    parent = rng.integers(12, size=400)
    # One half of the plane sends its children to one place, the other half to another.
    child = np.where(rng.random(400) < 0.8, np.where(parent < 6, 2, 9), rng.integers(13, size=400))
    prior = fit_prior(TransitionCounts.from_pairs(parent, child, PLANE))
    assert prior.base.near.mass.sum() > 0
    size = 20_000
    drawn = prior.base.sample(np.repeat(np.arange(13), size), np.random.default_rng(4)).reshape(13, size)
    rows = prior.base.rows(np.arange(13))
    share = np.array([np.bincount(row, minlength=13) / size for row in drawn])
    assert (np.abs(share - rows) <= 4.5 * np.sqrt(rows * (1 - rows) / size) + 1e-12).all()


def test_births_are_not_counted_twice():
    # Half of the children land in one place, half move by one: pooled over all births, either kind
    # would carry the other's.
    niches = GridNiches((12, 12), ((0.0, 1.0),) * 2, "clip")
    rng = np.random.default_rng(5)
    parent = np.repeat(np.arange(132), 6)
    child = np.where(rng.random(parent.size) < 0.5, 77, parent + 12)
    counts = TransitionCounts.from_pairs(parent, child, niches)
    base = fit_prior(counts).base
    assert base.destination[77] > 0.97
    rows = base.rows(np.arange(144))
    np.testing.assert_allclose(rows[30, [42, 77]], 0.5, atol=0.1)
    pooled = BaseMeasure.pooled(counts, np.array([0.5, 0.5, 0.0])).rows(np.arange(144))
    assert pooled[30, [42, 77]].sum() < 0.85


def test_a_tessellation_has_pools_alone():
    niches = CVTNiches.tessellated(30, ((0.0, 1.0), (0.0, 1.0)))
    rng = np.random.default_rng(6)
    prior = fit_prior(TransitionCounts.from_pairs(*rng.integers(31, size=(2, 300)), niches))
    assert prior.base.near is None
    assert prior.weights.shape == (3,)


def test_without_births_there_is_a_prior():
    prior = fit_prior(TransitionCounts.from_pairs([], [], PLANE))
    rows = prior.draw(np.random.default_rng(0))[0].rows(np.arange(13))
    np.testing.assert_allclose(rows.sum(axis=1), 1.0)


def test_intervals_hold_the_truth_as_often_as_they_say():
    # Rows drawn around a known base; 90 % intervals of the children's coverage. Niches of one world
    # share its base, so that eight worlds of 64 niches are about as good as 100 independent intervals:
    # 0.9 +- 0.09 with a certainty of 99.7 %.
    niches = GridNiches((8, 8), ((0.0, 1.0),) * 2, "clip")
    x, y = np.mgrid[-7:8, -7:8]
    kernel = np.exp(-(x**2 + y**2) / 3.0)
    place = np.stack(np.unravel_index(np.arange(64), (8, 8)), axis=1)
    apart = place[None] - place[:, None]
    near = kernel[apart[..., 0] + 7, apart[..., 1] + 7]
    near /= near.sum(axis=1, keepdims=True)
    favourites = np.random.default_rng(1).dirichlet(np.full(64, 0.2))
    base = 0.5 * near + 0.5 * favourites
    held = []
    for world in range(8):
        rng = np.random.default_rng(world)
        T = rng.standard_gamma(10.0 * base)
        T /= T.sum(axis=1, keepdims=True)
        births = np.stack([rng.multinomial(80, row) for row in T])
        parent, child = np.nonzero(births)
        counts = TransitionCounts.from_pairs(parent, child, niches, births[parent, child])
        found = niche_evolvability(estimate(counts), l=1, lineages=20, draws=50, seed=world)
        true = expected_coverage(T, T, 1, 20)
        held.append(np.mean((found.low <= true) & (true <= found.high)))
    assert 0.81 <= np.mean(held) <= 0.99
