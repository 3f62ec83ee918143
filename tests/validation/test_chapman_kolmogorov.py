import itertools

import numpy as np
import pytest
from scipy import stats

from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError
from nichechain.validation import Triples, births_test, lineages_test, simulate_births, simulate_lineages
from nichechain.validation.chapman_kolmogorov import _recombined

from .conftest import local_chain, scattered_chain


def distance(walks, apart):
    """Squared distance of pairs from T^k with the observed T, written out."""
    n = walks.max() + 1
    step, pairs = np.zeros((n, n)), np.zeros((n, n))
    np.add.at(step, (walks[:, :-1].ravel(), walks[:, 1:].ravel()), 1)
    np.add.at(pairs, (walks[:, :-apart].ravel(), walks[:, apart:].ravel()), 1)
    shares = step / np.maximum(step.sum(axis=1, keepdims=True), 1)
    starts, ends = pairs.sum(axis=1), pairs.sum(axis=0)
    off = pairs - starts[:, None] * np.linalg.matrix_power(shares, apart)
    return sum(off[i, k] ** 2 / max(starts[i] * ends[k], 1) for i, k in itertools.product(range(n), repeat=2))


def test_lineages_statistic_written_out():
    walks = simulate_lineages(local_chain(5).T, np.arange(40) % 5, 5, np.random.default_rng(0))
    found = lineages_test(walks, permutations=1)
    assert [test.statistic for test in found] == pytest.approx([distance(walks, k) for k in (2, 3, 4)])


def test_p_of_lineages_is_the_share_of_all_recombinations():
    # Six lineages through one state: 6! ways to go on, of which those that keep 0 with 3 and 1 with 4.
    walks = np.array([[0, 2, 3]] * 3 + [[1, 2, 4]] * 3)
    (found,) = lineages_test(walks, permutations=6000)
    ways = 0
    for order in itertools.permutations(range(6)):
        made = walks.copy()
        made[:, 2] = walks[list(order), 2]
        ways += distance(made, 2) >= distance(walks, 2) - 1e-9
    exact = ways / 720
    assert exact == pytest.approx(0.1)
    assert found.p_value == pytest.approx(exact, abs=4 * np.sqrt(exact / 6000))
    assert (found.niches, found.births) == (1, 6)


def test_recombining_keeps_every_single_generation():
    walks = simulate_lineages(
        scattered_chain(np.random.default_rng(1), 6).T, np.arange(50) % 6, 6, np.random.default_rng(2)
    )
    made = _recombined(walks, np.random.default_rng(3))
    assert (made != walks).any()
    for k in range(5):
        before, after = (sorted(map(tuple, some[:, k : k + 2].tolist())) for some in (walks, made))
        assert before == after


def test_recombining_makes_the_past_forgotten():
    # Two histories meet in state 2 again and again; afterwards each goes on with either.
    walks = np.array([[0, 2, 3, 2, 3]] * 200 + [[1, 2, 4, 2, 4]] * 200)
    made = _recombined(walks, np.random.default_rng(4))
    for early, late in ((0, 2), (2, 4), (0, 4)):
        same = np.mean((made[:, early] % 3 == 0) == (made[:, late] == 3))
        assert abs(same - 0.5) < 4 * 0.5 / np.sqrt(400)


@pytest.mark.parametrize("kind", ["local", "scattered"])
def test_lineages_of_a_true_chain_pass_at_the_nominal_rate(kind):
    rng = np.random.default_rng(5)
    p = []
    for seed in range(60):
        chain = local_chain(12) if kind == "local" else scattered_chain(rng, 12)
        walks = simulate_lineages(chain.T, np.repeat(rng.integers(12, size=10), 10), 4, rng)
        p.append([test.p_value for test in lineages_test(walks, permutations=39, seed=seed)])
    for column in np.array(p).T:
        assert np.count_nonzero(column <= 0.1) <= stats.binom.ppf(0.999, column.size, 0.1)
        assert abs(column.mean() - 0.5) < 4 * np.sqrt(1 / 12 / column.size)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["local", "scattered"])
def test_lineages_of_a_true_chain_pass_at_the_nominal_rate_in_many_simulations(kind):
    rng = np.random.default_rng(6)
    p = []
    for seed in range(500):
        chain = local_chain() if kind == "local" else scattered_chain(rng)
        walks = simulate_lineages(chain.T, np.repeat(rng.integers(20, size=24), 20), 6, rng)
        p.append([test.p_value for test in lineages_test(walks, permutations=99, seed=seed)])
    for column in np.array(p).T:
        for level in (0.05, 0.2):
            low, high = stats.binom.ppf([0.001, 0.999], column.size, level)
            assert low <= np.count_nonzero(column <= level) <= high


def test_lineages_that_turn_back_are_found():
    rng = np.random.default_rng(7)
    walks = simulate_lineages(local_chain().T, rng.integers(20, size=400), 6, rng)
    for k in range(2, 6):
        back = rng.random(400) < 0.3
        walks[back, k] = walks[back, k - 2]
    found = lineages_test(walks, permutations=99)
    assert found[0].p_value == 0.01
    assert found[0].ratio > 1.3


def test_a_failed_birth_ends_a_lineage_not_the_test():
    walks = np.array([[0, 2, 3, 3], [1, 2, NONE, NONE], [0, 2, NONE, NONE], [1, 2, 3, 3]])
    found = lineages_test(walks, permutations=9)
    assert [test.name for test in found] == ["Chapman-Kolmogorov, T^2", "Chapman-Kolmogorov, T^3"]
    assert all(test.niches == 1 and test.births == 4 for test in found)
    assert all(test.all_births == 4 for test in found)


@pytest.mark.filterwarnings("ignore:divide by zero")
def test_births_against_observed_middle_niches_written_out():
    births = simulate_births(local_chain(6), 900, np.random.default_rng(8))
    known = Triples.from_births(births).with_grandparent
    middles = [j for j in range(6) if np.unique(known.grandparent[known.niche == j]).size > 1]
    of = known.elite
    counts = np.zeros((6, 6, 6))
    np.add.at(counts, (known.grandparent[of], known.niche[of], known.child), 1)
    counts = counts[:, middles]
    births_of = counts.sum(axis=(0, 2))
    shares = counts.sum(axis=0) / births_of[:, None]
    weights = counts.sum(axis=2)
    above = below = 0.0
    for i, k in itertools.product(range(6), range(6)):
        scale = weights[i].sum() * counts[:, :, k].sum()
        if not scale:
            continue
        above += (counts[i, :, k].sum() - weights[i] @ shares[:, k]) ** 2 / scale
        # Hypergeometric: so many of an urn's births are drawn for this grandparent.
        total, marked = births_of.round().astype(int), (births_of * shares[:, k]).round().astype(int)
        drawn = weights[i].round().astype(int)
        below += stats.hypergeom.stats(total, marked, drawn, moments="v").sum() / scale
    found = births_test(Triples.from_births(births), permutations=1)
    assert found.statistic == pytest.approx(above / below)


@pytest.mark.parametrize("shape", [(4, 2), (4,)])
def test_lineages_need_two_generations(shape):
    with pytest.raises(NichechainError, match="l at least 2"):
        lineages_test(np.zeros(shape, np.int64))
