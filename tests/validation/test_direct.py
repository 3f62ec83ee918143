import numpy as np
import pytest
from scipy import stats

import nichechain as nc
from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.core.row_sampler import RowSampler
from nichechain.domains import Evaluation, PlanarArm
from nichechain.validation import Lineages, compare, run_lineages, sample_roots, simulate_lineages

from .conftest import scattered_chain


@pytest.fixture(scope="module")
def threads():
    with nc.Threads(2) as made:
        yield made


@pytest.fixture(scope="module")
def roots(arm):
    return arm.elites.niche[[3, 12, 20, 31]]


@pytest.fixture(scope="module")
def lineages(arm, roots, threads):
    return run_lineages(arm, roots, threads, l=4, lineages=12, offspring=15, seed=6)


def test_lineages_are_mutated_and_evaluated_one_after_another(arm, roots, lineages):
    # One lineage replayed by hand.
    root, number = int(roots[1]), 7
    genotype = arm.elite(root).genotype
    for generation in range(4):
        index = (root << 40) | (number << 16) | generation
        genotype = arm.mutate(genotype, keyed(6, Purpose.LINEAGE, index))
        behavior = arm.domain.evaluate(genotype[None]).behavior
        assert lineages.states[1, number, generation] == arm.niches.of(behavior)[0]
    # Others are different, and none stands still.
    assert np.unique(lineages.states.reshape(-1, 4), axis=0).shape[0] > 30


def test_a_lineage_depends_on_no_other(arm, roots, lineages):
    with nc.Threads(1) as one:
        fewer = run_lineages(arm, roots[1:3], one, l=3, lineages=5, offspring=2, seed=6)
    np.testing.assert_array_equal(fewer.states, lineages.states[1:3, :5, :3])
    np.testing.assert_array_equal(fewer.offspring, lineages.offspring[1:3, :2])


def test_progress_tells_of_every_evaluation(arm, roots, threads):
    told = []
    run_lineages(arm, roots, threads, l=2, lineages=3, offspring=4, on_done=told.append)
    assert sum(told) == 4 * (2 * 3 + 4)


class Fragile(PlanarArm):
    """An arm that breaks when its hand is low."""

    def evaluate(self, genotypes):
        fine = super().evaluate(genotypes)
        broken = fine.behavior[:, 1] < -0.3
        behavior = np.where(broken[:, None], np.nan, fine.behavior)
        return Evaluation(behavior, fine.objective, broken, tuple("low" if bad else "" for bad in broken))


def test_a_failed_birth_ends_its_lineage(arm, roots, lineages, threads):
    fragile = nc.load(arm.folder, domain=Fragile())
    broken = run_lineages(fragile, roots, threads, l=4, lineages=12, offspring=15, seed=6)
    over = np.logical_or.accumulate(broken.states == NONE, axis=2)
    assert 0 < over.mean() < 1
    np.testing.assert_array_equal(broken.states, np.where(over, NONE, lineages.states))
    assert broken.failed == np.count_nonzero(over[:, :, -1])
    frame = broken.to_frame()
    assert frame["state"].isna().sum() == over.sum()
    check = compare(fragile.chain(), broken, fragile.niches, draws=2)
    assert (check.reached <= lineages.reached(64)).all()


def test_reached_counts_niches_and_nothing_else():
    states = np.array([[[1, 2, 4], [4, 1, NONE]], [[4, 4, 4], [0, 0, 0]]])
    assert Lineages(np.array([0, 1]), states, states[:, :, 0]).reached(4).tolist() == [[1, 2, 2], [1, 1, 1]]


def test_walks_begin_at_the_root(lineages, roots):
    walks = lineages.walks
    assert walks.shape == (4 * 12, 5)
    np.testing.assert_array_equal(walks[:, 0], np.repeat(roots, 12))
    np.testing.assert_array_equal(walks[13, 1:], lineages.states[1, 1])
    frame = lineages.to_frame()
    one = frame[(frame["root"] == roots[1]) & (frame["lineage"] == 1)].sort_values("generation")
    assert one["state"].tolist() == lineages.states[1, 1].tolist()


