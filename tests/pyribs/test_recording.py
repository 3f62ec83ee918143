"""Recorded births against what pyribs really did, told from the solutions themselves."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from ribs.archives import (
    CategoricalArchive,
    DensityArchive,
    ProximityArchive,
    SlidingBoundariesArchive,
)
from ribs.emitters import (
    EvolutionStrategyEmitter,
    GaussianEmitter,
    GeneticAlgorithmEmitter,
    GradientArborescenceEmitter,
    IsoLineEmitter,
)
from ribs.schedulers import BanditScheduler, Scheduler

from nichechain import NichechainError, variation
from nichechain.niches import GridNiches
from nichechain.pyribs import MutationEmitter, Recording, from_ribs, record
from nichechain.pyribs.recording import recording_of

from .searches import RANGES, cvt, evaluate, grid, run, search

INITIAL = np.random.default_rng(2).uniform(-1.5, 1.5, (40, 5))
TINY = 1e-9


def gaussian(archive, sigma=TINY, **options):
    return GaussianEmitter(archive, sigma=sigma, initial_solutions=INITIAL, batch_size=20, seed=3, **options)


def iso_line(archive, **options):
    sigmas = {"iso_sigma": TINY, "line_sigma": 0.0, **options}
    return IsoLineEmitter(archive, **sigmas, initial_solutions=INITIAL, batch_size=20, seed=4)


def genetic(archive, operator="gaussian", **kwargs):
    return GeneticAlgorithmEmitter(
        archive,
        operator=operator,
        operator_kwargs=kwargs or {"sigma": TINY},
        initial_solutions=INITIAL,
        batch_size=20,
        seed=5,
    )


def ours(archive):
    return MutationEmitter(
        archive, variation.gaussian(TINY), initial_solutions=INITIAL, batch_size=20, seed=6
    )


def genetic_line(archive):
    return genetic(archive, "isoline", iso_sigma=TINY, line_sigma=0.0)


def strategist(archive):
    # Of the strategies this is the one that numba does not have to compile first.
    return EvolutionStrategyEmitter(
        archive, x0=np.zeros(5), sigma0=0.3, es="openai_es", batch_size=10, seed=8
    )


def check_table(frame, archive):
    """What holds for any births: parents came before, and stood where the child says."""
    children = frame[frame["parent_uid"].notna()]
    parents = frame.loc[children["parent_uid"].astype(int)]
    assert (children.index > parents.index).all()
    assert (children["step"].to_numpy() > parents["step"].to_numpy()).all()
    assert (children["parent_niche"].to_numpy() == parents["child_niche"].to_numpy()).all()
    assert (children["depth"].to_numpy() == parents["depth"].to_numpy() + 1).all()
    assert frame["uid"].tolist() == list(range(len(frame)))
    # Someone who became an elite is there now, or was replaced by a later one of the same cell.
    assert set(recorded_elites(archive)) <= set(frame[frame["accepted"]].index)


def recorded_elites(archive):
    return recording_of(archive).elites()[1].tolist()


@pytest.mark.parametrize("emitter", [gaussian, iso_line, genetic, genetic_line, ours])
@pytest.mark.parametrize("make", [grid, cvt])
@pytest.mark.parametrize("add_mode", ["batch", "single"])
def test_parents_are_the_elites_that_children_resemble(emitter, make, add_mode):
    archive = make()
    recording = record(search(archive, emitter(archive), add_mode=add_mode))
    scheduler = Scheduler(archive, recording.emitters, add_mode=add_mode)
    solutions = run(scheduler, 8)
    frame = recording.births().to_pandas()
    assert len(frame) == len(solutions) == 40 + 7 * 20
    assert frame["parent_uid"].isna().sum() == 40
    check_table(frame, archive)
    children = frame["parent_uid"].notna()
    parents = solutions[frame["parent_uid"][children].astype(int)]
    assert np.abs(solutions[children] - parents).max() < 100 * TINY
    # A tie of tiny steps is no evidence: initial solutions are far from each other.
    gaps = np.linalg.norm(INITIAL[:, None] - INITIAL[None], axis=2) + 9 * np.eye(40)
    assert gaps.min() > 1e4 * TINY


@pytest.mark.parametrize("make", [grid, cvt])
def test_niches_are_the_cells_of_pyribs(make):
    archive = make()
    recording = record(search(archive, gaussian(archive, sigma=0.4)))
    run(Scheduler(archive, recording.emitters), 6)
    births = recording.births().to_pandas()
    behavior = births[["behavior_0", "behavior_1"]].to_numpy()
    np.testing.assert_array_equal(births["child_niche"], recording.niches.of(behavior))
    inside = births["child_niche"] < len(recording.niches)
    assert 0 < (~inside).sum() < len(births)
    np.testing.assert_array_equal(births["child_niche"][inside], archive.index_of(behavior[inside]))


def test_clipped_births_are_in_the_cells_where_pyribs_puts_them():
    archive = grid()
    recording = record(search(archive, gaussian(archive, sigma=0.4)), outside="clip")
    run(Scheduler(archive, recording.emitters), 6)
    births = recording.births().to_pandas()
    behavior = births[["behavior_0", "behavior_1"]].to_numpy()
    np.testing.assert_array_equal(births["child_niche"], archive.index_of(behavior))
    np.testing.assert_array_equal(births["child_niche"], recording.niches.of(behavior))


@pytest.mark.parametrize("add_mode", ["batch", "single"])
@pytest.mark.parametrize("make", [grid, cvt])
def test_a_recorded_search_is_the_search_that_it_would_be(make, add_mode):
    found = []
    for recorded in (False, True):
        archive = make()
        emitters = [gaussian(archive, 0.3), iso_line(archive, iso_sigma=0.1, line_sigma=0.4)]
        emitters.append(strategist(archive))
        scheduler = search(archive, *emitters, add_mode=add_mode)
        if recorded:
            record(scheduler)
        solutions = run(scheduler, 12)
        found.append((solutions, archive.data()))
    np.testing.assert_array_equal(found[0][0], found[1][0])
    for name, values in found[0][1].items():
        np.testing.assert_array_equal(values, found[1][1][name])


def test_elites_are_those_that_pyribs_keeps():
    archive = grid()
    recording = record(search(archive, gaussian(archive, 0.3), iso_line(archive, iso_sigma=0.2)))
    scheduler = Scheduler(archive, recording.emitters)
    solutions = run(scheduler, 15)
    cells, uid, depth = recording.elites()
    data = archive.data(["index", "solution"])
    np.testing.assert_array_equal(cells, data["index"])
    np.testing.assert_array_equal(solutions[uid], data["solution"])
    births = recording.births().to_pandas()
    np.testing.assert_array_equal(births["depth"][uid], depth)
    assert depth.max() > 2
    check_table(births, archive)


def test_accepted_are_those_that_win_one_by_one():
    archive = grid()
    recording = record(search(archive, gaussian(archive, 0.3)))
    run(Scheduler(archive, recording.emitters), 15)
    births = recording.births().to_pandas()
    best: dict[int, float] = {}
    for row in births.itertuples():
        cell = int(archive.index_of_single([row.behavior_0, row.behavior_1]))
        wins = row.objective > best.get(cell, -np.inf)
        assert row.accepted == wins
        if wins:
            best[cell] = row.objective


def test_of_equal_solutions_in_a_batch_the_first_is_the_elite():
    archive = grid()
    recording = Recording(archive, [])
    solutions = np.zeros((3, 5))
    archive.add(solutions, *evaluate(solutions))
    assert recording.elites()[1].tolist() == [0]
    assert recording.births()["accepted"].to_pylist() == [True, False, False]


@pytest.mark.parametrize("strategy", ["cma_es", "openai_es"])
def test_a_strategys_parent_is_the_birth_nearest_to_its_mean(strategy):
    archive = grid()
    options = {"mirror_sampling": False} if strategy == "openai_es" else {}
    emitter = EvolutionStrategyEmitter(
        archive,
        x0=np.zeros(5),
        sigma0=0.3,
        es=strategy,
        es_kwargs=options,
        restart_rule="basic",
        batch_size=12,
        seed=2,
    )
    recording = record(search(archive, gaussian(archive, 0.2), emitter))
    scheduler = Scheduler(archive, recording.emitters)
    added, mine = [], {}
    for step in range(5):
        optimizer = emitter._opt
        mean = optimizer.adam_opt.theta.copy() if strategy == "openai_es" else optimizer.mean.copy()
        solutions = scheduler.ask()
        first = sum(map(len, added)) + len(solutions) - 12
        added.append(solutions.copy())
        mine[step] = (np.arange(first, first + 12), mean)
        scheduler.tell(*evaluate(solutions))
    assert emitter.restarts == 0
    everything = np.concatenate(added)
    births = recording.births().to_pandas()
    for step, (uid, mean) in mine.items():
        parents = births["parent_uid"][uid]
        if step == 0:
            assert parents.isna().all()
            continue
        last = mine[step - 1][0]
        nearest = last[np.argmin(np.linalg.norm(everything[last] - mean, axis=1))]
        assert (parents == nearest).all()
    assert recording.conventions()[1]["parent"].startswith("the birth of its last batch nearest to its mean")


@pytest.mark.parametrize("convention", ["mean", "restart"])
def test_a_strategy_that_restarts_comes_from_the_elite_it_restarts_from(convention):
    archive = grid()
    emitter = EvolutionStrategyEmitter(
        archive, x0=np.zeros(5), sigma0=0.3, restart_rule=2, batch_size=12, seed=2
    )
    recording = record(search(archive, emitter), strategy_parent=convention)
    scheduler = Scheduler(archive, [emitter])
    added = []
    for _ in range(9):
        mean, restarted = emitter._opt.mean.copy(), emitter.itrs > 0 and emitter.itrs % 2 == 0
        added.append((scheduler.ask().copy(), mean, restarted))
        scheduler.tell(*evaluate(added[-1][0]))
    everything = np.concatenate([solutions for solutions, _, _ in added])
    parents = recording.births().to_pandas()["parent_uid"].to_numpy().reshape(9, 12)
    assert emitter.restarts == 4
    elite = np.nan
    for row, (_, mean, restarted) in zip(parents, added, strict=True):
        assert len(np.unique(row)) == 1
        if restarted:
            elite = row[0]
            np.testing.assert_array_equal(everything[int(elite)], mean)
        if convention == "restart":
            np.testing.assert_equal(row[0], elite)
    check_table(recording.births().to_pandas(), archive)


def test_branches_of_a_gradient_come_from_the_solution_they_branch_at():
    archive = grid()
    emitter = GradientArborescenceEmitter(
        archive, x0=np.full(5, 0.1), sigma0=0.5, lr=0.1, batch_size=8, seed=1
    )
    recording = record(search(archive, emitter))
    scheduler = Scheduler(archive, [emitter])
    rng = np.random.default_rng(0)
    for _ in range(4):
        point = scheduler.ask_dqd()
        objective, measures = evaluate(point)
        scheduler.tell_dqd(objective, measures, rng.normal(size=(1, 3, 5)))
        branches = scheduler.ask()
        scheduler.tell(*evaluate(branches))
    births = recording.births().to_pandas()
    assert len(births) == 4 * 9
    for k in range(4):
        assert (births["parent_uid"][9 * k + 1 : 9 * k + 9] == 9 * k).all()
    check_table(births, archive)


def test_a_bandit_is_recorded_too():
    archive = grid()
    emitters = [gaussian(archive), iso_line(archive), genetic(archive)]
    scheduler = BanditScheduler(archive, emitters, num_active=2)
    recording = record(scheduler)
    solutions = run(scheduler, 10)
    births = recording.births().to_pandas()
    children = births["parent_uid"].notna()
    parents = solutions[births["parent_uid"][children].astype(int)]
    assert np.abs(solutions[children] - parents).max() < 100 * TINY
    assert [each["parent"] for each in recording.conventions()] == [
        "the elite that was drawn",
        "the first of 2 elites that were drawn",
        "the elite that was drawn",
    ]


@pytest.mark.parametrize("add_mode", ["batch", "single"])
def test_what_is_not_finite_is_a_failed_birth_and_not_the_end(add_mode):
    archive = grid()
    recording = record(search(archive, gaussian(archive, 0.3), add_mode=add_mode))
    scheduler = Scheduler(archive, recording.emitters, add_mode=add_mode)

    def sometimes(solutions):
        objective, measures = evaluate(solutions)
        objective[::5] = np.nan
        measures[1::5, 0] = np.inf
        return objective, measures

    run(scheduler, 4, sometimes)
    births = recording.births().to_pandas()
    failed = births["failed"].notna()
    assert failed.sum() == 2 * (8 + 3 * 4)
    assert births["child_niche"][failed].isna().all()
    assert births["behavior_0"][failed].isna().all()
    assert not births["accepted"][failed].any()
    assert not set(births["parent_uid"].dropna().astype(int)) & set(births.index[failed])
    check_table(births, archive)

    run(scheduler, 1, lambda _: (np.full(20, np.nan), np.zeros((20, 2))))
    assert recording.births()["failed"].null_count == (~failed).sum()


def test_elites_from_before_and_solutions_of_nobody_are_initial_births():
    archive = grid()
    archive.add(INITIAL, *evaluate(INITIAL))
    held = len(archive)
    recording = Recording(archive, [])
    assert len(recording) == held
    strangers = INITIAL[:6] + 0.5
    archive.add(strangers, *evaluate(strangers))
    births = recording.births().to_pandas()
    assert len(births) == held + 6
    assert births["parent_uid"].isna().all()
    assert (births["depth"] == 0).all()
    check_table(births, archive)


def test_solutions_may_come_back_in_another_order():
    archive = grid()
    emitter = gaussian(archive)
    recording = Recording(archive, [emitter])
    rng = np.random.default_rng(0)
    added = []
    for _ in range(5):
        solutions = rng.permutation(emitter.ask())
        added.append(solutions)
        archive.add(solutions, *evaluate(solutions))
    solutions = np.concatenate(added)
    births = recording.births().to_pandas()
    children = births["parent_uid"].notna()
    assert children.sum() == 4 * 20
    parents = solutions[births["parent_uid"][children].astype(int)]
    assert np.abs(solutions[children] - parents).max() < 100 * TINY


def test_a_recording_is_pickled_with_its_search():
    archive = grid()
    scheduler = search(
        archive,
        gaussian(archive, 0.3),
        strategist(archive),
    )
    recording = record(scheduler)
    run(scheduler, 5)
    copied, kept = pickle.loads(pickle.dumps((scheduler, recording)))
    run(scheduler, 5)
    run(copied, 5)
    assert kept.births().equals(recording.births())
    assert kept.archive is copied.archive
    assert len(recording) == 40 + 9 * 20 + 10 * 10


def test_float32_archives_are_recorded():
    archive = grid(dtype=np.float32)
    recording = record(search(archive, gaussian(archive, 0.3)))
    run(Scheduler(archive, recording.emitters), 6)
    births = recording.births().to_pandas()
    assert births["parent_uid"].isna().sum() == 40
    check_table(births, archive)


def test_an_archive_that_was_cleared_has_no_parents():
    archive = grid()
    recording = record(search(archive, gaussian(archive, 0.3)))
    scheduler = Scheduler(archive, recording.emitters)
    run(scheduler, 2)
    archive.clear()
    assert recording.elites()[0].size == 0
    run(scheduler, 1)
    assert recording.births().to_pandas()["parent_uid"][60:].isna().all()


class Loner(GaussianEmitter):
    """An emitter that looks at no elites."""

    def ask(self):
        return INITIAL.copy()


class Glutton(GaussianEmitter):
    """An emitter that draws more elites than it can use."""

    def ask(self):
        solutions = super().ask()
        if not self.archive.empty:
            self.archive.sample_elites(1)
        return solutions


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (Loner, "Loner drew no elites from an archive that has some"),
        (Glutton, "Glutton drew 21 elites for 20 solutions"),
    ],
)
def test_emitters_whose_parents_are_not_known_are_refused(make, message):
    archive = grid()
    scheduler = search(archive, make(archive, sigma=0.1, initial_solutions=INITIAL, batch_size=20))
    record(scheduler)
    run(scheduler, 1)
    with pytest.raises(NichechainError, match=message):
        scheduler.ask()


NICHES = GridNiches((6, 5), tuple(RANGES))


def sliding():
    return SlidingBoundariesArchive(solution_dim=5, dims=(4, 4), ranges=RANGES, remap_frequency=30, seed=1)


@pytest.mark.parametrize(
    ("archive", "message"),
    [
        (sliding, "a SlidingBoundariesArchive moves its cells while it searches.*give niches, such as"),
        (
            lambda: CategoricalArchive(solution_dim=5, categories=[["a", "b"], ["c", "d"]]),
            "the measures of a CategoricalArchive are words.*number the categories",
        ),
        (
            lambda: ProximityArchive(solution_dim=5, measure_dim=2, k_neighbors=3, novelty_threshold=0.1),
            "a ProximityArchive has no cells that could be niches: give the scheduler a GridArchive",
        ),
        (
            lambda: DensityArchive(measure_dim=2, bandwidth=1.0),
            "a DensityArchive has no cells that could be niches",
        ),
        (list, "the archive is a list, but must be a GridArchive or a CVTArchive of pyribs"),
    ],
)
def test_archives_without_lasting_cells_are_refused_with_what_to_do(archive, message):
    with pytest.raises(NichechainError, match=message):
        Recording(archive())


def test_an_archive_that_moves_its_cells_is_recorded_in_given_niches():
    archive = sliding()
    scheduler = search(archive, gaussian(archive))
    recording = record(scheduler, niches=NICHES)
    solutions = run(scheduler, 8)
    births = recording.births().to_pandas()
    np.testing.assert_array_equal(births["child_niche"], NICHES.of(evaluate(solutions)[1]))
    children = births["parent_uid"].notna()
    assert children.sum() == 7 * 20
    parents = solutions[births["parent_uid"][children].astype(int)]
    assert np.abs(solutions[children] - parents).max() < 100 * TINY


@pytest.mark.parametrize("add_mode", ["batch", "single"])
def test_solutions_that_are_clipped_in_place_keep_their_parents(add_mode):
    archive = grid()
    scheduler = search(archive, gaussian(archive), add_mode=add_mode)
    recording = record(scheduler)
    added = []
    for _ in range(6):
        solutions = scheduler.ask()
        np.clip(solutions, -0.5, 0.5, out=solutions)
        added.append(solutions.copy())
        scheduler.tell(*evaluate(solutions))
    solutions = np.concatenate(added)
    births = recording.births().to_pandas()
    children = births["parent_uid"].notna()
    assert children.sum() == 5 * 20
    parents = solutions[births["parent_uid"][children].astype(int)]
    assert np.abs(solutions[children] - parents).max() < 100 * TINY


def test_solutions_that_were_changed_and_shuffled_have_no_parents():
    archive = grid()
    emitter = gaussian(archive)
    recording = Recording(archive, [emitter])
    for seed in range(3):
        solutions = emitter.ask()
        solutions[0] += 0.5
        solutions = np.random.default_rng(seed).permutation(solutions)
        archive.add(solutions, *evaluate(solutions))
    births = recording.births().to_pandas()
    assert births["parent_uid"][40:].isna().sum() == 2


@pytest.mark.parametrize("make", [grid, cvt])
@pytest.mark.parametrize("how", ["elites", "cells"])
def test_a_loop_of_ones_own_says_who_the_parents_are(make, how):
    archive = make()
    rng = np.random.default_rng(0)
    added = [INITIAL]
    with Recording(archive) as recording:
        archive.add(INITIAL, *evaluate(INITIAL))
        for _ in range(5):
            elites = archive.sample_elites(15)
            recording.parents(elites if how == "elites" else elites["index"])
            solutions = elites["solution"] + rng.normal(0, TINY, (15, 5))
            added.append(solutions)
            for some in (slice(0, 9), slice(9, 15)):
                archive.add(solutions[some], *evaluate(solutions[some]))
    archive.add(INITIAL + 0.1, *evaluate(INITIAL + 0.1))
    solutions = np.concatenate(added)
    births = recording.births().to_pandas()
    assert len(births) == len(solutions) == 40 + 75
    assert births["step"].tolist() == [0] * 40 + sorted(list(range(1, 6)) * 15)
    children = births["parent_uid"].notna()
    assert children.sum() == 75
    parents = solutions[births["parent_uid"][children].astype(int)]
    assert np.abs(solutions[children] - parents).max() < 100 * TINY
    assert recording_of(archive) is None
    assert "add" not in vars(archive)


def test_parents_of_a_loop_of_ones_own_are_elites_and_as_many_as_children():
    archive = grid()
    with Recording(archive) as recording:
        archive.add(INITIAL, *evaluate(INITIAL))
        empty = int(np.setdiff1d(np.arange(42), archive.data("index"))[0])
        with pytest.raises(NichechainError, match="parent 1 is no elite that was recorded"):
            recording.parents([int(archive.data("index")[0]), empty])
        with pytest.raises(NichechainError, match=r"parents has the value 0\.5, but must have whole numbers"):
            recording.parents([0.5])
        recording.parents(archive.sample_elites(2))
        before = archive.data()
        with pytest.raises(NichechainError, match=r"3 solutions are added, but parents\(\) named 2 parents"):
            archive.add(np.zeros((3, 5)), *evaluate(np.zeros((3, 5))))
        np.testing.assert_array_equal(archive.data("objective"), before["objective"])
    assert len(recording) == 40


def test_a_recording_is_got_back_from_its_scheduler():
    archive = grid()
    scheduler = search(archive, gaussian(archive, 0.3))
    recording = record(scheduler)
    assert record(scheduler) is recording
    run(scheduler, 3)
    copied = pickle.loads(pickle.dumps(scheduler))
    back = record(copied)
    assert back is not recording
    assert back.births().equals(recording.births())
    run(copied, 2)
    assert len(back) == len(recording) + 40
    with pytest.raises(
        NichechainError, match="outside is 'clip', but the scheduler is being recorded already"
    ):
        record(copied, outside="clip")
    back.stop()
    assert record(copied, outside="clip").niches.outside == "clip"


def test_an_archive_is_no_scheduler():
    with pytest.raises(
        NichechainError, match=r"scheduler is a GridArchive, but must be a Scheduler .*Recording\(archive\)"
    ):
        record(grid())


def test_an_emitter_draws_from_an_archive_of_the_search():
    with pytest.raises(NichechainError, match="draws elites from an archive that the search does not add to"):
        record(search(grid(), gaussian(grid())))


def test_niches_that_do_not_fit_are_refused():
    archive = grid()
    with pytest.raises(NichechainError, match="niches are 'grid', but must be niches of nichechain"):
        Recording(archive, niches="grid")
    with pytest.raises(NichechainError, match="niches have 1 axes, but the archive has 2 measures"):
        Recording(archive, niches=GridNiches((4,), ((0, 1),)))


def test_a_grid_keeps_its_epsilon(tmp_path):
    archive = grid(epsilon=0.05)
    with Recording(archive) as recording:
        archive.add(INITIAL, *evaluate(INITIAL))
    edges = np.linspace(-1, 1, 2001)
    measures = np.stack([edges, edges * 0.8], axis=1)
    np.testing.assert_array_equal(recording.niches.of(measures), archive.index_of(measures))
    assert (Recording(grid()).niches.of(measures) != archive.index_of(measures)).any()
    with pytest.warns(UserWarning, match="none of 40 births has a known parent"):
        found = from_ribs(recording, tmp_path / "archive")
    assert found.niches == recording.niches
    assert found.to_ribs().epsilon == 0.05


def test_an_epsilon_is_the_same_in_short_floats():
    assert Recording(grid(dtype=np.float32)).niches.epsilon == GridNiches((7, 6), tuple(RANGES)).epsilon
    assert Recording(grid(dtype=np.float32, epsilon=0.05)).niches.epsilon == 0.05


def test_what_cannot_be_recorded_is_named():
    archive = grid()
    Recording(archive, [])
    with pytest.raises(NichechainError, match="recorded already"):
        Recording(archive, [])
    with pytest.raises(NichechainError, match="outside is 'absorb', but must be one of state, clip"):
        Recording(grid(), [], outside="absorb")
    with pytest.raises(NichechainError, match="strategy_parent is 'best', but must be one of mean, restart"):
        Recording(grid(), [], strategy_parent="best")


@pytest.mark.parametrize(
    ("objective", "measures"),
    [
        (None, np.zeros((3, 2))),
        (np.zeros(2), np.zeros((3, 2))),
        (np.zeros((3, 1)), np.zeros((3, 2))),
        (np.zeros(3), np.zeros(3)),
        (np.zeros(3), np.zeros((3, 3))),
    ],
)
def test_what_is_wrong_with_a_batch_pyribs_says_itself(objective, measures):
    plain, archive = grid(), grid()
    recording = Recording(archive, [])
    solutions = np.zeros((3, 5))
    with pytest.raises(ValueError, match=r"\w") as expected:
        plain.add(solutions, objective, measures)
    with pytest.raises(ValueError, match=r"\w") as found:
        archive.add(solutions, objective, measures)
    assert str(found.value) == str(expected.value)
    assert len(recording) == 0
