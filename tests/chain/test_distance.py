"""Displacement by distance, against a double loop; T in parts over niches that are no grid."""

import numpy as np
import pytest

from nichechain import NicheChain, TransitionCounts, estimate, niche_evolvability
from nichechain.chain import distance as distances
from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.distance import DistanceDisplacement
from nichechain.chain.posterior import DirichletPosterior
from nichechain.chain.structure.wormholes import wormholes
from nichechain.niches import CVTNiches

BOXES = {"line": ((0.0, 3.0),), "plane": ((0.0, 1.0), (0.0, 2.0)), "four": ((0.0, 1.0),) * 4}
OUTSIDE = ("state", "absorb", "clip")


@pytest.fixture(params=[True, False], ids=["whole", "in blocks"])
def kept(request, monkeypatch):
    """K kept whole, or made again a few rows at a time."""
    if not request.param:
        monkeypatch.setattr(distances, "_WHOLE", 0)
        monkeypatch.setattr(distances, "_BLOCK", 45)


def _counts(name, outside="state", births=120, number=18):
    bounds = BOXES[name]
    rng = np.random.default_rng(4)
    lower, upper = np.array(bounds).T
    niches = CVTNiches(rng.uniform(lower, upper, (number, len(bounds))), bounds, outside)
    parent, child = rng.integers(niches.states, size=(2, births))
    near = rng.random(births) < 0.5
    child[near] = parent[near]
    if outside == "absorb":
        parent[parent == len(niches)] = 0
    return TransitionCounts.from_pairs(parent, child, niches)


def _naive_weights(counts, leave_out=None):
    """K, pair by pair: births of a shell over the places they could have gone, parents left out or not."""
    niches, n = counts.niches, len(counts.niches)
    width = (np.prod(niches.upper - niches.lower) / n) ** (1 / niches.centers.shape[1])
    shell = np.zeros((n, n), int)
    for i in range(n):
        for j in range(n):
            if i != j:
                shell[i, j] = max(1, int(np.linalg.norm(niches.centers[i] - niches.centers[j]) / width + 0.5))
    births, exposure = {0: 0.5}, {0: 0.5}
    inside = counts.matrix.toarray()[:n, :n]
    for i in range(n):
        if i == leave_out:
            continue
        for j in range(n):
            births[shell[i, j]] = births.get(shell[i, j], 0) + inside[i, j]
            exposure[shell[i, j]] = exposure.get(shell[i, j], 0) + inside[i].sum()
    weight = np.array([[births[b] / exposure[b] if exposure[b] else 0.0 for b in row] for row in shell])
    return weight, shell


@pytest.mark.usefixtures("kept")
@pytest.mark.parametrize("name", BOXES)
def test_weights_equal_a_double_loop_over_births(name):
    counts = _counts(name)
    base = BaseMeasure.pooled(counts, np.array([0.3, 0.6, 0.1]))
    found = base.displacement
    assert isinstance(found, DistanceDisplacement)
    weight, shell = _naive_weights(counts)
    n = len(weight)
    parent, child = np.divmod(np.arange(n * n), n)
    np.testing.assert_allclose(found.at(parent, child).reshape(n, n), weight, rtol=1e-12)
    np.testing.assert_allclose(found.within, weight.sum(axis=1), rtol=1e-12)
    np.testing.assert_allclose(found.rows(np.arange(n)), weight, rtol=1e-12)
    x = np.random.default_rng(0).normal(size=(3, n))
    np.testing.assert_allclose(found.to_parents(x), x @ weight.T, atol=1e-12)
    np.testing.assert_allclose(found.to_children(x), x @ weight, atol=1e-12)
    pair, row = found.own(parent, child)
    inside = counts.matrix.toarray()[:n, :n]
    exposure = np.array(
        [(inside.sum(axis=1)[:, None] * (shell == b)).sum() + 0.5 * (b == 0) for b in shell.ravel()]
    )
    seen = exposure > 0
    np.testing.assert_allclose(pair[seen], (inside.sum() + 0.5) / exposure[seen])
    alike = (shell[:, :, None] == shell[:, None, :]).sum(axis=2).ravel()
    np.testing.assert_allclose(row[seen], (pair * alike)[seen])


