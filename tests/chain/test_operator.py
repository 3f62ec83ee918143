"""T in parts, against its dense self."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from nichechain import GridNiches, NicheChain, TransitionCounts, estimate
from nichechain.chain import estimators
from nichechain.chain import posterior as posteriors
from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.posterior import DirichletPosterior
from nichechain.core.errors import NichechainError
from nichechain.evolvability.coverage import expected_coverage, sampled_coverage
from nichechain.evolvability.reach import visit_probability

GRIDS = {"line": (7,), "plane": (4, 5), "space": (2, 3, 4)}
OUTSIDE = ("state", "absorb", "clip")


def _posterior(shape, outside, strength=3.0, births=60):
    niches = GridNiches(shape, ((0.0, 1.0),) * len(shape), outside)
    rng = np.random.default_rng(len(shape))
    parent, child = rng.integers(niches.states, size=(2, births))
    if outside == "absorb":
        parent[parent == len(niches)] = 0
    counts = TransitionCounts.from_pairs(parent, child, niches)
    base = BaseMeasure.pooled(counts, np.array([0.3, 0.6, 0.1]))
    return DirichletPosterior(counts, base, strength, np.linspace(1.0, 3.0, niches.states))


@pytest.fixture
def in_atoms(monkeypatch):
    """Rows of few states are drawn as those of many, in 9 atoms each."""

    def few(states, atoms=9):
        monkeypatch.setattr(posteriors, "_MANY_STATES", 1)
        monkeypatch.setattr(posteriors, "_MOST_PIECES", atoms * states)

    return few


@pytest.mark.parametrize("outside", OUTSIDE)
@pytest.mark.parametrize("births", [60, 5])
@pytest.mark.parametrize("name", GRIDS)
def test_the_mean_in_parts_is_the_mean(name, births, outside):
    posterior = _posterior(GRIDS[name], outside, births=births)
    mean, parts = posterior.mean(), posterior.mean_operator()
    states = len(mean)
    assert parts.shape == mean.shape
    np.testing.assert_allclose(parts.toarray(), mean, atol=1e-14)
    rng = np.random.default_rng(0)
    # More columns than are transformed together.
    for x in (rng.normal(size=states), rng.normal(size=(states, 70))):
        np.testing.assert_allclose(parts @ x, mean @ x, atol=1e-12)
        np.testing.assert_allclose(x.T @ parts, x.T @ mean, atol=1e-12)
    some = np.array([states - 1, 0, 3, 3])
    np.testing.assert_allclose(parts[some].toarray(), mean[some], atol=1e-14)
    np.testing.assert_allclose(parts[some] @ x, mean[some] @ x, atol=1e-12)
    np.testing.assert_allclose(np.ones(4) @ parts[some], mean[some].sum(axis=0), atol=1e-12)
    np.testing.assert_allclose(sparse.eye_array(states).tocsr()[[2]] @ parts, mean[[2]], atol=1e-12)


def test_coverage_of_the_mean_needs_no_entries():
    posterior = _posterior((4, 5), "state")
    chain = NicheChain(posterior=posterior, niches=posterior.counts.niches, outside=20)
    of_parts = expected_coverage(chain.operator, chain.operator, 4, [1, 30, 10**9], counted=20)
    np.testing.assert_allclose(of_parts, expected_coverage(chain.T, chain.T, 4, [1, 30, 10**9], counted=20))
    assert NicheChain(np.eye(2)).operator is not None


@pytest.mark.parametrize("outside", OUTSIDE)
@pytest.mark.parametrize("strength", [2.0, 8.0, 40.0, 1e4])
def test_draws_in_atoms_are_row_stochastic(in_atoms, strength, outside):
    posterior = _posterior((4, 5), outside, strength)
    in_atoms(posterior.base.niches.states)
    drawn = posterior.draw(np.random.default_rng(0)).toarray()
    assert (drawn >= 0).all()
    np.testing.assert_allclose(drawn.sum(axis=1), 1.0, rtol=1e-12)
    if outside == "absorb":
        np.testing.assert_array_equal(drawn[-1], np.eye(21)[-1])


@pytest.mark.parametrize("strength", [4.0, 8.0, 40.0])
def test_draws_in_atoms_have_the_mean_and_covariances_of_a_dirichlet(in_atoms, strength):
    posterior = _posterior((7,), "state", strength, births=20)
    in_atoms(8)
    rng = np.random.default_rng(3)
    draws = np.array([posterior.draw(rng).toarray() for _ in range(4000)])
    mean = posterior.mean()
    total = posterior.counts.births / posterior.design_effect + strength
    for i in range(8):
        expected = (np.diag(mean[i]) - np.outer(mean[i], mean[i])) / (total[i] + 1.0)
        centred = draws[:, i] - mean[i]
        products = centred[:, :, None] * centred[:, None, :]
        for found, value in ((centred, 0.0), (products, expected)):
            error = found.std(axis=0) / np.sqrt(len(draws))
            assert (np.abs(found.mean(axis=0) - value) < 5.0 * error + 1e-12).all()


def test_what_walks_need_is_refused_and_what_is_exact_is_not(in_atoms):
    posterior = _posterior((4, 5), "state", 40.0)
    in_atoms(21)
    drawn = posterior.draw(np.random.default_rng(0))
    with pytest.raises(NichechainError, match="T has 21 states and too many entries to simulate walks"):
        sampled_coverage(drawn, np.full(21, 1 / 21), 3, 10, 5, np.random.default_rng(0))
    first = drawn[[4]].toarray()[0]
    for found, expected in zip(
        visit_probability(drawn, first, 4), visit_probability(drawn.toarray(), first, 4), strict=True
    ):
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("unvisited", ["uniform", "base"])
def test_rows_filled_alike_are_kept_once(monkeypatch, unvisited):
    counts = _posterior((4, 5), "absorb", births=12).counts
    usual = estimate(counts, "mle", unvisited=unvisited)
    monkeypatch.setattr(estimators, "_FILLED", 10)
    chain = estimate(counts, "mle", unvisited=unvisited)
    np.testing.assert_allclose(chain.T, usual.T.toarray(), rtol=1e-15)
    x = np.random.default_rng(0).normal(size=(21, 3))
    np.testing.assert_allclose(chain.operator @ x, usual.T @ x, atol=1e-14)
