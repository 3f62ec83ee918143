"""Archives of pyribs as archives of nichechain, and back."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from ribs.archives import CVTArchive, GridArchive
from ribs.emitters import GaussianEmitter, IsoLineEmitter

import nichechain as nc
from nichechain import ArchiveError, NichechainError
from nichechain.archive.imported import Axes
from nichechain.cli import main
from nichechain.domains import PlanarArm
from nichechain.niches import CVTNiches, GridNiches
from nichechain.pyribs import Recording, from_ribs, record, to_ribs
from nichechain.search.parents import curiosity

from .searches import INITIAL, RANGES, cvt, evaluate, grid, run, search


def recorded(archive, iterations=12, **options):
    settings = {"initial_solutions": INITIAL, "batch_size": 20}
    scheduler = search(
        archive,
        GaussianEmitter(archive, sigma=0.3, seed=3, **settings),
        IsoLineEmitter(archive, iso_sigma=0.1, line_sigma=0.3, seed=4, **settings),
    )
    recording = record(scheduler, **options)
    run(scheduler, iterations)
    return recording


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    # Ranges so narrow that elites of edge cells lie beyond them.
    recording = recorded(grid(ranges=[(-0.4, 0.6), (-0.3, 0.4)]))
    folder = tmp_path_factory.mktemp("recorded") / "archive"
    return recording, from_ribs(recording, folder, axes=Axes(("x", "y"), "arm lengths"))


def test_a_recording_becomes_an_archive_with_births_elites_and_a_chain(made):
    recording, archive = made
    assert archive.meta.births == len(recording) == 80 + 11 * 40
    births = archive.births()
    assert births["parent_uid"].isna().sum() == 80
    assert list(births.columns[6:8]) == ["behavior_x", "behavior_y"]
    # Counts are those of a plain loop over parents and children.
    counts = np.zeros((archive.niches.states, archive.niches.states))
    for row in births.dropna(subset=["parent_niche"]).itertuples():
        counts[row.parent_niche, row.child_niche] += 1
    np.testing.assert_array_equal(archive.counts.matrix.toarray(), counts)
    scores = nc.niche_evolvability(archive.chain(), l=3, lineages=20, draws=5)
    assert 1 <= scores.value.max() <= len(archive.niches)
    assert curiosity(births)["children"].sum() == 11 * 40


def test_elites_of_the_archive_are_those_of_pyribs(made):
    recording, archive = made
    data = recording.archive.data(return_type="dict")
    inside = np.flatnonzero(recording.niches.of(data["measures"]) < len(archive.niches))
    order = inside[np.argsort(data["index"][inside])]
    elites = archive.elites[archive.elites.niche < len(archive.niches)]
    np.testing.assert_array_equal(elites.niche, data["index"][order])
    np.testing.assert_array_equal(elites.behavior, data["measures"][order])
    np.testing.assert_array_equal(elites.objective, data["objective"][order])
    np.testing.assert_array_equal(elites.genotype, data["solution"][order].astype(np.float32))
    births = archive.births()
    assert births["child_niche"][archive.elites.uid].tolist() == archive.elites.niche.tolist()
    elite = archive.elite(int(elites.niche[0]))
    np.testing.assert_array_equal(elite.genotype, elites.genotype[0])


def test_of_elites_out_of_range_the_best_stands_for_the_outside_state(made):
    recording, archive = made
    data = recording.archive.data()
    outside = recording.niches.of(data["measures"]) == len(archive.niches)
    assert outside.sum() > 1
    assert archive.elites.niche[-1] == len(archive.niches)
    assert archive.elites.objective[-1] == data["objective"][outside].max()


def test_the_archive_says_who_counts_as_a_parent(made, capsys):
    _, archive = made
    assert archive.meta.origin["program"].startswith("pyribs 0.12")
    assert archive.meta.origin["emitters"] == [
        {"emitter": "GaussianEmitter", "parent": "the elite that was drawn"},
        {"emitter": "IsoLineEmitter", "parent": "the first of 2 elites that were drawn"},
    ]
    assert main(["info", str(archive.folder)]) == 0
    shown = capsys.readouterr().out
    assert "the first of 2 elites that were drawn" in shown
    assert "pyribs 0.12" in shown


def test_nothing_is_evaluated_or_mutated_by_guess(made):
    _, archive = made
    for name in ("domain", "mutate"):
        with pytest.raises(ArchiveError, match="was imported, so nothing can be"):
            getattr(archive, name)


@pytest.mark.parametrize("make", [grid, cvt])
def test_there_and_back_keeps_the_elites(make, tmp_path):
    recording = recorded(make(), outside="clip")
    archive = from_ribs(recording, tmp_path / "archive")
    back = archive.to_ribs()
    assert type(back) is type(recording.archive)
    assert {"uid", "depth"} <= set(back.field_list)
    ours, theirs = back.data(return_type="dict"), recording.archive.data(return_type="dict")
    mine, yours = np.argsort(ours["index"]), np.argsort(theirs["index"])
    for name in ("index", "objective", "measures"):
        np.testing.assert_array_equal(ours[name][mine], theirs[name][yours])
    np.testing.assert_array_equal(ours["solution"][mine], theirs["solution"][yours].astype(np.float32))
    cells, uid, depth = recording.elites()
    order = np.argsort(cells)
    np.testing.assert_array_equal(ours["uid"][mine], uid[order])
    np.testing.assert_array_equal(ours["depth"][mine], depth[order])
    assert back.stats.obj_max == recording.archive.data("objective").max()


def test_a_finished_archive_has_elites_and_no_parents(tmp_path):
    recording = recorded(grid())
    source = recording.archive
    recording.stop()
    with pytest.warns(UserWarning, match="has its elites and not whom they came from, so T cannot"):
        archive = from_ribs(source, tmp_path / "archive")
    assert archive.niches == GridNiches((7, 6), tuple(RANGES), "clip")
    assert archive.meta.births == archive.filled == len(source)
    assert archive.counts.births.sum() == 0
    assert archive.counts.visits.sum() == len(source)
    np.testing.assert_array_equal(np.sort(source.data("index")), archive.elites.niche)
    again = to_ribs(archive)
    np.testing.assert_array_equal(np.sort(again.data("objective")), np.sort(source.data("objective")))


def test_a_built_archive_is_drawn_by_pyribs(tmp_path):
    from ribs.visualize import grid_archive_heatmap

    config = nc.BuildConfig("arm", (8, 8), PlanarArm.bounds, evaluations=600, scale=0.3)
    with nc.Threads(1) as executor:
        nc.build(config, tmp_path / "arm", executor)
    archive = nc.load(tmp_path / "arm")
    with pytest.warns(UserWarning, match="the elites are a random birth of each niche and not the best"):
        ribs = archive.to_ribs()
    assert isinstance(ribs, GridArchive)
    assert len(ribs) == archive.filled
    occupied, found = ribs.retrieve(archive.niches.centers)
    inside = archive.elites.niche < 64
    np.testing.assert_array_equal(np.flatnonzero(occupied), archive.elites.niche[inside])
    # What decided about replacement was a random key; pyribs gets the objective of the domain.
    np.testing.assert_array_equal(found["objective"][occupied], archive.elites.objective[inside])
    ax = Figure().subplots()
    grid_archive_heatmap(ribs, ax=ax)
    drawn = ax.collections[0].get_array()
    values = np.sort(np.ma.filled(np.ma.masked_invalid(drawn), np.nan).ravel())
    np.testing.assert_allclose(values[: archive.filled], np.sort(ribs.data("objective")))


def test_a_tessellation_is_drawn_by_pyribs(tmp_path):
    from ribs.visualize import cvt_archive_heatmap

    archive = from_ribs(recorded(cvt(), 3), tmp_path / "archive")
    assert isinstance(archive.niches, CVTNiches)
    ribs = archive.to_ribs()
    assert isinstance(ribs, CVTArchive)
    ax = Figure().subplots()
    cvt_archive_heatmap(ribs, ax=ax)
    assert ax.collections or ax.patches


def unrecorded():
    archive = grid()
    return search(archive, GaussianEmitter(archive, sigma=0.1, initial_solutions=INITIAL))


def test_what_is_being_recorded_stands_for_its_recording_and_may_be_written_again(tmp_path):
    scheduler = unrecorded()
    recording = record(scheduler)
    run(scheduler, 4)
    first = from_ribs(scheduler, tmp_path / "archive")
    assert first.meta.births == len(recording)
    run(scheduler, 1)
    again = from_ribs(scheduler.archive, tmp_path / "archive", overwrite=True)
    assert again.meta.births == len(recording) == first.meta.births + 64
    nc.build(
        nc.BuildConfig("arm", (3, 3), PlanarArm.bounds, evaluations=50, initial=50),
        tmp_path / "b",
        nc.Threads(1),
    )
    with pytest.raises(ArchiveError, match="was not imported, which is not overwritten"):
        from_ribs(recording, tmp_path / "b", overwrite=True)
    assert nc.load(tmp_path / "b").meta.births == 50


def test_lost_parents_are_no_secret(tmp_path, capsys):
    archive = grid()
    with Recording(archive) as recording:
        for batch in range(4):
            archive.sample_elites(3) if batch else None
            archive.add(INITIAL + batch / 10, *evaluate(INITIAL + batch / 10))
    with pytest.warns(UserWarning, match="none of 120 births after the first batch has a known parent"):
        found = from_ribs(recording, tmp_path / "archive")
    with pytest.warns(UserWarning, match="none of 120 births after the first batch"):
        found.chain()
    assert main(["info", str(found.folder)]) == 0
    assert "none of 120 births after the first batch has a known parent" in " ".join(
        capsys.readouterr().out.split()
    )


def test_what_cannot_be_converted_is_named(made, tmp_path):
    recording, archive = made
    with pytest.raises(ArchiveError, match="already holds an archive"):
        from_ribs(recording, archive.folder)
    with pytest.raises(NichechainError, match="there are no births yet"):
        from_ribs(grid(), tmp_path / "a")
    with pytest.raises(NichechainError, match="source is a Scheduler that is not being recorded"):
        from_ribs(unrecorded(), tmp_path / "a")
    with pytest.raises(NichechainError, match="axes are x, y, z, but the grid has 2"):
        from_ribs(recording, tmp_path / "b", axes=Axes(("x", "y", "z")))
    with pytest.raises(NichechainError, match="the archive is a list"):
        from_ribs([], tmp_path / "c")
    log = tmp_path / "log.csv"
    log.write_text("parent_niche,child_niche\n,1\n1,2\n")
    from nichechain.archive.imported import import_births

    import_births(log, tmp_path / "d", GridNiches((2, 2), ((0, 1), (0, 1))))
    with pytest.raises(NichechainError, match="has no elites in its niches"):
        nc.load(tmp_path / "d").to_ribs()