@pytest.mark.usefixtures("kept")
@pytest.mark.parametrize("outside", OUTSIDE)
@pytest.mark.parametrize("name", BOXES)
def test_rows_and_parts_are_one_matrix(name, outside):
    counts = _counts(name, outside)
    base = BaseMeasure.pooled(counts, np.array([0.3, 0.6, 0.1]))
    rows = base.rows(np.arange(counts.niches.states))
    np.testing.assert_allclose(rows.sum(axis=1), 1.0, rtol=1e-12)
    posterior = DirichletPosterior(counts, base, 3.0, np.linspace(1.0, 3.0, counts.niches.states))
    mean, parts = posterior.mean(), posterior.mean_operator()
    np.testing.assert_allclose(parts.toarray(), mean, atol=1e-14)
    x = np.random.default_rng(0).normal(size=(len(mean), 40))
    np.testing.assert_allclose(parts @ x, mean @ x, atol=1e-12)
    np.testing.assert_allclose(x.T @ parts, x.T @ mean, atol=1e-12)


@pytest.mark.usefixtures("kept")
def test_draws_follow_the_rows():
    counts = _counts("plane")
    base = BaseMeasure.pooled(counts, np.array([0.0, 1.0, 0.0]))
    states, size = counts.niches.states, 4000
    parents = np.random.default_rng(1).permutation(np.repeat(np.arange(states), size))
    drawn = base.sample(parents, np.random.default_rng(3))
    rows = base.rows(np.arange(states))
    share = np.array([np.bincount(drawn[parents == i], minlength=states) for i in range(states)]) / size
    assert (np.abs(share - rows) <= 4.5 * np.sqrt(rows * (1 - rows) / size) + 1e-12).all()


def test_a_parent_at_the_edge_has_its_children_inside():
    # Three in a row, a width apart: births from the middle go left and right alike, and stay.
    niches = CVTNiches([[0.5], [1.5], [2.5]], ((0.0, 3.0),), "clip")
    counts = TransitionCounts.from_pairs([1] * 40, [0] * 10 + [2] * 10 + [1] * 20, niches)
    rows = BaseMeasure.pooled(counts, np.array([0.0, 1.0, 0.0])).rows(np.arange(3))
    # A rate of 20 in 80 places a width away against 20.5 in 40.5 at home.
    near, home = 20 / 80, 20.5 / 40.5
    np.testing.assert_allclose(rows[1], np.array([near, home, near]) / (home + 2 * near))
    np.testing.assert_allclose(rows[0], np.array([home, near, 0.0]) / (home + near))


def test_chains_and_wormholes_over_a_tessellation():
    niches = CVTNiches.tessellated(60, BOXES["plane"])
    rng = np.random.default_rng(5)
    parent = np.repeat(np.append(rng.integers(60, size=148), [7, 7]), 12)
    moved = niches.centers[parent] + rng.normal(0.0, 0.12, (parent.size, 2))
    child = niches.of(moved)
    child[(parent == 7) & (rng.random(parent.size) < 0.5)] = 40
    counts = TransitionCounts.from_births(parent, child, niches, elite=np.repeat(np.arange(150), 12))
    chain = estimate(counts)
    assert isinstance(chain, NicheChain)
    # Children land near their parents, which the fit finds out.
    assert chain.posterior.base.weights[1] > 0.5
    scores = niche_evolvability(chain, l=3, lineages=20, draws=4)
    assert ((scores.value > 1) & (scores.value < 60)).all()
    found = wormholes(chain)
    flagged = found[found["wormhole"]]
    assert set(zip(flagged["parent"], flagged["child"], strict=True)) == {(7, 40)}
