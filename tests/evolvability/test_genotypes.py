"""l-evolvability of a genotype by offspring that are evaluated now."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from nichechain import (
    GridNiches,
    NicheChain,
    NichechainError,
    TransitionCounts,
    estimate,
    genotype_evolvability,
    l_evolvability,
)
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Evaluation

from .samples import GRID, simulated_counts


class _Plane:
    """A domain whose behavior is the first two weights, and which fails below zero."""

    def evaluate(self, genotypes):
        behavior = np.asarray(genotypes, float)[:, :2].copy()
        failed = (behavior < 0).any(axis=1)
        behavior[failed] = np.nan
        objective = np.where(failed, np.nan, 0.0)
        return Evaluation(behavior, objective, failed, tuple("below zero" if bad else "" for bad in failed))


def _plane(chain, noise=1.0):
    """An archive of that domain, as far as evolvability looks at it, and the elite of its middle niche."""

    def mutate(parent, rng):
        return (parent + noise * rng.normal(size=parent.size)).astype(np.float32)

    archive = SimpleNamespace(niches=GRID, domain=_Plane(), mutate=mutate, chain=lambda: chain)
    return archive, SimpleNamespace(genotype=np.array([1.5, 1.5], np.float32), state=4)


@pytest.fixture(scope="module")
def plane_chain():
    counts, _ = simulated_counts(100)
    return estimate(counts, strength=4.0)


def fresh(archive, elite, **options):
    """The paper's letter: only offspring evaluated now say where lineages begin."""
    return genotype_evolvability(archive, elite, **({"offspring": 30, "record": False} | options))


def _landed(archive, elite, offspring, seed):
    children = [archive.mutate(elite.genotype, keyed(seed, Purpose.OFFSPRING, i)) for i in range(offspring)]
    children = np.array([child for child in children if (child >= 0).all()], float)
    return np.bincount(GRID.of(children), minlength=10)


def test_the_children_of_a_genotype_are_rarefied(plane_chain):
    archive, elite = _plane(plane_chain)
    counts = _landed(archive, elite, 30, seed=2)
    born = int(counts.sum())
    assert counts[9] > 0
    assert born < 30
    result = fresh(archive, elite, l=1, lineages=born, offspring=30, seed=2)
    # As many lineages as offspring: what was observed, outside and failures left out, exactly.
    assert result.value == np.count_nonzero(counts[:9])
    assert (result.method, result.offspring) == ("rarefaction", born)
    assert result.births == plane_chain.births[4]
    one = fresh(archive, elite, l=1, lineages=1, offspring=30, seed=2)
    assert one.value == pytest.approx(counts[:9].sum() / born, rel=1e-12)


def test_the_interval_of_a_rarefied_value_holds_it(plane_chain):
    archive, elite = _plane(plane_chain)
    for seed in range(5):
        result = fresh(archive, elite, l=1, lineages=15, offspring=30, seed=seed)
        assert result.low <= result.value <= result.high


def test_empirical_offspring_are_the_observed_shares_and_warn_of_what_they_miss(plane_chain):
    archive, elite = _plane(plane_chain)
    counts = _landed(archive, elite, 12, seed=0)
    born = int(counts.sum())
    given_t = NicheChain(plane_chain.T, niches=GRID, outside=9)
    options = {"offspring": 12, "first_generation": "empirical", "chain": given_t, "seed": 0}
    with pytest.warns(UserWarning, match=f"100 lineages begin at the niches of {born} offspring"):
        result = fresh(archive, elite, l=2, lineages=100, **options)
    expected = l_evolvability(given_t, offspring=counts / born, l=2, lineages=100)
    assert result.value == pytest.approx(expected.value, rel=1e-12)
    few = fresh(archive, elite, l=2, lineages=born, **options)
    assert few.value < result.value


def _scattered():
    """A genotype whose children fall anywhere on a grid of 144 niches, as all children do there."""
    niches = GridNiches((12, 12), ((0.0, 3.0), (0.0, 3.0)))
    rng = np.random.default_rng(12)
    counts = TransitionCounts.from_pairs(*rng.integers(144, size=(2, 12_000)), niches)

    def anywhere(parent, rng):
        return rng.uniform(0, 3, parent.size).astype(np.float32)

    archive = SimpleNamespace(niches=niches, domain=_Plane(), mutate=anywhere, chain=lambda: estimate(counts))
    return archive, SimpleNamespace(genotype=np.ones(2, np.float32), state=0)


def test_a_posterior_of_the_offspring_is_nearer_to_the_truth_than_their_shares():
    archive, elite = _scattered()
    exact = 144 * (1 - (1 - 1 / 144) ** 100)
    options = {"l": 1, "lineages": 100, "offspring": 30, "draws": 20, "seed": 1}
    with pytest.warns(UserWarning, match="miss those that none of them happened to hit"):
        empirical = fresh(archive, elite, first_generation="empirical", **options).value
    posterior = fresh(archive, elite, **options).value
    assert empirical <= 30
    assert posterior == pytest.approx(exact, rel=0.2)


def test_by_default_the_row_is_worth_what_siblings_make_likely():
    rng = np.random.default_rng(8)
    # Three elites of each niche whose children keep to two niches each: what the row says is worth little.
    elite = np.repeat(np.arange(27), 20)
    child = rng.integers(9, size=(27, 2))[elite, rng.integers(2, size=elite.size)]
    chain = estimate(TransitionCounts.from_births(elite // 3, child, GRID, elite=elite))
    archive, root = _plane(chain)
    options = {"l": 2, "lineages": 20, "offspring": 10, "draws": 10, "chain": chain}
    found = fresh(archive, root, **options)
    concentration = chain.posterior.elite_concentration
    assert concentration < 5 < chain.posterior.strength
    assert found == fresh(archive, root, strength=concentration, **options)


def test_offspring_leave_their_distribution_open_though_t_is_given(plane_chain):
    archive, elite = _plane(plane_chain)
    given_t = NicheChain(plane_chain.T, niches=GRID, outside=9)
    for method in ("exact", "monte-carlo"):
        options = {
            "l": 2,
            "lineages": 10,
            "offspring": 10,
            "chain": given_t,
            "method": method,
            "repeats": 200,
        }
        result = fresh(archive, elite, draws=30, **options)
        assert result.low < result.value < result.high
        assert result.standard_error > 0


def test_a_genotype_by_monte_carlo_agrees_with_exact(plane_chain):
    archive, elite = _plane(plane_chain)
    options = {"l": 3, "lineages": 10, "draws": 50, "seed": 6}
    exact = fresh(archive, elite, **options)
    sampled = fresh(archive, elite, method="monte-carlo", repeats=5000, **options)
    assert abs(sampled.value - exact.value) <= 4 * 3 / math.sqrt(5000)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"offspring": 0}, "offspring is 0"),
        ({"l": 0}, "l is 0"),
        ({"lineages": 0}, "lineages is 0"),
        (
            {"first_generation": "guess"},
            "first_generation is 'guess', but must be one of posterior, empirical",
        ),
        ({"method": "fast"}, "method is 'fast'"),
    ],
)
def test_bad_arguments_of_a_genotype(plane_chain, arguments, message):
    archive, elite = _plane(plane_chain)
    with pytest.raises(NichechainError, match=message):
        fresh(archive, elite, **arguments)


def test_offspring_that_all_fail_are_said(plane_chain):
    archive, elite = _plane(plane_chain, noise=0.001)
    elite.genotype = np.array([-5.0, 1.0], np.float32)
    with pytest.raises(NichechainError, match="all 30 offspring failed, the first with: below zero"):
        fresh(archive, elite)
