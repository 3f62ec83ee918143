"""The base measure, against a double loop over births; its draws against its rows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nichechain import GridNiches, TransitionCounts
from nichechain.chain import displacement
from nichechain.chain.base_measure import BaseMeasure

GRIDS = {
    "plane": ((4, 3), ((0.0, 4.0), (0.0, 3.0))),
    "line": ((6,), ((0.0, 6.0),)),
    "space": ((2, 3, 2), ((0.0, 1.0),) * 3),
}
WEIGHTS = np.array([0.3, 0.6, 0.1])


def _counts(name, outside, births=80, seed=0):
    niches = GridNiches(*GRIDS[name], outside)
    rng = np.random.default_rng(seed)
    parent, child = rng.integers(niches.states, size=(2, births))
    # Some displacements never occur, some often.
    near = rng.random(births) < 0.5
    child[near] = np.minimum(parent[near] + 1, niches.states - 1)
    if outside == "absorb":
        parent[parent == len(niches)] = 0
    return TransitionCounts.from_pairs(parent, child, niches), list(
        zip(parent.tolist(), child.tolist(), strict=True)
    )


def _naive_components(niches, pairs, parent):
    """The three components of B_i, birth by birth: (3, S)."""
    n, states = len(niches), niches.states
    destination = np.full(states, 1.0 / states)
    for _, j in pairs:
        destination[j] += 1.0
    destination /= destination.sum()
    uniform = np.full(states, 1.0 / states)
    if parent == n:
        return np.array([destination, destination, uniform])
    # Half a birth at no distance, and every birth's own distance.
    tally = {(0,) * len(niches.shape): 0.5}
    left = stayed = 0
    for i, j in pairs:
        if i == n:
            continue
        if j == n:
            left += 1
            continue
        stayed += 1
        move = tuple(b - a for a, b in zip(niches.index(i), niches.index(j), strict=True))
        tally[move] = tally.get(move, 0.0) + 1.0
    displaced = np.zeros(states)
    for j in range(n):
        move = tuple(b - a for a, b in zip(niches.index(parent), niches.index(j), strict=True))
        # To where nobody was born, only a child that stays is displaced.
        if j == parent or any(j in pair for pair in pairs if n not in pair):
            displaced[j] = tally.get(move, 0.0)
    leaving = left / max(1, left + stayed)
    displaced *= (1.0 - leaving) / displaced.sum()
    if states > n:
        displaced[n] = leaving
    return np.array([destination, displaced, uniform])


@pytest.mark.parametrize("outside", ["state", "absorb", "clip"])
@pytest.mark.parametrize("births", [80, 6])
@pytest.mark.parametrize("name", GRIDS)
def test_rows_equal_a_double_loop_over_births(name, births, outside):
    counts, pairs = _counts(name, outside, births)
    base = BaseMeasure.pooled(counts, WEIGHTS)
    states = counts.niches.states
    expected = np.array([_naive_components(counts.niches, pairs, i) for i in range(states)])
    parent, child = np.divmod(np.arange(states**2), states)
    components = base.components(parent, child).reshape(3, states, states).transpose(1, 0, 2)
    np.testing.assert_allclose(components, expected, rtol=1e-9, atol=1e-14)
    rows = base.rows(np.arange(states))
    np.testing.assert_allclose(rows, np.einsum("k,ikj->ij", WEIGHTS, expected), rtol=1e-9)
    np.testing.assert_allclose(rows.sum(axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(base.probability(parent, child), rows.ravel(), rtol=1e-12)


@given(
    name=st.sampled_from(sorted(GRIDS)),
    outside=st.sampled_from(["state", "absorb", "clip"]),
    births=st.integers(0, 30),
    seed=st.integers(0, 2**20),
)
@settings(deadline=None, max_examples=60)
def test_rows_are_distributions_for_however_few_births(name, outside, births, seed):
    counts, _ = _counts(name, outside, births, seed)
    for weights in (WEIGHTS, *np.eye(3)):
        rows = BaseMeasure.pooled(counts, weights).rows(np.arange(counts.niches.states))
        assert (rows >= 0).all()
        np.testing.assert_allclose(rows.sum(axis=1), 1.0, rtol=1e-12)


def test_without_births_a_displaced_child_stays():
    counts = TransitionCounts.from_pairs([], [], GridNiches(*GRIDS["plane"]))
    rows = BaseMeasure.pooled(counts, np.array([0.0, 1.0, 0.0])).rows(np.arange(12))
    np.testing.assert_allclose(rows, np.eye(12, 13), atol=1e-15)


def test_displacement_is_one_move_for_all_niches():
    # All births move one cell along x; at the far edge only staying is left.
    niches = GridNiches(*GRIDS["plane"], "clip")
    counts = TransitionCounts.from_pairs(np.arange(9), np.arange(9) + 3, niches)
    rows = BaseMeasure.pooled(counts, np.array([0.0, 1.0, 0.0])).rows(np.arange(12))
    for i in range(9):
        assert rows[i, i + 3] == pytest.approx(9 / 9.5, rel=1e-9)
        assert rows[i, i] == pytest.approx(0.5 / 9.5, rel=1e-9)
    for i in range(9, 12):
        assert rows[i, i] == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize(
    "weights", [WEIGHTS, *np.eye(3)], ids=["mixed", "destination", "displacement", "uniform"]
)
@pytest.mark.parametrize("patience", [0, 100])
@pytest.mark.parametrize(("name", "births"), [("plane", 80), ("space", 80), ("plane", 6)])
def test_draws_follow_the_rows(name, births, weights, patience, monkeypatch):
    monkeypatch.setattr(displacement, "_PATIENCE", patience)
    counts, _ = _counts(name, "state", births)
    base = BaseMeasure.pooled(counts, weights)
    states = counts.niches.states
    size = 4000
    parents = np.repeat(np.arange(states), size).reshape(states, size)
    drawn = base.sample(parents, np.random.default_rng(3))
    assert drawn.shape == parents.shape
    rows = base.rows(np.arange(states))
    share = np.array([np.bincount(row, minlength=states) / size for row in drawn])
    # 13² shares at once: 4.5 standard errors are passed by chance once in a thousand runs.
    assert (np.abs(share - rows) <= 4.5 * np.sqrt(rows * (1 - rows) / size) + 1e-12).all()
    # Over all parents, 13 sums that are three times as sharp.
    error = np.sqrt((rows * (1 - rows)).sum(axis=0) / size)
    assert (np.abs((share - rows).sum(axis=0)) <= 4 * error + 1e-12).all()


def test_draws_are_a_function_of_the_generator():
    base = BaseMeasure.pooled(_counts("plane", "state")[0], WEIGHTS)
    parents = np.arange(13)
    runs = [base.sample(parents, np.random.default_rng(seed)).tolist() for seed in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]
