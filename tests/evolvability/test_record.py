"""An elite's recorded children: which they are, what D they give, and where that leads."""

from types import SimpleNamespace

import numpy as np
import pytest

import nichechain as nc
from nichechain import NichechainError
from nichechain.evolvability.record import draw_children, own_strength, recorded_children

GRID = nc.GridNiches((3, 3), ((0.0, 3.0), (0.0, 3.0)))


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    folder = tmp_path_factory.mktemp("record") / "arm"
    config = nc.BuildConfig("arm", (8, 8), ((-0.7, 0.9), (-0.9, 0.9)), evaluations=1500, scale=0.2, seed=3)
    with nc.Threads(1) as threads:
        nc.build(config, folder, threads)
    return nc.load(folder)


def test_the_record_is_the_births_that_name_the_elite(arm):
    births = arm.births()
    uids = arm.elites.uid
    found = recorded_children(arm, uids)
    assert found.shape == (len(uids), 65)
    for row, uid in enumerate(uids):
        landed = births.loc[births["parent_uid"] == uid, "child_niche"].dropna().to_numpy(int)
        np.testing.assert_array_equal(found[[row]].toarray()[0], np.bincount(landed, minlength=65))
    assert recorded_children(arm, uids[:0]).shape == (0, 65)
    assert recorded_children(arm, np.array([10**9])).sum() == 0


def test_d_has_the_mean_of_the_dirichlet_and_no_spread_where_no_child_was():
    rng = np.random.default_rng(0)
    counts, row, strength = np.array([6, 2, 0, 0]), np.array([0.1, 0.2, 0.3, 0.4]), 4.0
    draws = np.array([draw_children(counts, row, rng, strength) for _ in range(20_000)])
    np.testing.assert_allclose(draws.sum(axis=1), 1.0)
    mean = (counts + strength * row) / 12
    np.testing.assert_allclose(draws.mean(axis=0), mean, atol=0.005)
    # 1 − w ~ Beta(4, 8): what is left to the row is spread as the row is.
    rest = draws[:, 2] / row[2]
    np.testing.assert_allclose(rest, draws[:, 3] / row[3])
    assert rest.var() == pytest.approx(4 * 8 / (12**2 * 13), rel=0.05)
    np.testing.assert_array_equal(draw_children(0 * counts, row, rng, strength), row)


def test_several_genotypes_are_drawn_at_once():
    rng = np.random.default_rng(1)
    counts = np.array([[3, 0, 1], [0, 0, 0]])
    rows = rng.dirichlet(np.ones(3), 2)
    drawn = draw_children(counts, rows, rng, 2.0)
    np.testing.assert_allclose(drawn.sum(axis=1), 1.0)
    np.testing.assert_array_equal(drawn[1], rows[1])


def test_the_strength_is_that_of_the_elites_that_were_simulated():
    """Elites' laws ~ Dirichlet(a·row): siblings share a niche more often than cousins, by 1/(a + 1)."""
    rng = np.random.default_rng(2)
    row = np.full(9, 1 / 9)
    parent, child, elite = [], [], []
    for number in range(3000):
        law = rng.dirichlet(20.0 * row)
        child.append(rng.choice(9, 10, p=law))
        parent.append(np.full(10, number % 9))
        elite.append(np.full(10, number))
    parent, child, elite = (np.concatenate(x) for x in (parent, child, elite))
    counts = nc.TransitionCounts.from_births(parent, child, GRID, elite=elite)
    assert own_strength(nc.estimate(counts)) == pytest.approx(20.0, rel=0.15)


def test_the_strength_without_families_is_that_of_the_base():
    counts = nc.TransitionCounts.from_pairs([0, 1, 1], [1, 2, 0], GRID)
    assert own_strength(nc.estimate(counts, strength=7.0)) == 7.0
    assert own_strength(nc.estimate(counts, "mle")) == 1.0
    assert own_strength(nc.NicheChain(np.eye(3))) == 1.0