def test_absorbed_lineages_do_not_come_back(tmp_path, threads):
    config = nc.BuildConfig(
        "arm", (6, 6), ((0.2, 1), (-0.5, 0.5)), outside="absorb", evaluations=400, scale=0.3
    )
    nc.build(config, tmp_path / "arm", threads)
    archive = nc.load(tmp_path / "arm")
    inside = archive.elites.niche[archive.elites.niche < 36][:5]
    states = run_lineages(archive, inside, threads, l=5, lineages=10).states
    gone = states == 36
    assert 0 < gone.mean() < 1
    assert (gone[:, :, 1:] >= gone[:, :, :-1]).all()


def test_predictions_are_those_of_the_library(arm, roots, lineages, threads):
    chain = arm.chain()
    check = compare(chain, lineages, arm.niches, draws=40, seed=6)
    niche, genotype = check.predictions
    for row, k in ((0, 0), (2, 1), (3, 3)):
        options = {"l": k + 1, "lineages": 12, "draws": 40, "seed": 6}
        expected = nc.l_evolvability(chain, niche=int(roots[row]), **options)
        assert niche.value[row, k] == pytest.approx(expected.value)
        expected = nc.genotype_evolvability(
            arm, arm.elite(int(roots[row])), offspring=15, record=False, executor=threads, **options
        )
        slack = 6 * expected.standard_error + 1e-9
        assert genotype.value[row, k] == pytest.approx(expected.value, abs=slack)


def test_simulated_checks_have_the_mean_that_is_predicted(arm, lineages):
    # The genotype's first generation is rarefied, not simulated.
    check = compare(arm.chain(), lineages, arm.niches, draws=60)
    for prediction in check.predictions:
        mean = prediction.simulated.mean(axis=2)
        error = prediction.simulated.std(axis=2) / np.sqrt(prediction.simulated.shape[2])
        first = int(prediction.start == "genotype")
        assert (np.abs(mean - prediction.value) < 5 * error)[:, first:].all()


def known_check(seed, roots=150, lineages=15, l=4):
    """Lineages of a known chain, and what it predicts of them."""
    rng = np.random.default_rng(seed)
    niches = nc.GridNiches((7, 7), ((0, 1), (0, 1)))
    # Rows of very different spread, so that there is something to rank.
    rows = [rng.dirichlet(np.full(50, width)) for width in np.geomspace(0.01, 0.5, 50)]
    chain = nc.NicheChain(rows, niches=niches, outside=49)
    start = np.arange(roots) % 49
    draw = RowSampler(chain.T).draw
    first = draw(np.repeat(start, lineages), rng).reshape(roots, lineages)
    offspring = draw(np.repeat(start, 30), rng).reshape(roots, 30)
    states = simulate_lineages(chain.T, first, l, rng)
    return chain, Lineages(start, states, offspring), niches


def test_a_chain_that_is_right_is_found_right():
    chain, lineages, niches = known_check(1)
    summary = compare(chain, lineages, niches, draws=20).summary().set_index(["start", "generation"])
    niche = summary.loc["niche"]
    # Whole numbers lie in a 90 % interval a little more often than 90 %.
    low = stats.binom.ppf(0.0005, 150, 0.9) / 150
    assert (niche["covered"] >= low).all()
    assert (niche["covered"] < 1).any()
    standard_error = (niche["bias_high"] - niche["bias"]) / stats.t.ppf(0.975, 149)
    assert (niche["bias"].abs() < 4 * standard_error).all()
    assert (niche["spearman"] > niche["spearman_low"] - 0.05).all()
    assert (niche["spearman"] < niche["spearman_high"] + 0.05).all()
    assert niche.loc[1, "slope"] == pytest.approx(1.0, abs=0.1)


