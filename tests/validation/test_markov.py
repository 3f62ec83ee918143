import itertools

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import nichechain as nc
from nichechain.core.errors import NichechainError
from nichechain.validation import (
    Triples,
    births_test,
    homogeneity_test,
    lineage_test,
    sibling_test,
    simulate_births,
)

from .conftest import local_chain, scattered_chain

TESTS = {
    "lineage": lineage_test,
    "homogeneity": homogeneity_test,
    "siblings": sibling_test,
    "chapman-kolmogorov": births_test,
}


def simulated(chain, births, seed, **options):
    return Triples.from_births(simulate_births(chain, births, np.random.default_rng(seed), **options))


def families(*members):
    """Triples from (grandparent, parent, depth, children) of each parent."""
    elite = np.repeat(np.arange(len(members)), [len(member[3]) for member in members])
    child = np.concatenate([member[3] for member in members])
    grandparent, niche, depth = (np.array([member[k] for member in members]) for k in range(3))
    return Triples(elite, child, niche, grandparent, depth, np.arange(len(members)))


def table(triples, rows, parents):
    """Counts of label × child over some parents."""
    kept = parents[triples.elite]
    return pd.crosstab(rows[triples.elite][kept], triples.child[kept]).to_numpy()


@pytest.fixture(scope="module")
def triples():
    return simulated(local_chain(8), 2000, 4)


def test_g2_is_that_of_scipy_summed_over_niches_and_depths(triples):
    known = triples.with_grandparent
    deep = np.searchsorted(np.quantile(known.depth, [0.5]), known.depth)
    expected = 0.0
    for niche, half in itertools.product(range(8), range(2)):
        here = (known.niche == niche) & (deep == half)
        labels = np.unique(known.grandparent[here])
        counts = table(known, known.grandparent, here) if here.any() else np.zeros((1, 1))
        if 1 < labels.size < here.sum() and min(counts.shape) > 1:
            expected += stats.chi2_contingency(counts, correction=False, lambda_="log-likelihood").statistic
    assert expected > 0
    found = lineage_test(triples, depth_bins=2, permutations=1)
    assert found.statistic == pytest.approx(expected)


def test_homogeneity_is_pearsons_of_early_and_late_halves(triples):
    expected = 0.0
    for niche in range(8):
        here = triples.niche == niche
        order = np.flatnonzero(here)[np.argsort(triples.step[here], kind="stable")]
        late = np.zeros(here.size, int)
        late[order[(order.size + 1) // 2 :]] = 1
        counts = table(triples, late, here)
        if order.size > 2 and min(counts.shape) > 1:
            expected += stats.chi2_contingency(counts, correction=False).statistic
    found = homogeneity_test(triples, permutations=1)
    assert found.statistic == pytest.approx(expected)


def test_siblings_are_compared_within_niches(triples):
    parents = np.arange(triples.niche.size)
    expected = 0.0
    for niche in range(8):
        counts = table(triples, parents, triples.niche == niche)
        if min(counts.shape) > 1:
            expected += stats.chi2_contingency(counts, correction=False).statistic
    found = sibling_test(triples, permutations=300)
    assert found.statistic == pytest.approx(expected)
    # With all margins fixed, the mean of X² is (r − 1)(c − 1)·N / (N − 1) exactly.
    mean = 0.0
    for niche in range(8):
        counts = table(triples, parents, triples.niche == niche)
        total = counts.sum()
        mean += (counts.shape[0] - 1) * (counts.shape[1] - 1) * total / (total - 1)
    assert found.expected == pytest.approx(mean, rel=0.02)


def test_p_is_the_share_of_all_relabellings():
    # Five parents in one niche: of the 10 ways to give two of them grandparent 1, one is as extreme.
    same, other = [2] * 4, [3] * 4
    triples = families((1, 0, 1, same), (1, 0, 1, same), (4, 0, 1, other), (4, 0, 1, other), (4, 0, 1, other))
    found = lineage_test(triples, permutations=4000)
    assert found.p_value == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / 4000))
    assert (found.niches, found.births, found.all_births) == (1, 20, 20)


@pytest.mark.parametrize(
    "members",
    [
        # One grandparent; each its own; one state of all children; parents of different depth.
        [(1, 0, 1, [2, 3]), (1, 0, 1, [2, 2])],
        [(1, 0, 1, [2, 3]), (4, 0, 1, [2, 2]), (5, 0, 1, [2, 2])],
        [(1, 0, 1, [2, 2]), (1, 0, 1, [2, 2]), (4, 0, 1, [2])],
        [(1, 0, 1, [2, 3]), (4, 0, 1, [2]), (1, 0, 9, [2, 2]), (5, 0, 9, [3])],
    ],
)
def test_what_cannot_be_permuted_is_said(members):
    found = lineage_test(families(*members), depth_bins=2, permutations=9)
    assert (found.niches, found.births, found.p_value) == (0, 0, 1.0)
    assert found.all_births == sum(len(member[3]) for member in members)
    assert np.isnan(found.ratio)


