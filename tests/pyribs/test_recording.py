"""Recorded searches against what pyribs really did: births, elites, and the recording itself."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from ribs.schedulers import BanditScheduler, Scheduler

from nichechain import NichechainError
from nichechain.pyribs import Recording, record

from .searches import (
    INITIAL,
    check_table,
    children_near_parents,
    cvt,
    evaluate,
    gaussian,
    genetic,
    grid,
    iso_line,
    run,
    search,
    strategist,
)


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


def test_a_bandit_is_recorded_too():
    archive = grid()
    emitters = [gaussian(archive), iso_line(archive), genetic(archive)]
    scheduler = BanditScheduler(archive, emitters, num_active=2)
    recording = record(scheduler)
    solutions = run(scheduler, 10)
    births = recording.births().to_pandas()
    assert children_near_parents(births, solutions)
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
