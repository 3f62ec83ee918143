"""l-evolvability of niches, distributions and genotypes: goldens, enumeration, Monte Carlo, bad input."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from nichechain import (
    GridNiches,
    NicheChain,
    NichechainError,
    TransitionCounts,
    estimate,
    genotype_evolvability,
    l_evolvability,
    niche_evolvability,
)
from nichechain.domains.base import Evaluation

T = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]])

# Worked out by hand for niche 0 of T: convention, l, U, niches.
GOLDENS = [
    ("definition", 1, 1, 1.0),
    ("definition", 1, 2, 1.5),
    ("definition", 1, 10, 1.998046875),
    ("definition", 2, 1, 1.5),
    ("definition", 2, 2, 2.125),
    ("definition", 2, 10, 2.942708969),
    ("procedure", 1, 1, 1.5),
    ("procedure", 1, 2, 1.75),
    ("procedure", 1, 10, 1.999023438),
    ("procedure", 2, 1, 2.0),
    ("procedure", 2, 2, 2.375),
    ("procedure", 2, 10, 2.943685532),
]


@pytest.mark.parametrize(("convention", "l", "lineages", "golden"), GOLDENS)
@pytest.mark.parametrize(
    "matrix", [T, sparse.csr_array(T), T.astype(np.float32)], ids=["dense", "sparse", "float32"]
)
def test_goldens(matrix, convention, l, lineages, golden):
    chain = NicheChain(matrix)
    options = {"l": l, "lineages": lineages, "convention": convention}
    result = l_evolvability(chain, niche=0, **options)
    # The goldens are written with ten digits.
    assert result.value == pytest.approx(golden, abs=1e-9)
    assert np.isnan([result.low, result.high]).all()
    assert result.standard_error == 0.0
    assert (result.l, result.lineages, result.convention) == (l, lineages, convention)
    assert (result.method, result.estimator, result.births) == ("exact", "given", None)
    assert niche_evolvability(chain, **options).value[0] == pytest.approx(golden, abs=1e-9)
    assert chain.niche_evolvability(**options)[0] == pytest.approx(golden, abs=1e-9)


@pytest.mark.parametrize(("convention", "l", "lineages", "golden"), GOLDENS)
def test_goldens_by_monte_carlo(convention, l, lineages, golden):
    chain = NicheChain(T)
    options = {
        "l": l,
        "lineages": lineages,
        "convention": convention,
        "method": "monte-carlo",
        "repeats": 4000,
    }
    result = l_evolvability(chain, niche=0, seed=1, **options)
    assert abs(result.value - golden) <= 4 * result.standard_error + 1e-12
    # A number of niches between 1 and 3 has a standard deviation of at most 1.
    assert result.standard_error <= 1 / math.sqrt(4000)
    assert result.method == "monte-carlo"
    every = niche_evolvability(chain, seed=2, **options)
    exact = niche_evolvability(chain, l=l, lineages=lineages, convention=convention).value
    # An event too rare to be seen in 4,000 repeats leaves no spread, but an error of this order.
    assert (np.abs(every.value - exact) <= 4 * np.maximum(every.standard_error, 1 / 4000)).all()


def _union_sizes(start, transition, transitions, lineages, counted):
    """E[niches in the union over lineages], every path of every lineage being enumerated.

    ``start`` holds (probability, state, whether it counts as visited) of a lineage's first state.
    """
    sets = Counter()
    states = range(len(transition))
    for probability, state, visited in start:
        for path in itertools.product(states, repeat=transitions):
            p = probability
            for i, j in itertools.pairwise((state, *path)):
                p *= transition[i, j]
            sets[frozenset((state, *path) if visited else path)] += p
    niches = frozenset(range(counted))
    possible = [(visited & niches, p) for visited, p in sets.items() if p]
    return sum(
        math.prod(p for _, p in chosen) * len(frozenset().union(*(visited for visited, _ in chosen)))
        for chosen in itertools.product(possible, repeat=lineages)
    )


@pytest.mark.parametrize("outside", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_equals_enumeration_of_all_paths(n, outside):
    rng = np.random.default_rng(100 * n + outside)
    states = n + outside
    transition = rng.dirichlet(np.full(states, 0.6), states)
    chain = NicheChain(transition, outside=n if outside else None)
    given_d = rng.dirichlet(np.ones(states))
    for l, lineages in itertools.product((1, 2, 3), (1, 2)):
        options = {"l": l, "lineages": lineages}
        standing, drawn = [(1.0, 0, False)], [(p, j, True) for j, p in enumerate(given_d)]
        # The root stands in niche 0; l transitions; itself counted only by the procedure.
        expected = _union_sizes(standing, transition, l, lineages, n)
        assert l_evolvability(chain, niche=0, **options).value == pytest.approx(expected, rel=1e-12)
        expected = _union_sizes([(1.0, 0, True)], transition, l, lineages, n)
        value = l_evolvability(chain, niche=0, convention="procedure", **options).value
        assert value == pytest.approx(expected, rel=1e-12)
        # D is generation 1; l − 1 transitions follow it, l by the procedure.
        expected = _union_sizes(drawn, transition, l - 1, lineages, n)
        assert l_evolvability(chain, offspring=given_d, **options).value == pytest.approx(expected, rel=1e-12)
        expected = _union_sizes(drawn, transition, l, lineages, n)
        value = l_evolvability(chain, offspring=given_d, convention="procedure", **options).value
        assert value == pytest.approx(expected, rel=1e-12)


def test_three_lineages_equal_enumeration():
    rng = np.random.default_rng(77)
    transition = rng.dirichlet(np.full(4, 0.5), 4)
    chain = NicheChain(transition, outside=3)
    expected = _union_sizes([(1.0, 1, False)], transition, 2, 3, 3)
    assert l_evolvability(chain, niche=1, l=2, lineages=3).value == pytest.approx(expected, rel=1e-12)


def test_the_papers_two_genotypes_with_equal_children():
    # A's children fall in niches 1 and 2, B's in 3 and 4. A's children only ever have children
    # where they are themselves; each child of B has some in two more niches.
    chain = np.eye(9)
    chain[3] = chain[4] = 0.0
    chain[3, [5, 6]] = chain[4, [7, 8]] = 0.5
    chain = NicheChain(chain)
    a, b = np.zeros(9), np.zeros(9)
    a[[1, 2]] = b[[3, 4]] = 0.5
    for lineages in (1, 2, 10, 100):
        children = [l_evolvability(chain, offspring=d, l=1, lineages=lineages).value for d in (a, b)]
        assert children[0] == pytest.approx(children[1], rel=1e-12)
        grandchildren = [l_evolvability(chain, offspring=d, l=2, lineages=lineages).value for d in (a, b)]
        assert grandchildren[0] == pytest.approx(2 * (1 - 0.5**lineages), rel=1e-12)
        assert grandchildren[1] == pytest.approx(
            2 * (1 - 0.5**lineages) + 4 * (1 - 0.75**lineages), rel=1e-12
        )


@given(seed=st.integers(0, 2**20), n=st.integers(1, 6), l=st.integers(1, 5), lineages=st.integers(1, 30))
@settings(deadline=None, max_examples=40)
def test_laws(seed, n, l, lineages):
    rng = np.random.default_rng(seed)
    transition = rng.dirichlet(np.full(n + 1, 0.4), n + 1)
    chain = NicheChain(transition, outside=n)
    options = {"l": l, "lineages": lineages}
    every = niche_evolvability(chain, **options).value
    assert every.shape == (n,)
    assert (every <= min(n, l * lineages) + 1e-12).all()
    one = [l_evolvability(chain, niche=i, **options).value for i in range(n)]
    np.testing.assert_allclose(every, one, rtol=1e-12)
    # A root in niche i is one whose offspring are distributed as row i of T.
    by_row = [l_evolvability(chain, offspring=transition[i], **options).value for i in range(n)]
    np.testing.assert_allclose(every, by_row, rtol=1e-12)
    # Counting the root's own state is a one-hot D, one transition longer.
    hot = [
        l_evolvability(chain, offspring=np.eye(n + 1)[i], l=l + 1, lineages=lineages).value for i in range(n)
    ]
    procedure = niche_evolvability(chain, convention="procedure", **options).value
    np.testing.assert_allclose(procedure, hot, rtol=1e-12)
    assert (procedure >= every - 1e-12).all()
    as_sparse = NicheChain(sparse.csr_array(transition), outside=n)
    np.testing.assert_allclose(niche_evolvability(as_sparse, **options).value, every, rtol=1e-12)


def test_a_distribution_over_niches_alone_leaves_nothing_outside():
    rng = np.random.default_rng(4)
    chain = NicheChain(rng.dirichlet(np.ones(4), 4), outside=3)
    short = l_evolvability(chain, offspring=[0.2, 0.8, 0.0], l=3, lineages=10)
    full = l_evolvability(chain, offspring=[0.2, 0.8, 0.0, 0.0], l=3, lineages=10)
    # Without an interval, whose NaN equals nothing.
    assert replace(short, low=0.0, high=0.0) == replace(full, low=0.0, high=0.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"l": 0}, "l is 0, but must be at least 1"),
        ({"l": -2}, "l is -2"),
        ({"l": 1.5}, "l is 1.5"),
        ({"lineages": 0}, "lineages is 0, but must be at least 1"),
        ({"lineages": -1}, "lineages is -1"),
        ({"lineages": 2.5}, "lineages is 2.5"),
        ({"method": "exactly"}, "method is 'exactly', but must be one of auto, exact, monte-carlo"),
        ({"convention": "literal"}, "convention is 'literal', but must be one of definition, procedure"),
        ({"repeats": 0}, "repeats is 0"),
        ({"draws": 0}, "draws is 0"),
    ],
)
def test_bad_arguments(arguments, message):
    chain = NicheChain(T)
    with pytest.raises(NichechainError, match=message):
        l_evolvability(chain, niche=0, **arguments)
    with pytest.raises(NichechainError, match=message):
        niche_evolvability(chain, **arguments)


@pytest.mark.parametrize(
    ("root", "message"),
    [
        ({}, "either a niche or the distribution"),
        ({"niche": 0, "offspring": [1, 0, 0]}, "either a niche or the distribution"),
        ({"niche": 3}, "niche is 3, but this chain has niches 0 to 2"),
        ({"niche": -1}, "niche is -1"),
        ({"niche": (0, 1)}, "no grid"),
        ({"offspring": [0.5, 0.5]}, r"shape \(2,\), but must be \(3,\)"),
        ({"offspring": [[0.5, 0.5, 0]]}, r"shape \(1, 3\)"),
        ({"offspring": [0.5, 0.4, 0]}, "sums to 0.9"),
        ({"offspring": [1.5, -0.5, 0]}, "not negative"),
        ({"offspring": [np.nan, 0.5, 0.5]}, "offspring"),
        ({"offspring": [3, 4, 5]}, "sums to 12"),
    ],
)
def test_bad_roots(root, message):
    with pytest.raises(NichechainError, match=message):
        l_evolvability(NicheChain(T), **root)


def test_saturation_is_said():
    chain = NicheChain(T)
    # From niche 0, one lineage of l = 1 sees 1 of the 2 niches there are to see, fifty see both.
    assert not l_evolvability(chain, niche=0, l=1, lineages=1).saturated
    assert l_evolvability(chain, niche=0, l=1, lineages=50).saturated
    wide = NicheChain(np.full((50, 50), 0.02))
    assert not niche_evolvability(wide, l=2, lineages=10).saturated
    assert niche_evolvability(wide, l=2, lineages=200).saturated


GRID = GridNiches((3, 3), ((0.0, 3.0), (0.0, 3.0)))


def _simulated_counts(births, seed=0, niches=GRID):
    rng = np.random.default_rng(seed)
    truth = rng.dirichlet(np.full(niches.states, 0.5), niches.states)
    parent = rng.integers(niches.states, size=births)
    child = np.array([rng.choice(niches.states, p=truth[i]) for i in parent])
    return TransitionCounts.from_pairs(parent, child, niches), truth


def test_an_estimated_chain_is_averaged_over_draws():
    from nichechain.core.randomness import Purpose, keyed

    counts, _ = _simulated_counts(60)
    chain = estimate(counts, strength=4.0)
    result = niche_evolvability(chain, l=3, lineages=20, draws=40, seed=5)
    drawn = []
    for number in range(40):
        matrix = chain.posterior.draw(keyed(5, Purpose.POSTERIOR, number)).toarray()
        drawn.append(niche_evolvability(NicheChain(matrix, outside=9), l=3, lineages=20).value)
    np.testing.assert_allclose(result.value, np.mean(drawn, axis=0), rtol=1e-9)
    np.testing.assert_allclose(
        result.standard_error, np.std(drawn, axis=0, ddof=1) / math.sqrt(40), rtol=1e-9
    )
    np.testing.assert_allclose(result.low, np.quantile(drawn, 0.05, axis=0, method="weibull"), rtol=1e-9)
    np.testing.assert_allclose(result.high, np.quantile(drawn, 0.95, axis=0, method="weibull"), rtol=1e-9)
    np.testing.assert_array_equal(result.births, counts.births[:9])
    for i in (0, 4):
        one = l_evolvability(chain, niche=GRID.index(i), l=3, lineages=20, draws=40, seed=5)
        assert one.value == pytest.approx(result.value[i], rel=1e-12)
        assert one.births == counts.births[i]


def test_plugging_in_the_posterior_mean_overstates():
    # Coverage is concave in a row of T, so its mean over draws lies below its value at their mean
    # (at l = 1, where it depends on one row only).
    counts, _ = _simulated_counts(60)
    chain = estimate(counts, strength=4.0)
    averaged = niche_evolvability(chain, l=1, lineages=30, draws=100)
    plugged_in = niche_evolvability(NicheChain(chain.T, outside=9), l=1, lineages=30).value
    assert (averaged.value + 4 * averaged.standard_error < plugged_in).all()


def test_monte_carlo_on_an_estimated_chain_agrees_with_exact():
    counts, _ = _simulated_counts(200)
    chain = estimate(counts, strength=4.0)
    options = {"niche": 4, "l": 3, "lineages": 10, "draws": 60, "seed": 3}
    exact = l_evolvability(chain, **options)
    sampled = l_evolvability(chain, method="monte-carlo", repeats=6000, **options)
    # The same draws of T: what differs is the simulations' own error, at most 3 niches / √6000 or so.
    assert abs(sampled.value - exact.value) <= 4 * 3 / math.sqrt(6000)
    assert sampled.low < sampled.value < sampled.high


def test_births_narrow_the_interval():
    widths = []
    for births in (50, 1000, 20_000):
        counts, _ = _simulated_counts(births)
        result = niche_evolvability(estimate(counts), l=3, lineages=10)
        widths.append(float(np.mean(result.high - result.low)))
    # 20 times the births, once they outweigh the prior, make it √20 = 4.5 times as narrow.
    assert widths[0] > widths[1] > 3 * widths[2]


def test_many_births_lead_to_the_truth():
    counts, truth = _simulated_counts(40_000)
    exact = niche_evolvability(NicheChain(truth, outside=9), l=3, lineages=10).value
    for estimator in ("dirichlet", "mle"):
        value = niche_evolvability(estimate(counts, estimator), l=3, lineages=10).value
        # 4,000 births per row leave about 1/√4000 of a share open.
        np.testing.assert_allclose(value, exact, rtol=0.02)


def test_results_are_functions_of_the_seed():
    counts, _ = _simulated_counts(60)
    chain = estimate(counts)
    for options in ({}, {"method": "monte-carlo", "repeats": 60}):
        values = [
            l_evolvability(chain, niche=4, l=2, lineages=3, seed=seed, draws=20, **options).value
            for seed in (1, 1, 2)
        ]
        assert values[0] == values[1] != values[2]


def test_the_frame_and_the_ranking():
    parent = [0] * 25 + [4] * 20 + [5] * 19 + [8] * 30
    child = [0] * 25 + [3, 4] * 10 + [0, 1, 2, 3, 4, 5, 6, 7, 8] * 2 + [9] + [1, 2, 8] * 10
    chain = estimate(TransitionCounts.from_pairs(parent, child, GRID), "mle")
    result = niche_evolvability(chain, l=1, lineages=1000)
    frame = result.to_frame(chain)
    assert frame["niche"].tolist() == list(range(9))
    assert frame["index"].tolist() == ["0,0", "0,1", "0,2", "1,0", "1,1", "1,2", "2,0", "2,1", "2,2"]
    assert frame["births"].tolist() == [25, 0, 0, 0, 20, 19, 0, 0, 30]
    np.testing.assert_allclose(frame["value"], [1, 1, 1, 1, 2, 9, 1, 1, 3], rtol=1e-9)
    # Niche 5 sees the most, but has 19 births; 20 are enough.
    assert result.ranking(chain)["niche"].tolist() == [8, 4, 0]
    assert result.ranking(chain, min_births=19)["niche"].tolist() == [5, 8, 4, 0]
    assert len(result.ranking(chain, min_births=0)) == 9


def test_a_given_chain_is_ranked_whole():
    result = niche_evolvability(NicheChain(T), l=1, lineages=10)
    assert result.births is None
    assert result.ranking(NicheChain(T))["niche"].tolist() == [0, 1, 2]


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
    counts, _ = _simulated_counts(100)
    return estimate(counts, strength=4.0)


def fresh(archive, elite, **options):
    """The paper's letter: only offspring evaluated now say where lineages begin."""
    return genotype_evolvability(archive, elite, **({"offspring": 30, "record": False} | options))


