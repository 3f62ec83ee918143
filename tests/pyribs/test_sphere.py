"""All algorithms of pyribs' sphere example, recorded."""

from __future__ import annotations

import numpy as np
import pytest

import nichechain as nc
from nichechain.pyribs import from_ribs, record

from . import sphere

ITERATIONS = 5


@pytest.mark.parametrize("name", sphere.ALGORITHMS)
def test_every_algorithm_is_recorded_and_runs_as_it_would(name, tmp_path):
    gradients = name in sphere.WITH_GRADIENTS
    plain, search = sphere.scheduler(name), sphere.scheduler(name)
    recording = record(search)
    solutions = sphere.run(search, ITERATIONS, gradients=gradients)
    np.testing.assert_array_equal(sphere.run(plain, ITERATIONS, gradients=gradients), solutions)
    for place in ("archive", "result_archive"):
        if place == "result_archive" or name not in sphere.ELITES_OF_RESULT:
            ours, theirs = getattr(search, place).data(), getattr(plain, place).data()
            for field, values in theirs.items():
                np.testing.assert_array_equal(ours[field], values)

    births = recording.births().to_pandas()
    assert len(births) == len(solutions)
    objective, measures, _ = sphere.sphere(solutions)
    np.testing.assert_array_equal(births["objective"], objective)
    np.testing.assert_array_equal(births["child_niche"], recording.niches.of(measures))
    children = births[births["parent_uid"].notna()]
    parents = births.loc[children["parent_uid"].astype(int)]
    assert (children["parent_niche"].to_numpy() == parents["child_niche"].to_numpy()).all()
    assert (children["step"].to_numpy() > parents["step"].to_numpy()).all()
    if name != "me_map_elites":
        # Emitters of a bandit that begin later begin without a parent.
        assert births["parent_uid"].notna()[births["step"] > 0].all()
    assert children.shape[0] >= len(births) / 2

    cells, uid, _ = recording.elites()
    data = recording.home.data()
    np.testing.assert_array_equal(cells, data["index"])
    np.testing.assert_array_equal(solutions[uid], data["solution"])

    archive = from_ribs(recording, tmp_path / "archive")
    assert archive.meta.births == len(solutions)
    assert nc.l_evolvability(archive.chain(), niche=int(archive.elites.niche[0]), l=2, lineages=5).value >= 1


@pytest.mark.parametrize("name", ["og_map_elites", "omg_mega"])
def test_branches_come_from_the_points_that_they_branch_at(name):
    search = sphere.scheduler(name)
    recording = record(search)
    solutions = sphere.run(search, 4, gradients=True)
    births = recording.births().to_pandas()
    size = sphere.BATCH
    for iteration in range(4):
        first = 2 * size * iteration
        branches = births["parent_uid"][first + size : first + 2 * size]
        assert branches.tolist() == list(range(first, first + size))
    if name == "omg_mega":
        # Without noise a point is the elite that was drawn for it.
        points = births["step"].isin([2, 4, 6])
        parents = births["parent_uid"][points].astype(int)
        np.testing.assert_array_equal(solutions[points], solutions[parents])
    assert recording.conventions() == [
        {
            "emitter": "GradientOperatorEmitter",
            "parent": "the elite that was drawn; of a branch, the solution that it branches at",
        }
    ]


def test_a_strategy_that_restarts_in_a_novelty_search_comes_from_the_elite_it_restarts_from():
    archive, result = sphere.near(), sphere.grid()
    emitter = sphere.strategy(
        archive, x0=np.zeros(sphere.DIM), batch_size=sphere.BATCH, ranker="nov", restart_rule=2, seed=3
    )
    search = sphere.Scheduler(archive, [emitter], result)
    recording = record(search)
    means, solutions = [], []
    for _ in range(7):
        means.append(emitter._opt.mean.copy())
        solutions.append(search.ask().copy())
        search.tell(*sphere.sphere(solutions[-1])[:2])
    assert emitter.restarts >= 3
    everything = np.concatenate(solutions)
    parents = recording.births()["parent_uid"].to_numpy().reshape(7, sphere.BATCH)
    for iteration in (2, 4, 6):
        np.testing.assert_array_equal(everything[int(parents[iteration, 0])], means[iteration])


def test_a_novelty_search_without_objective_or_result_archive_is_counted_in_given_niches():
    archive = sphere.near()
    emitter = sphere.gaussian(archive, x0=np.zeros(sphere.DIM), batch_size=sphere.BATCH, seed=3)
    search = sphere.Scheduler(archive, [emitter])
    niches = nc.GridNiches((5, 5), sphere.RANGES)
    recording = record(search, niches=niches)
    solutions = []
    for _ in range(6):
        solutions.append(search.ask().copy())
        search.tell(None, sphere.sphere(solutions[-1])[1])
    solutions = np.concatenate(solutions)
    births = recording.births().to_pandas()
    assert births["objective"].isna().all()
    np.testing.assert_array_equal(births["child_niche"], niches.of(sphere.sphere(solutions)[1]))
    assert births["parent_uid"].notna().sum() == 5 * sphere.BATCH
    # The first birth of a niche is its elite, as nothing says that another is better.
    first = births.drop_duplicates("child_niche").index
    assert sorted(recording.elites()[1]) == sorted(first)
    assert births["accepted"].sum() == len(first)
