"""Guesses of where a child lands, against loops over births; smoothing against a plain convolution."""

from __future__ import annotations

import numpy as np
import pytest

from nichechain import CVTNiches, GridNiches
from nichechain.chain import near_births
from nichechain.chain.attribution import attributed, floored
from nichechain.chain.displacement import GridDisplacement
from nichechain.chain.kinds import Kinds
from nichechain.chain.near_births import NearBirths
from nichechain.chain.smoothing import CENTRE, SpreadPairs, smoothed_displacement, smoothed_states

PLANE = GridNiches((5, 4), ((0.0, 5.0), (0.0, 4.0)))
SHARES = np.exp(-0.5 * np.arange(-3, 4) ** 2)
SHARES /= SHARES.sum()


def _pairs(niches, births=80, seed=0):
    rng = np.random.default_rng(seed)
    code = np.unique(rng.integers(niches.states, size=(births, 2)) @ [niches.states, 1])
    return np.divmod(code, niches.states)


def _spread(cell):
    """Where a share of one cell goes, by a loop; what would leave the grid is mirrored at its edge."""
    share = np.zeros(PLANE.shape)
    for a, p in enumerate(SHARES):
        for b, q in enumerate(SHARES):
            place = [cell[0] + a - 3, cell[1] + b - 3]
            for axis, size in enumerate(PLANE.shape):
                while not 0 <= place[axis] < size:
                    place[axis] = -1 - place[axis] if place[axis] < 0 else 2 * size - 1 - place[axis]
            share[tuple(place)] += p * q
    return share


def test_smoothed_states_by_a_loop_over_cells():
    share = np.random.default_rng(0).dirichlet(np.ones(21))
    expected = np.zeros(PLANE.shape)
    for niche in range(20):
        expected += share[niche] * _spread(PLANE.index(niche))
    found = smoothed_states(PLANE, share)
    np.testing.assert_allclose(found[:20], expected.ravel(), atol=1e-14)
    assert found[20] == share[20]
    assert found.sum() == pytest.approx(1.0)


def test_smoothed_displacement_by_a_loop():
    kernel = np.zeros((9, 7))
    kernel[4, 3], kernel[6, 4] = 0.25, 0.75
    displacement = GridDisplacement(PLANE, kernel, np.ones(20, bool))
    found = smoothed_displacement(displacement).kernel
    expected = np.zeros((9, 7))
    for a, p in enumerate(SHARES):
        for b, q in enumerate(SHARES):
            there = 6 + a - 3, 4 + b - 3
            # Who moved did not stay, and nobody lands off the kernel.
            if 0 <= there[0] < 9 and 0 <= there[1] < 7 and there != (4, 3):
                expected[there] += p * q
    expected *= 0.75 / expected.sum()
    expected[4, 3] = 0.25
    np.testing.assert_allclose(found, expected, atol=1e-14)
    assert SHARES[3] == CENTRE


def test_pairs_are_spread_over_the_cells_around():
    parent, child = np.array([3, 3, 7, 20]), np.array([0, 6, 20, 2])
    spread = SpreadPairs.of(PLANE, parent, child)
    births = np.array([1.0, 10.0, 100.0, 1000.0])
    three = np.exp(-0.5 * np.array([1.0, 0.0, 1.0]))
    three /= three.sum()
    expected = np.zeros((21, 21))
    for i, j, born in zip(parent, child, births, strict=True):
        if j == 20:
            expected[i, j] += born
            continue
        x, y = PLANE.index(int(j))
        for a in (-1, 0, 1):
            for b in (-1, 0, 1):
                there = np.clip(x + a, 0, 4) * 4 + np.clip(y + b, 0, 3)
                expected[i, there] += born * three[a + 1] * three[b + 1]
    found = np.zeros((21, 21))
    found[spread.parent, spread.child] = spread.smooth(births)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    fell = np.zeros((21, 21))
    fell[spread.parent, spread.child] = spread.sharp(births)
    np.testing.assert_array_equal(fell[parent, child], births)
    assert fell.sum() == births.sum()


@pytest.mark.parametrize("outside", ["state", "clip"])
def test_many_births_are_heard_of_close_neighbours_as_they_fell(outside, monkeypatch):
    niches = GridNiches((5, 4), ((0.0, 5.0), (0.0, 4.0)), outside)
    parent, child = _pairs(niches)
    births = np.random.default_rng(4).gamma(2.0, size=(2, parent.size))
    monkeypatch.setattr(near_births, "_MOST_WORDS", 0)
    near = NearBirths(niches, parent, child)
    landed, smooth, moved, moved_smoothly = near.expected(*births)
    np.testing.assert_array_equal(landed, smooth)
    np.testing.assert_array_equal(moved, moved_smoothly)
    rows = near.rows(*births, np.array([0.1, 0.2, 0.3, 0.1]))
    np.testing.assert_allclose(rows.at(parent, child), 0.3 * landed + 0.4 * moved, atol=1e-14)