def test_an_elite_that_always_stays_is_worth_one_niche(arm):
    """With a T that is given and a record without end, D is the record."""
    state = int(arm.elites.niche[0])
    matrix = np.full((65, 65), 1 / 65)
    matrix[state] = np.eye(65)[state]
    chain = nc.NicheChain(matrix, niches=arm.niches, outside=64)
    frame = nc.elite_evolvability(arm, chain=chain, strength=1e-6, l=1, lineages=7, draws=3).set_index(
        "niche"
    )
    children = recorded_children(arm, arm.elites.uid).toarray()
    for row, niche in enumerate(arm.elites.niche[:10]):
        single = nc.genotype_evolvability(
            arm, arm.elite(int(niche)), chain=chain, strength=1e-6, l=1, lineages=7, draws=200
        )
        assert frame.loc[niche, "recorded"] == children[row].sum() == single.recorded
        if not children[row].sum():
            expected = 64 * (1 - (64 / 65) ** 7) if niche != state else 1.0
            assert frame.loc[niche, "value"] == pytest.approx(expected)
            assert single.value == pytest.approx(expected)
        elif np.count_nonzero(children[row]) == 1:
            assert frame.loc[niche, "value"] == pytest.approx(1.0, abs=0.01)


def test_the_ranking_has_what_single_elites_have(arm):
    options = {"l": 3, "lineages": 20, "draws": 60, "seed": 4}
    chain = arm.chain()
    frame = nc.elite_evolvability(arm, chain=chain, **options)
    assert frame["value"].is_monotonic_decreasing
    inside = arm.elites.niche[arm.elites.niche < 64]
    assert sorted(frame["niche"]) == sorted(inside)
    niches = nc.niche_evolvability(chain, **options)
    for row in frame.iloc[:: len(frame) // 8].itertuples():
        single = nc.genotype_evolvability(arm, arm.elite(row.niche), chain=chain, **options)
        slack = 5 * (row.standard_error + single.standard_error)
        assert row.value == pytest.approx(single.value, abs=slack)
        assert (row.recorded, row.births) == (single.recorded, single.births)
    for row in frame[frame["recorded"] == 0].itertuples():
        # Nothing is known of it but its niche.
        assert row.value == pytest.approx(niches.value[row.niche])
        assert (row.low, row.high) == pytest.approx((niches.low[row.niche], niches.high[row.niche]))


def test_under_procedure_the_children_stand_for_the_first_state(arm):
    frame = nc.elite_evolvability(arm, l=2, lineages=5, draws=40, convention="procedure")
    row = frame.iloc[0]
    single = nc.genotype_evolvability(
        arm, arm.elite(int(row.niche)), l=2, lineages=5, draws=40, convention="procedure"
    )
    assert row.value == pytest.approx(single.value, abs=5 * (row.standard_error + single.standard_error))


def test_fresh_offspring_add_to_the_record(arm):
    uids = arm.elites.uid[arm.elites.niche < 64]
    most = np.argmax(recorded_children(arm, uids).sum(axis=1))
    elite = arm.elite(int(arm.elites.niche[most]))
    with_fresh = nc.genotype_evolvability(arm, elite, l=1, lineages=5, offspring=6)
    assert (with_fresh.offspring, with_fresh.recorded > 0) == (6, True)
    # Recorded children were not all there is to be counted: only fresh ones are rarefied.
    assert with_fresh.method == "exact"
    only_fresh = nc.genotype_evolvability(arm, elite, l=1, lineages=5, offspring=6, record=False)
    assert (only_fresh.recorded, only_fresh.method) == (0, "rarefaction")


def test_what_cannot_be_asked_is_said(arm):
    parents = set(arm.births()["parent_uid"].dropna())
    childless = next(e for e in map(arm.elite, arm.elites.niche.tolist()) if e.uid not in parents)
    with pytest.raises(NichechainError, match="no recorded children to take the share of"):
        nc.genotype_evolvability(arm, childless, first_generation="empirical")
    with pytest.raises(NichechainError, match="offspring is 0, but must be at least 1"):
        nc.genotype_evolvability(arm, childless, record=False)
    with pytest.raises(NichechainError, match="chain has 2 states and the archive 65"):
        nc.elite_evolvability(arm, chain=nc.NicheChain(np.eye(2)))
    empty = SimpleNamespace(niches=arm.niches, elites=arm.elites[:0])
    with pytest.raises(NichechainError, match="no niche has an elite"):
        nc.elite_evolvability(empty)
