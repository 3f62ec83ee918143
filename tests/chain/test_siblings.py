"""Likeness of siblings, and what it does to strength and posterior."""

import itertools

import numpy as np
import pytest
from scipy import sparse

from nichechain.chain.counts import TransitionCounts
from nichechain.chain.estimators import estimate
from nichechain.chain.prior import fit_prior
from nichechain.chain.siblings import design_effect, sibling_correlation
from nichechain.niches import GridNiches

ROW = GridNiches((4,), ((0.0, 4.0),))


def _dense(chain):
    return chain.T.toarray() if sparse.issparse(chain.T) else np.asarray(chain.T)


def _families(concentration, elites, children, seed):
    """Births of elites whose own rows are Dirichlet(K T_i) around their niche's."""
    rng = np.random.default_rng(seed)
    niches = GridNiches((20,), ((0.0, 1.0),))
    truth = rng.dirichlet(np.full(21, 0.3), 21)
    parent = np.repeat(np.arange(21), elites)
    rows = [rng.dirichlet(concentration * truth[i] + 1e-9) for i in parent]
    child = np.array([rng.choice(21, size=children, p=row / row.sum()) for row in rows])
    elite = np.repeat(np.arange(parent.size), children)
    return TransitionCounts.from_births(np.repeat(parent, children), child.ravel(), niches, elite=elite)


@pytest.mark.parametrize("concentration", [1.0, 4.0, 20.0])
def test_siblings_are_as_alike_as_they_were_made(concentration):
    # Two draws from Dirichlet(K p) agree with probability (1 + K Σ p²) / (1 + K): beyond the Σ p² of
    # strangers, that is 1 / (1 + K) of what it could be.
    counts = _families(concentration, elites=60, children=12, seed=2)
    rho = sibling_correlation(counts)
    assert rho == pytest.approx(1 / (1 + concentration), abs=0.03)
    np.testing.assert_allclose(design_effect(counts), 1 + 11 * rho)


def test_births_of_their_own_are_worth_one_each():
    counts = _families(2.0, elites=300, children=1, seed=3)
    assert sibling_correlation(counts) == 0.0
    np.testing.assert_array_equal(design_effect(counts), 1.0)
    unsaid = TransitionCounts.from_pairs([0, 0, 1], [1, 2, 2], ROW)
    np.testing.assert_array_equal(design_effect(unsaid), 1.0)


def test_correlation_by_listing_every_pair():
    rng = np.random.default_rng(7)
    parent = rng.integers(4, size=60)
    elite = 10 * parent + rng.integers(3, size=60)
    child = (elite + rng.integers(2, size=60)) % 4
    counts = TransitionCounts.from_births(parent, child, ROW, elite=elite)
    pairs, siblings, cousins = np.zeros(4), np.zeros((4, 2)), np.zeros((4, 2))
    for a, b in itertools.permutations(range(60), 2):
        if parent[a] == parent[b]:
            kind = siblings if elite[a] == elite[b] else cousins
            kind[parent[a]] += (1, child[a] == child[b])
    pairs = siblings[:, 0]
    of_siblings = siblings[:, 1].sum() / pairs.sum()
    of_cousins = (pairs * cousins[:, 1] / cousins[:, 0]).sum() / pairs.sum()
    expected = (of_siblings - of_cousins) / (1 - of_cousins)
    assert expected > 0
    assert sibling_correlation(counts) == pytest.approx(expected)


def test_merged_runs_keep_their_elites_apart():
    one = TransitionCounts.from_births([0, 0, 1], [1, 1, 2], ROW, elite=[0, 0, 1])
    pooled = one + one
    assert pooled.families[:, 3].tolist() == [2, 1, 2, 1]
    assert np.unique(pooled.families[:, 1]).size == 4
    assert (pooled.matrix.toarray() == 2 * one.matrix.toarray()).all()


def test_likeness_of_siblings_is_not_taken_for_a_difference_between_niches():
    # All niches alike, elites not: each elite of a niche sends its eight children to one place.
    rng = np.random.default_rng(5)
    niches = GridNiches((20,), ((0.0, 1.0),))
    elite = np.repeat(np.arange(120), 8)
    child = np.repeat(rng.integers(20, size=120), 8)
    counts = TransitionCounts.from_births(elite % 20, child, niches, elite=elite)
    assert sibling_correlation(counts) == pytest.approx(1.0, abs=0.02)
    with_families = fit_prior(counts).strength
    without = fit_prior(TransitionCounts.from_pairs(elite % 20, child, niches)).strength
    assert with_families > 50 * without


def test_a_posterior_of_related_births_is_wider():
    counts = _families(1.0, elites=6, children=30, seed=8)
    unsaid = TransitionCounts(counts.matrix, counts.niches, counts.visits)
    related, independent = estimate(counts, strength=5.0), estimate(unsaid, strength=5.0)
    spread = [
        np.std([np.asarray(_sample(chain, k))[3, 3] for k in range(300)]) for chain in (related, independent)
    ]
    assert spread[0] > 1.5 * spread[1]


def _sample(chain, seed):
    drawn = chain.posterior.draw(np.random.default_rng(seed))
    return drawn.toarray() if sparse.issparse(drawn) else drawn


def test_a_niche_of_one_elite_says_nothing_of_how_alike_siblings_are():
    """Without cousins there is nothing to compare siblings with: the other rows decide alone."""
    rows = [(0, 1, 0), (0, 1, 1), (0, 2, 1), (0, 2, 1), (0, 3, 2), (0, 3, 2)]
    alone = [(1, 9, 3), (1, 9, 3), (1, 9, 2)]
    parent, elite, child = np.array(rows).T
    expected = sibling_correlation(TransitionCounts.from_births(parent, child, ROW, elite=elite))
    assert 0 < expected < 1
    parent, elite, child = np.array(rows + alone).T
    found = sibling_correlation(TransitionCounts.from_births(parent, child, ROW, elite=elite))
    assert found == expected


def test_children_that_all_land_in_one_niche_are_not_alike_for_being_siblings():
    """Cousins are as alike as can be, so that siblings cannot be more so."""
    parent, elite = np.zeros(6, int), np.repeat([1, 2, 3], 2)
    counts = TransitionCounts.from_births(parent, np.ones(6, int), ROW, elite=elite)
    assert sibling_correlation(counts) == 0.0
    np.testing.assert_array_equal(design_effect(counts), 1.0)