def _landed(archive, elite, offspring, seed):
    from nichechain.core.randomness import Purpose, keyed

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
    niches = GridNiches((3, 3), ((0.0, 3.0), (0.0, 3.0)))
    rng = np.random.default_rng(8)
    # Three elites of each niche whose children keep to two niches each: what the row says is worth little.
    elite = np.repeat(np.arange(27), 20)
    child = rng.integers(9, size=(27, 2))[elite, rng.integers(2, size=elite.size)]
    chain = estimate(TransitionCounts.from_births(elite // 3, child, niches, elite=elite))
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


def test_what_could_take_over_ten_minutes_is_said_before(monkeypatch):
    from nichechain.evolvability import question

    chain = NicheChain(np.full((3, 3), 1 / 3))
    monkeypatch.setattr(question, "_LONG", 1e-9)
    with pytest.warns(UserWarning, match=r"could take \d+ minutes: fewer roots"):
        l_evolvability(chain, niche=0)
    with pytest.warns(UserWarning, match="could take"):
        niche_evolvability(chain, method="monte-carlo", repeats=2)


def test_one_root_of_many_sparse_states_has_the_closed_form():
    from nichechain.evolvability import expected_coverage

    # A ring of 1,200 states, with steps of 1, 2 and 7 and some stays.
    states = np.arange(1200)
    steps, share = (0, 1, 2, 7), (0.1, 0.4, 0.3, 0.2)
    columns = np.stack([(states + step) % 1200 for step in steps], axis=1)
    entries = np.tile(share, 1200), (np.repeat(states, 4), columns.ravel())
    T = sparse.csr_array(entries, shape=(1200, 1200))
    found = l_evolvability(NicheChain(T), niche=5, l=6, lineages=20).value
    assert found == pytest.approx(expected_coverage(T, T[[5]], 6, 20)[0], rel=1e-12)


@pytest.mark.parametrize("l", range(1, 13))
def test_one_root_of_a_whole_matrix_has_the_closed_form(l):
    from nichechain.evolvability import expected_coverage

    T = np.random.default_rng(l).dirichlet(np.full(30, 0.2), 30)
    found = l_evolvability(NicheChain(T), niche=5, l=l, lineages=20).value
    assert found == pytest.approx(expected_coverage(T, T[[5]], l, 20)[0], rel=1e-12)


def test_rows_of_elites_do_not_depend_on_who_else_is_asked_for():
    from nichechain.evolvability.question import DrawnChain

    rows = np.random.default_rng(0).dirichlet(np.full(40, 0.5), 40)
    drawn = DrawnChain(rows, rows, 9.0, seed=3, number=2)
    some = np.array([39, 3, 17, 16])
    whole = drawn.children(np.arange(40))
    np.testing.assert_array_equal(drawn.children(some), whole[some])
    np.testing.assert_allclose(whole.sum(axis=1), 1.0)
    assert np.abs(DrawnChain(rows, rows, 9.0, seed=3, number=1).children(some) - whole[some]).max() > 0.1
