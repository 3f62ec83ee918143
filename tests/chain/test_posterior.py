"""The Dirichlet posterior: its mean in closed form, and draws that have the right distribution."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from nichechain import GridNiches, TransitionCounts
from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.displacement import GridDisplacement
from nichechain.chain.posterior import DirichletPosterior

SHAPE = (4, 3)
BOUNDS = ((0.0, 4.0), (0.0, 3.0))
# A base that is known without asking: 3/4 of this, 1/4 uniform.
DESTINATION = np.array([8, 1, 0, 4, 2, 2, 0, 1, 3, 1, 1, 2, 5], float) / 30

DRAWS = 2500
# Few births' worth breaks sticks; more than there are states draws the rows whole.
STRENGTHS = {"sticks": 0.4, "whole rows": 40.0}


def _dense(matrix):
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


def _posterior(strength, outside="state"):
    niches = GridNiches(SHAPE, BOUNDS, outside)
    states = niches.states
    rng = np.random.default_rng(21)
    # Rows of no, one, few and many births.
    sizes = np.array([0, 1, 2, 5, 40, 0, 3, 8, 0, 1, 15, 4, 6])[:states]
    parent = np.repeat(np.arange(states), sizes)
    child = np.minimum(rng.poisson(3, parent.size), states - 1)
    counts = TransitionCounts.from_pairs(parent, child, niches)
    destination = DESTINATION[:states] / DESTINATION[:states].sum()
    kernel = GridDisplacement(niches, np.ones((7, 5)) / 35, np.ones(len(niches), bool))
    base = BaseMeasure(niches, destination, kernel, 0.0, np.array([0.75, 0.0, 0.25]))
    shares = np.zeros((states, states))
    for i, j in zip(parent, child, strict=True):
        shares[i, j] += 1
    alpha = shares + strength * (0.75 * destination + 0.25 / states)
    return DirichletPosterior(counts, base, strength, np.ones(states)), alpha


@pytest.fixture(scope="module", params=STRENGTHS)
def drawn(request):
    """A posterior's parameters (S, S), and many draws (DRAWS, S, S)."""
    posterior, alpha = _posterior(STRENGTHS[request.param])
    rng = np.random.default_rng(1)
    return alpha, np.array([_dense(posterior.draw(rng)) for _ in range(DRAWS)])


@pytest.mark.parametrize("outside", ["state", "clip"])
@pytest.mark.parametrize("strength", [0.01, 0.4, 3.0, 40.0, 1e4])
def test_the_mean_is_counts_and_base_over_births_and_strength(strength, outside):
    posterior, alpha = _posterior(strength, outside)
    births = np.array([0, 1, 2, 5, 40, 0, 3, 8, 0, 1, 15, 4, 6])[: len(alpha), None]
    np.testing.assert_allclose(posterior.mean(), alpha / (births + strength), rtol=1e-12)


def test_both_ways_of_drawing_are_tried():
    posteriors = {name: _posterior(strength)[0] for name, strength in STRENGTHS.items()}
    nonzeros = {name: posterior.draw(np.random.default_rng(0)).nnz for name, posterior in posteriors.items()}
    # Sticks leave states out that a whole row has.
    assert nonzeros["sticks"] < nonzeros["whole rows"] == 13 * 13


@pytest.mark.parametrize("strength", [0.01, 0.4, 3.0, 40.0, 1e4])
@pytest.mark.parametrize("outside", ["state", "absorb", "clip"])
def test_draws_are_row_stochastic(strength, outside):
    posterior, _ = _posterior(strength, outside)
    for seed in range(5):
        matrix = posterior.draw(np.random.default_rng(seed))
        assert (matrix.data >= 0).all()
        np.testing.assert_allclose(matrix.sum(axis=1), 1.0, rtol=1e-12)


def test_draws_have_the_mean(drawn):
    alpha, draws = drawn
    mean = alpha / alpha.sum(axis=1, keepdims=True)
    error = np.sqrt(mean * (1 - mean) / (alpha.sum(axis=1, keepdims=True) + 1) / DRAWS)
    # Entries that are nearly always 0 are too skewed for a standard error to mean much.
    scores = (draws.mean(axis=0) - mean) / error
    assert np.abs(scores)[mean > 0.01].max() < 4.5


