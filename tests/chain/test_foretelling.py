"""Weights of guesses and the strength, judged by elites left out: simulated truths, and every birth once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse, stats

from nichechain import GridNiches, TransitionCounts, estimate
from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.displacement import GridDisplacement
from nichechain.chain.foretelling import LeftOut, leave_out, weighed
from nichechain.chain.kinds import Kinds
from nichechain.chain.prior import fit_prior

ROW = GridNiches((4,), ((0.0, 4.0),))


def _dense(chain):
    return chain.T.toarray() if sparse.issparse(chain.T) else np.asarray(chain.T)


def _simulate(base, strength, births, seed):
    """Births of a chain whose rows are Dirichlet(s B), and the chain."""
    rng = np.random.default_rng(seed)
    states = base.niches.states
    truth = np.array([rng.dirichlet(strength * row) for row in base.rows(np.arange(states))])
    table = np.array([rng.multinomial(births, row / row.sum()) for row in truth])
    parent, child = np.nonzero(table)
    pairs = np.repeat(parent, table[parent, child]), np.repeat(child, table[parent, child])
    return TransitionCounts.from_pairs(*pairs, base.niches), truth


def _known_base(weights, shape=(10, 10)):
    """A base with a few favourite destinations and displacements of a cell or two."""
    niches = GridNiches(shape, ((0.0, 1.0),) * 2)
    destination = stats.zipf(1.3).pmf(1 + np.random.default_rng(3).permutation(niches.states))
    x, y = np.mgrid[1 - shape[0] : shape[0], 1 - shape[1] : shape[1]]
    kernel = np.exp(-(x**2 + y**2) / 4)
    displacement = GridDisplacement(niches, kernel / kernel.sum(), np.ones(len(niches), bool))
    return BaseMeasure(niches, destination / destination.sum(), displacement, 0.05, np.array(weights))


@pytest.mark.parametrize("strength", [1.0, 5.0, 30.0])
@pytest.mark.parametrize("weights", [(0.9, 0.05, 0.05), (0.05, 0.9, 0.05), (0.45, 0.45, 0.1)])
def test_strength_and_mixture_are_learned_from_births(strength, weights):
    counts, _ = _simulate(_known_base(weights), strength, 100, seed=4)
    prior = fit_prior(counts)
    # What neighbours say of where children land, or how far, is the same as what all say here.
    where, how_far, anywhere = np.add.reduceat(prior.weights[[0, 1, 4, 5, 2, 3, 6, 7, 8]], [0, 4, 8])
    # A hundred rows of a hundred births pin s down to a few per cent, if B were known; it is not.
    assert prior.strength == pytest.approx(strength, rel=0.25)
    # Rows of s = 1 have a handful of states each, and their pool is a rough picture of B.
    atol = 0.3 if strength < 5 else 0.1
    np.testing.assert_allclose([where, how_far, anywhere], weights, atol=atol)


def test_the_learned_strength_is_near_the_most_likely_one_for_the_true_base():
    base = _known_base((0.45, 0.45, 0.1))
    counts, _ = _simulate(base, 5.0, 60, seed=8)
    table = counts.matrix.toarray()
    rows = base.rows(np.arange(101))
    strengths = np.geomspace(0.5, 50, 81)
    # scipy's Dirichlet-multinomial, row by row.
    likelihood = [
        sum(stats.dirichlet_multinomial.logpmf(row, s * b, 60) for row, b in zip(table, rows, strict=True))
        for s in strengths
    ]
    best = strengths[np.argmax(likelihood)]
    assert fit_prior(counts).strength == pytest.approx(best, rel=0.3)
    parent, child = np.nonzero(table)
    size = table[parent, child].astype(float)
    # Every birth left out alone.
    left = LeftOut(
        rows[parent, child][None],
        size - 1.0,
        np.full(size.size, 59.0),
        size,
        np.arange(size.size),
        np.arange(size.size),
        size,
    )
    assert weighed(left)[1] == pytest.approx(best, rel=0.1)


def test_the_estimate_is_nearly_as_near_to_the_truth_as_can_be():
    base = _known_base((0.45, 0.45, 0.1))
    counts, truth = _simulate(base, 5.0, 10, seed=1)
    # The posterior mean under the strength and the base that rows were drawn with: by Bayes, no
    # estimate has a smaller expected squared error.
    best = (counts.matrix.toarray() + 5.0 * base.rows(np.arange(101))) / 15.0
    estimates = (best, estimate(counts).T, _dense(estimate(counts, "mle")))
    errors = [((matrix - truth) ** 2).sum(axis=1).mean() for matrix in estimates]
    assert errors[0] < errors[1] < 1.05 * errors[0]
    assert errors[2] > 1.3 * errors[0]


def test_births_that_fall_anywhere_are_no_words_of_neighbours():
    # Three births a row on 400 niches: neighbours often share a child by chance.
    niches = GridNiches((20, 20), ((0.0, 1.0),) * 2, "clip")
    rng = np.random.default_rng(0)
    parent = np.repeat(np.arange(400), 3)
    prior = fit_prior(TransitionCounts.from_pairs(parent, rng.integers(400, size=1200), niches))
    assert np.abs(400 * prior.base.rows(np.arange(400)) - 1.0).mean() < 0.35
    assert prior.base.near.mass.max() < 0.05
    assert prior.strength > 100


def test_every_birth_is_left_out_once_and_with_its_family():
    parent = np.array([0, 0, 0, 0, 2, 2, 3, -1])
    child = np.array([1, 1, 2, 0, 2, 2, -1, 3])
    elite = np.array([5, 5, 5, 6, 7, 8, 9, -1])
    known = TransitionCounts.from_births(parent, child, ROW, elite=elite)
    both = known + TransitionCounts.from_pairs([2, 2, 1], [2, 2, 0], ROW)
    pairs = np.array([(0, 0), (0, 1), (0, 2), (1, 0), (2, 2)]).T
    left = leave_out(both, Kinds(ROW, *pairs), *pairs)
    assert left.births.sum() == left.children.sum() == both.births.sum() == 9
    np.testing.assert_array_equal(np.bincount(left.entry, left.children), left.births)
    # Two families in niche 0, two only children in 2; births without a family stand alone.
    assert sorted(np.bincount(left.elite, left.children).tolist()) == [1, 1, 1, 1, 1, 1, 3]
    # Whoever is left out, none of the family is left.
    family = np.bincount(left.elite, left.children)[left.elite]
    assert (left.row[left.entry][family == 3] <= 1).all()


def test_weights_and_strength_by_brute_force():
    rng = np.random.default_rng(1)
    n = 400
    expected = np.stack([rng.dirichlet(np.full(n, 0.3)), rng.dirichlet(np.full(n, 0.3)), np.full(n, 1 / n)])
    births = rng.poisson(4000 * (0.3 * expected[0] + 0.6 * expected[1] + 0.1 * expected[2])).astype(float)
    own = rng.poisson(0.2, n).astype(float)
    left = LeftOut(expected, own, np.full(n, own.sum()), births, np.arange(n), np.arange(n), births)
    weights, strength, error = weighed(left)
    best = births @ np.log(left.foretold(weights, strength))
    for a in np.linspace(0, 1, 21):
        for b in np.linspace(0, 1 - a, 21):
            for s in np.geomspace(0.1, 8000, 25):
                tried = np.array([a, b, max(1 - a - b, 0.0)])
                with np.errstate(divide="ignore"):
                    assert births @ np.log(left.foretold(tried, s)) <= best + 0.05
    np.testing.assert_allclose(weights, [0.3, 0.6, 0.1], atol=0.05)
    assert error > 0


def test_nobody_left_out_says_nothing():
    counts = TransitionCounts.from_pairs([], [], ROW)
    none = np.zeros(0, np.int64)
    weights, strength, error = weighed(leave_out(counts, Kinds(ROW, none, none), none, none))
    assert weights.sum() == pytest.approx(1.0)
    assert (strength, error) == (1.0, 0.0)
    assert weighed(leave_out(counts, Kinds(ROW, none, none), none, none), 7.0)[1] == 7.0


def test_numbers_of_elites_hardly_matter():
    rng = np.random.default_rng(2)
    elite = rng.integers(300, size=6000)
    niches = GridNiches((10, 10), ((0.0, 1.0),) * 2)
    child = rng.choice(101, size=6000, p=rng.dirichlet(np.full(101, 0.3)))
    fits = [
        fit_prior(TransitionCounts.from_births(elite % 101, child, niches, elite=numbers))
        for numbers in (elite, 1000 - elite)
    ]
    np.testing.assert_allclose(fits[0].weights, fits[1].weights, atol=0.05)
