"""Held-out comparison, against the same sums by hand."""

import numpy as np
import pytest

from nichechain import GridNiches, NichechainError, TransitionCounts
from nichechain.validation.held_out import compare_estimators, marginal_likelihood_fit

GRID = GridNiches((2, 2), ((0.0, 1.0), (0.0, 1.0)))
CLIP = GridNiches((6, 6), ((0.0, 1.0), (0.0, 1.0)), "clip")


def by_name(found):
    return {row.estimator: row for row in found.rows}


def related(likeness, seed, niches=CLIP, elites=110, children=40):
    """Children of elites that each have a niche of their own to which they drift."""
    rng = np.random.default_rng(seed)
    T = rng.dirichlet(20.0 * rng.dirichlet(np.ones(niches.states)), niches.states)
    home = rng.integers(niches.states, size=elites)
    taste = np.array([rng.choice(niches.states, p=T[i]) for i in home])
    parent = np.repeat(home, children)
    free = np.array([rng.choice(niches.states, p=T[i]) for i in parent])
    child = np.where(rng.random(parent.size) < likeness, np.repeat(taste, children), free)
    return TransitionCounts.from_births(parent, child, niches, elite=np.repeat(np.arange(elites), children))


def test_leaving_out_one_elite_at_a_time_by_hand():
    parent = [0, 0, 0, 0, 0, 1, 1, 2, 2, 4, 4]
    child = [1, 1, 2, 0, 1, 1, 3, 0, 0, 4, 4]
    elite = [7, 7, 7, 8, 8, 9, 9, 10, 10, 11, 12]
    counts = TransitionCounts.from_births(parent, child, GRID, elite=elite)
    found = by_name(compare_estimators(counts, folds=6))
    births = list(zip(parent, child, elite, strict=True))
    p = {
        "dirichlet, 1/n": [],
        "dirichlet, jeffreys": [],
        "mle, unvisited: uniform": [],
        "mle, unvisited: self": [],
    }
    for i, j, e in births:
        others = [b for a, b, other in births if a == i and other != e]
        hits, size = others.count(j), len(others)
        p["dirichlet, 1/n"].append((hits + 1 / 5) / (size + 1))
        p["dirichlet, jeffreys"].append((hits + 0.5) / (size + 2.5))
        p["mle, unvisited: uniform"].append(hits / size if size else 1 / 5)
        p["mle, unvisited: self"].append(hits / size if size else float(i == j))
    for name, values in p.items():
        row = found[name]
        some = np.array(values) > 0
        assert row.births == len(births)
        assert row.impossible == pytest.approx(1 - some.mean())
        assert row.log_likelihood == pytest.approx(np.log(np.array(values)[some]).mean())


def test_default_leads_and_rules_nothing_out():
    found = compare_estimators(related(0.3, 0))
    first = found.rows[0]
    assert (first.estimator, first.impossible, first.difference, first.standard_error) == (
        "empirical-bayes",
        0,
        0,
        0,
    )
    assert found.elites == 110
    assert all(0 <= row.impossible < 1 for row in found.rows)
    assert list(found.to_frame()["estimator"]) == [row.estimator for row in found.rows]
    # Without an outside state there is nowhere to be absorbed.
    assert "mle, unvisited: absorb" not in by_name(found)


def test_likeness_of_siblings_is_not_likeness_of_niches():
    """Where siblings are alike, counting them as independent costs log-likelihood; else it does not."""
    alike = by_name(compare_estimators(related(0.6, 1)))["the same, births unrelated"]
    assert alike.difference < -3 * alike.standard_error < 0
    free = by_name(compare_estimators(related(0.0, 1)))["the same, births unrelated"]
    assert abs(free.difference) < 0.02


def test_marginal_likelihood_finds_the_strength():
    rng = np.random.default_rng(3)
    niches = GridNiches((10, 10), ((0.0, 1.0), (0.0, 1.0)), "clip")
    base = rng.dirichlet(np.full(100, 2.0))
    parent = np.repeat(np.arange(100), 100)
    rows = rng.dirichlet(8.0 * base, 100)
    child = np.array([rng.choice(100, p=rows[i]) for i in parent])
    chain = marginal_likelihood_fit(TransitionCounts.from_pairs(parent, child, niches))
    assert chain.posterior.strength == pytest.approx(8.0, rel=0.2)
    assert chain.posterior.base.weights[0] > 0.8


def test_births_without_elites_are_held_out_one_by_one():
    counts = TransitionCounts.from_pairs([0, 0, 1, 1], [1, 2, 3, 3], GRID, [3, 1, 2, 2])
    found = compare_estimators(counts, folds=2)
    assert found.elites == 8
    assert found.rows[0].births == 8


def test_same_seed_same_folds():
    counts = related(0.3, 2, elites=30)
    frames = [compare_estimators(counts, folds=3, seed=seed).to_frame() for seed in (4, 4, 5)]
    assert frames[0].equals(frames[1])
    assert not frames[0].equals(frames[2])


@pytest.mark.parametrize(
    ("folds", "said"),
    [(1, "folds is 1, but must be at least 2"), (9, "folds is 9, but only 2 elites have children")],
)
def test_bad_folds(folds, said):
    counts = TransitionCounts.from_births([0, 0], [1, 1], GRID, elite=[0, 1])
    with pytest.raises(NichechainError, match=said):
        compare_estimators(counts, folds=folds)