def test_births_without_lineages_say_nothing():
    empty = Triples.from_births(simulate_births(local_chain(), 1, np.random.default_rng(0)))
    for test in TESTS.values():
        assert test(empty, permutations=3).p_value == 1.0


def test_results_are_functions_of_the_seed(triples):
    for test in TESTS.values():
        assert test(triples, permutations=19, seed=3) == test(triples, permutations=19, seed=3)
        assert (
            test(triples, permutations=19, seed=3).expected != test(triples, permutations=19, seed=4).expected
        )


def p_values(chains, births, permutations, replacement="random"):
    """p of every test on births simulated from each chain."""
    found = {name: [] for name in TESTS}
    for seed, chain in enumerate(chains):
        triples = simulated(chain, births, seed, batch=32, replacement=replacement)
        for name, test in TESTS.items():
            found[name].append(test(triples, permutations=permutations, seed=seed).p_value)
    return {name: np.array(values) for name, values in found.items()}


def check_rate(p, level, name):
    """No more rejections than chance allows, nor p-values that are small in general.

    They may be large: what can be permuted in few ways only often gives the same table again.
    """
    assert np.count_nonzero(p <= level) <= stats.binom.ppf(0.999, p.size, level), name
    assert p.mean() > 0.5 - 4 * np.sqrt(1 / 12 / p.size), name


@pytest.mark.parametrize("kind", ["local", "scattered"])
def test_a_true_chain_passes_at_the_nominal_rate(kind):
    rng = np.random.default_rng(11)
    chains = [local_chain(10) if kind == "local" else scattered_chain(rng, 10) for _ in range(60)]
    for name, p in p_values(chains, 700, 39).items():
        check_rate(p, 0.1, name)


@pytest.mark.parametrize("replacement", ["first", "newest", "objective"])
def test_a_true_chain_passes_whoever_is_an_elite(replacement):
    for name, p in p_values([local_chain(10)] * 40, 500, 19, replacement).items():
        check_rate(p, 0.1, name)


@pytest.mark.slow
@pytest.mark.parametrize("replacement", ["random", "first", "newest", "objective"])
def test_rates_under_each_rule_of_replacement_in_many_simulations(replacement):
    rng = np.random.default_rng(13)
    chains = [local_chain(20) if k % 2 else scattered_chain(rng, 20) for k in range(400)]
    for name, p in p_values(chains, 2000, 99, replacement).items():
        found = np.count_nonzero(p <= 0.05)
        low, high = stats.binomtest(int(found), p.size).proportion_ci()
        print(f"{replacement:10} {name:20} {found / p.size:.3f} ({low:.3f} to {high:.3f})")
        check_rate(p, 0.05, name)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["local", "scattered", "sparse"])
def test_a_true_chain_passes_at_the_nominal_rate_in_many_simulations(kind):
    rng = np.random.default_rng(12)
    size = 150 if kind == "sparse" else 20
    chains = [local_chain(size) if kind == "local" else scattered_chain(rng, size) for _ in range(500)]
    for name, p in p_values(chains, 3000, 99).items():
        check_rate(p, 0.05, name)
        check_rate(p, 0.2, name)


def test_children_that_remember_their_grandparent_are_found():
    found = simulated(local_chain(), 6000, 1, memory=0.3)
    assert lineage_test(found, permutations=99).p_value == 0.01
    assert births_test(found, permutations=99).p_value == 0.01
    assert births_test(found, permutations=99).ratio > 1.5


def test_a_law_that_changes_is_found():
    first = simulate_births(local_chain(), 3000, np.random.default_rng(1))
    later = simulate_births(scattered_chain(np.random.default_rng(2)), 3000, np.random.default_rng(3))
    later["run"] += 1
    later["step"] += 1000
    changed = Triples.from_births(pd.concat([first, later], ignore_index=True))
    assert homogeneity_test(changed, permutations=99).p_value == 0.01


def test_parents_of_one_niche_that_breed_differently_are_found():
    # Niches are pairs of the states of a chain that nobody sees.
    chain = scattered_chain(np.random.default_rng(4), 16)
    births = simulate_births(chain, 4000, np.random.default_rng(5))
    births[["parent_niche", "child_niche"]] //= 2
    # More than one parent of a niche lives at a time here, which the tests do not mind.
    found = sibling_test(Triples.from_births(births), permutations=99)
    assert found.p_value == 0.01
    assert found.ratio > 2


def test_numbers_out_of_range(triples):
    for test in TESTS.values():
        with pytest.raises(NichechainError, match="permutations is 0"):
            test(triples, permutations=0)
    with pytest.raises(NichechainError, match="depth_bins is 0"):
        lineage_test(triples, depth_bins=0)


def test_forty_thousand_births_are_joined_and_tested():
    matrix = np.random.default_rng(0).dirichlet(np.full(240, 0.05), 240)
    triples = simulated(nc.NicheChain(matrix), 40_000, 0)
    assert len(triples) == 39_999
    assert births_test(triples, permutations=9).all_niches == 240


def test_each_permutation_is_told(triples):
    for name, test in TESTS.items():
        told = []
        assert test(triples, permutations=7, on_done=told.append) == test(triples, permutations=7), name
        assert told == [1] * 7