def test_a_chain_that_is_wrong_is_found_wrong():
    chain, lineages, niches = known_check(2)
    # Lineages really stay where they are first born.
    states = np.repeat(lineages.states[:, :, :1], 4, axis=2)
    stuck = Lineages(lineages.roots, states, lineages.offspring)
    summary = compare(chain, stuck, niches, draws=20).summary().set_index(["start", "generation"])
    assert summary.loc[("niche", 4), "bias_low"] > 1
    assert summary.loc[("niche", 4), "covered"] < 0.7
    assert abs(summary.loc[("niche", 1), "bias"]) < 0.5


def test_spearman_and_bias_are_scipys(arm, lineages):
    check = compare(arm.chain(), lineages, arm.niches, draws=5)
    summary = check.summary().set_index(["start", "generation"])
    value, real = check.predictions[1].value[:, 2], check.reached[:, 2]
    row = summary.loc[("genotype", 3)]
    assert row["spearman"] == pytest.approx(stats.spearmanr(value, real).statistic)
    assert row["slope"] == pytest.approx(stats.linregress(value, real).slope)
    interval = stats.ttest_1samp(value - real, 0).confidence_interval()
    assert (row["bias_low"], row["bias_high"]) == pytest.approx((interval.low, interval.high))


def test_rarefied_first_generation_at_as_many_lineages_as_offspring(arm, roots, threads):
    # With U = m the prediction from the genotype is the number of niches its offspring hit.
    lineages = run_lineages(arm, roots, threads, l=1, lineages=9, offspring=9)
    check = compare(arm.chain(), lineages, arm.niches, draws=3)
    hit = [np.unique(row[row < 64]).size for row in lineages.offspring]
    np.testing.assert_allclose(check.predictions[1].value[:, 0], hit)


def test_roots_are_spread_over_what_is_predicted(arm):
    chain = arm.chain()
    roots = sample_roots(chain, arm.elites.niche, 6, l=3, lineages=10, min_births=10, seed=2)
    eligible = np.flatnonzero(chain.births[:64] >= 10)
    scores = nc.niche_evolvability(chain, l=3, lineages=10, draws=10, seed=2).value
    ranks = np.searchsorted(np.sort(scores[eligible]), np.sort(scores[roots]))
    bounds = np.cumsum([0, *[len(part) for part in np.array_split(eligible, 6)]])
    for rank, low, high in zip(ranks, bounds[:-1], bounds[1:], strict=True):
        assert low <= rank < high
    everything = sample_roots(chain, arm.elites.niche, 1000, l=3, lineages=10, min_births=10)
    np.testing.assert_array_equal(everything, eligible)


def test_bad_numbers(arm, roots, lineages, threads):
    chain = arm.chain()
    with pytest.raises(NichechainError, match="elites are 2"):
        sample_roots(chain, arm.elites.niche, 2, l=1, lineages=1)
    with pytest.raises(NichechainError, match="0 niches have 100000 births"):
        sample_roots(chain, arm.elites.niche, 5, l=1, lineages=1, min_births=100_000)
    with pytest.raises(NichechainError, match="l is 0"):
        run_lineages(arm, roots, threads, l=0, lineages=1)
    with pytest.raises(NichechainError, match="offspring is 0"):
        run_lineages(arm, roots, threads, l=1, lineages=1, offspring=0)
    with pytest.raises(NichechainError, match="draws is 0"):
        compare(chain, lineages, arm.niches, draws=0)


def test_constant_predictions_have_no_rank_correlation():
    chain = scattered_chain(np.random.default_rng(0), 4)
    same = nc.NicheChain(np.tile(chain.T[:1], (4, 1)), niches=nc.GridNiches((2, 2), ((0, 1), (0, 1)), "clip"))
    states = simulate_lineages(same.T, np.zeros((4, 3), int), 2, np.random.default_rng(1))
    check = compare(same, Lineages(np.arange(4), states, states[:, :, 0]), same.niches, draws=2)
    assert np.isnan(check.summary().loc[0, "spearman"])