def test_what_is_said_of_pairs_is_part_of_the_whole():
    parent, child = _pairs(PLANE)
    births = np.random.default_rng(5).gamma(2.0, size=(2, parent.size))
    near = NearBirths(PLANE, parent, child)
    weights = np.array([0.1, 0.2, 0.3, 0.15])
    for kind in range(4):
        alone = np.zeros(4)
        alone[kind] = 0.5
        rows = near.rows(*births, alone)
        np.testing.assert_allclose(rows.at(parent, child), 0.5 * near.expected(*births)[kind], atol=1e-14)
    whole = near.rows(*births, weights).matrix.toarray()
    each = [
        near.rows(*births, np.where(np.arange(4) == kind, weights, 0.0)).matrix.toarray() for kind in range(4)
    ]
    # Births smoothed or not are shared out by their weights, and none of them counts twice.
    assert whole.sum(axis=1).max() < weights.sum()
    assert (whole > 0).sum() == (sum(each) > 0).sum()


def test_own_births_have_no_say_in_where_children_land():
    parent, child = _pairs(PLANE)
    kinds = Kinds(PLANE, parent, child)
    births = np.random.default_rng(1).gamma(2.0, size=(kinds.pools, parent.size))
    births[1:, parent == 20] = 0.0
    fell = kinds.expected(births)[0]
    for pair, (i, j) in enumerate(zip(parent, child, strict=True)):
        others = parent != i
        landed = births[0, others & (child == j)].sum() + 1 / 21
        assert fell[pair] == pytest.approx(landed / (births[0, others].sum() + 1.0))


@pytest.mark.parametrize(
    "niches", [PLANE, GridNiches((6,), ((0.0, 1.0),)), CVTNiches.tessellated(9, ((0.0, 1.0),) * 2)]
)
def test_a_base_is_the_mixture_of_its_kinds(niches):
    parent, child = _pairs(niches)
    kinds = Kinds(niches, parent, child)
    births = np.random.default_rng(2).gamma(2.0, size=(kinds.number, parent.size))
    pools = kinds.pooled(births)
    np.testing.assert_allclose(
        pools.sum(axis=0)[parent < len(niches)], births[:-1].sum(axis=0)[parent < len(niches)]
    )
    weights = floored(np.random.default_rng(3).dirichlet(np.ones(kinds.number)))
    base = kinds.base(pools, weights)
    rows = base.rows(np.arange(niches.states))
    np.testing.assert_allclose(rows.sum(axis=1), 1.0, rtol=1e-12)
    assert (rows > 0).all()
    np.testing.assert_allclose(base.probability(parent, child), rows[parent, child], rtol=1e-12)


def test_births_go_to_the_kinds_that_explain_them():
    # Half of the children of every niche land in one place, half move by one.
    niches = GridNiches((12, 12), ((0.0, 1.0),) * 2, "clip")
    parent = np.repeat(np.arange(132), 2)
    child = np.stack([np.full(132, 77), np.arange(12, 144)], axis=1).ravel()
    order = np.lexsort((child, parent))
    parent, child = parent[order], child[order]
    births = np.full(parent.size, 20.0)
    kinds = Kinds(niches, parent, child)
    pools = attributed(kinds, births, np.bincount(parent, births, 144))
    landing, moving, near_landing, near_moving = pools
    moved = child == parent + 12
    assert (landing + near_landing)[~moved].sum() > 0.98 * pools[:, ~moved].sum()
    assert (moving + near_moving)[moved].sum() > 0.98 * pools[:, moved].sum()


def test_a_kind_whose_weight_is_nothing_gets_no_births():
    parent, child = _pairs(PLANE)
    kinds = Kinds(PLANE, parent, child)
    weights = floored(np.where(kinds.pool == 1, 0.0, np.arange(1.0, kinds.number + 1)))
    births = np.ones(parent.size)
    pools = attributed(kinds, births, np.bincount(parent, minlength=21), weights)
    assert not pools[1].any()
    assert (pools[[0, 2, 3]].sum(axis=1) > 0).all()
    # Without weights given, some are found for all.
    assert attributed(kinds, births, np.bincount(parent, minlength=21))[1].sum() > 0


def test_the_last_weight_is_never_nothing():
    np.testing.assert_allclose(floored(np.array([2.0, 2.0, 0.0])), [0.49975, 0.49975, 5e-4])
    np.testing.assert_allclose(floored(np.array([1.0, 0.0, 1.0])), [0.5, 0.0, 0.5])
