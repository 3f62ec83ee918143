"""Niches of recorded births: the cells of pyribs, where these last."""

from __future__ import annotations

import numpy as np
import pytest
from ribs.archives import CategoricalArchive, DensityArchive, ProximityArchive, SlidingBoundariesArchive
from ribs.schedulers import Scheduler

from nichechain import NichechainError
from nichechain.niches import GridNiches
from nichechain.pyribs import Recording, from_ribs, record

from .searches import INITIAL, RANGES, children_near_parents, cvt, evaluate, gaussian, grid, run, search


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
    assert children_near_parents(births, solutions) == 7 * 20


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