def test_draws_have_the_variance(drawn):
    alpha, draws = drawn
    total = alpha.sum(axis=1, keepdims=True)
    expected = alpha * (total - alpha) / (total**2 * (total + 1))
    squares = (draws - alpha / total) ** 2
    error = squares.std(axis=0) / math.sqrt(DRAWS)
    often = expected > 1e-4
    assert often.sum() > 50
    assert (np.abs(squares.mean(axis=0) - expected)[often] / error[often]).max() < 5


def test_draws_are_as_concentrated_as_they_should_be(drawn):
    # Σ p², the chance that two children of one parent land together, tells the strength best.
    alpha, draws = drawn
    total = alpha.sum(axis=1)
    expected = (alpha * (alpha + 1)).sum(axis=1) / (total * (total + 1))
    together = (draws**2).sum(axis=2)
    for rows in ([0, 5, 8], [1, 2, 9], [4, 10]):
        found = together[:, rows].mean(axis=1)
        assert abs(found.mean() - expected[rows].mean()) <= 4 * found.std() / math.sqrt(DRAWS)


def test_draws_have_the_covariances(drawn):
    alpha, draws = drawn
    for i in (0, 4, 7):
        total = alpha[i].sum()
        mean = alpha[i] / total
        expected = -np.outer(mean, mean) / (total + 1)
        centred = draws[:, i] - mean
        products = centred[:, :, None] * centred[:, None, :]
        error = products.std(axis=0) / math.sqrt(DRAWS)
        pairs = ~np.eye(13, dtype=bool) & (expected < -1e-5)
        assert pairs.sum() > 20
        assert (np.abs(products.mean(axis=0) - expected)[pairs] / error[pairs]).max() < 5


def test_the_mass_of_a_set_of_states_is_beta(drawn):
    # The whole distribution of a few sums, not their moments alone.
    alpha, draws = drawn
    some = [0, 3, 7]
    for i in (0, 3, 4, 12):
        mass = draws[:, i, some].sum(axis=1)
        inside = alpha[i, some].sum()
        # What is left of a broken stick is put in one place: at most 1e-4 of a row.
        distribution = stats.beta(inside, alpha[i].sum() - inside)
        distance = stats.kstest(mass, distribution.cdf).statistic
        assert distance < 1.95 / math.sqrt(DRAWS) + 0.02 * (i == 0)


def test_rows_are_independent(drawn):
    _, draws = drawn
    correlation = np.corrcoef(draws[:, :, 0].T)
    assert np.abs(correlation[~np.eye(13, dtype=bool)]).max() < 4.5 / math.sqrt(DRAWS)


@pytest.mark.parametrize("strength", [1e-3, 1e-2])
@pytest.mark.parametrize("shape", [(2,), (1,), (2, 2)])
def test_a_base_worth_next_to_nothing_sends_all_children_to_one_state(shape, strength):
    # Dirichlet(s B) with s → 0: all mass in one state, drawn from B.
    niches = GridNiches(shape, ((0.0, 1.0),) * len(shape))
    counts = TransitionCounts.from_pairs([], [], niches)
    states = niches.states
    base = BaseMeasure(
        niches,
        np.full(states, 1 / states),
        GridDisplacement(niches, np.ones([2 * k - 1 for k in shape]), np.ones(len(niches), bool)),
        0.0,
        np.array([1.0, 0.0, 0.0]),
    )
    posterior = DirichletPosterior(counts, base, strength, np.ones(states))
    rng = np.random.default_rng(5)
    largest = np.array([_dense(posterior.draw(rng)).max(axis=1) for _ in range(200)])
    # The mean of Σ p² is (1 + s/S) / (1 + s), and the largest p is no smaller than Σ p².
    assert largest.mean() >= (1 + strength / states) / (1 + strength) - 0.01


def test_an_absorbing_outside_is_never_left():
    posterior, _ = _posterior(3.0, "absorb")
    for matrix in (posterior.mean(), *(_dense(posterior.draw(np.random.default_rng(k))) for k in range(3))):
        np.testing.assert_array_equal(matrix[-1], np.eye(13)[-1])
        assert (matrix[:-1, :-1] > 0).any()


def test_draws_are_functions_of_the_generator():
    for strength in STRENGTHS.values():
        posterior, _ = _posterior(strength)
        draws = [posterior.draw(np.random.default_rng(seed)).toarray() for seed in (3, 3, 4)]
        np.testing.assert_array_equal(draws[0], draws[1])
        assert not np.array_equal(draws[0], draws[2])
