"""Parents of recorded births, told from the solutions themselves."""

from __future__ import annotations

import numpy as np
import pytest
from ribs.emitters import GaussianEmitter
from ribs.schedulers import Scheduler

from nichechain import NichechainError
from nichechain.pyribs import Recording, record
from nichechain.pyribs.recording import recording_of

from .searches import (
    INITIAL,
    TINY,
    check_table,
    children_near_parents,
    cvt,
    evaluate,
    gaussian,
    genetic,
    genetic_line,
    grid,
    iso_line,
    ours,
    run,
    search,
)


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
    assert children_near_parents(frame, solutions) == 7 * 20
    # A tie of tiny steps is no evidence: initial solutions are far from each other.
    gaps = np.linalg.norm(INITIAL[:, None] - INITIAL[None], axis=2) + 9 * np.eye(40)
    assert gaps.min() > 1e4 * TINY


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
    assert children_near_parents(births, solutions) == 4 * 20


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
    assert children_near_parents(births, solutions) == 5 * 20


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
    assert children_near_parents(births, solutions) == 75
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


def test_an_emitter_draws_from_an_archive_of_the_search():
    with pytest.raises(NichechainError, match="draws elites from an archive that the search does not add to"):
        record(search(grid(), gaussian(grid())))
