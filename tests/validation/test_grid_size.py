"""The sweep over grid sizes, against births counted by hand and a chain that is known."""

import json
import math

import numpy as np
import pytest
from matplotlib.figure import Figure

import nichechain as nc
from nichechain.archive import Columns, import_births
from nichechain.chain.structure import stationary_distribution
from nichechain.cli import sweep as command
from nichechain.cli.sweep import parse_sizes
from nichechain.core.errors import NichechainError
from nichechain.niches import GridNiches
from nichechain.plots.validation import plot_filling, plot_scores, plot_surprise
from nichechain.validation.grid_size import (
    GridSize,
    Sweep,
    _entropy,
    _information,
    _known,
    default_sizes,
    sweep,
)


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep") / "arm"
    config = nc.BuildConfig(
        "arm", (8, 8), ((-1, 0.9), (-1, 1)), evaluations=1500, scale=0.2, lineage_share=0.0
    )
    with nc.Threads(1) as threads:
        nc.build(config, folder, threads)
    return nc.load(folder)


@pytest.fixture(scope="module")
def found(archive):
    return sweep(archive, (16, 2, (4, 3), 8), l=3, lineages=20, draws=3)


def _grid(**values):
    plain = dict.fromkeys(GridSize.__dataclass_fields__, 0.5)
    return GridSize(**{**plain, "shape": (2, 2), "niches": 4, **values})


def _sweep(*grids):
    return Sweep(grids, (0.0, 0.0), 100, (8, 8), 5, 100, 20)


def test_the_search_s_own_grid_has_the_archive_s_own_counts(archive, found):
    own = next(grid for grid in found.grids if grid.shape == (8, 8))
    counts = archive.counts
    births = counts.births[:64]
    assert own.visited == pytest.approx(1 - counts.never_filled / 64)
    assert own.rows_observed == counts.rows_observed / 64
    assert own.births_per_row == np.median(births[births > 0])
    stay = counts.matrix.diagonal()[:64]
    assert own.staying == stay.sum() / births.sum()
    assert own.self_transition == pytest.approx((stay[births > 0] / births[births > 0]).mean())
    chain = archive.chain()
    mass = stationary_distribution(chain)[0, :64]
    assert own.known == pytest.approx(mass[births >= 20].sum() / mass.sum(), rel=1e-6)
    root = int(archive.niches.of([found.behavior])[0])
    assert own.evolvability == nc.l_evolvability(chain, niche=root, l=3, lineages=20, draws=3).value
    assert (found.built, found.births) == ((8, 8), 1500)


def test_grids_are_ordered_and_show_the_warning(found):
    assert [grid.shape for grid in found.grids] == [(2, 2), (4, 3), (8, 8), (16, 16)]
    frame = found.to_frame()
    assert frame["shape"].tolist() == ["2x2", "4x3", "8x8", "16x16"]
    # Too few niches: children stay. Too many: most are never visited.
    assert (np.diff(frame["staying"]) < 0).all()
    assert (np.diff(frame["visited"]) <= 0).all()
    assert (np.diff(frame["births_per_row"]) < 0).all()


def test_the_behavior_is_that_of_the_parent_with_most_children(archive, found):
    births = archive.births()
    inside = births["child_niche"] < 64
    mothers = births.loc[births["uid"].isin(births.loc[inside, "uid"])].set_index("uid")
    children = births["parent_uid"].value_counts()
    children = children[[uid for uid in children.index if mothers["child_niche"].get(uid, 64) < 64]]
    assert children[mothers.loc[children.index, "behavior_x"] == found.behavior[0]].iloc[0] == children.max()


def test_known_is_the_stationary_mass_of_rows_with_births():
    niches = GridNiches((3,), ((0.0, 3.0),), "clip")
    counts = nc.TransitionCounts.from_pairs([0] * 30 + [1] * 5, [1] * 30 + [0] * 5, niches)
    T = np.array([[0.0, 1.0, 0.0], [0.5, 0.25, 0.25], [1.0, 0.0, 0.0]])
    mass = np.linalg.matrix_power(T, 200)[0]
    assert _known(nc.NicheChain(T), counts, 20) == pytest.approx(mass[0])
    assert _known(nc.NicheChain(T), counts, 5) == pytest.approx(mass[:2].sum())


def test_entropy_of_a_row_is_shannon_s_with_the_correction_for_few_births():
    niches = GridNiches((4,), ((0.0, 4.0),), "clip")
    counts = nc.TransitionCounts.from_pairs([0] * 8 + [1] * 4, [0, 0, 1, 1, 2, 2, 3, 3, 2, 2, 2, 2], niches)
    # 2 bits in 8 births over 4 states, none in 4 births in one state.
    assert _entropy(counts) == pytest.approx((8 * 2 + 3 / (2 * math.log(2))) / 12)


def test_information_is_that_of_the_parent_s_niche():
    rng = np.random.default_rng(0)
    niches = GridNiches((4,), ((0.0, 4.0),), "clip")
    parent = np.repeat(rng.integers(4, size=600), 10)
    elite = np.repeat(np.arange(600), 10)
    told = nc.TransitionCounts.from_births(parent, 3 - parent, niches, elite=elite)
    untold = nc.TransitionCounts.from_births(parent, rng.integers(4, size=6000), niches, elite=elite)
    # Four niches alike: the parent's tells all of 2 bits, or nothing.
    assert _information(told, 5, 0) == pytest.approx(2.0, abs=0.02)
    assert _information(untold, 5, 0) == pytest.approx(0.0, abs=0.01)
    few = nc.TransitionCounts.from_births([0, 0], [1, 1], niches, elite=[0, 0])
    assert math.isnan(_information(few, 5, 0))


@pytest.mark.parametrize(
    ("grids", "suggested"),
    [
        ([_grid(shape=(2, 2), known=1.0), _grid(shape=(4, 4), known=0.95)], (4, 4)),
        ([_grid(shape=(2, 2), known=1.0), _grid(shape=(4, 4), known=0.85)], (2, 2)),
        ([_grid(shape=(2, 2), known=1.0), _grid(shape=(4, 4), known=0.95, rows_observed=0.45)], (2, 2)),
        # Fine, but children stay: coarser grids are worse.
        ([_grid(shape=(2, 2), known=1.0), _grid(shape=(4, 4), known=0.95, staying=0.6)], None),
        ([_grid(known=0.4)], None),
    ],
)
def test_the_rule(grids, suggested):
    found = _sweep(*grids)
    assert (None if found.suggestion is None else found.suggestion.shape) == suggested
    if suggested is None:
        assert found.advice.startswith("none of these grids")
        assert found.advice.endswith("needed")
    else:
        assert found.advice.startswith("x".join(map(str, suggested)))


def test_births_over_a_tessellation_are_binned_into_grids(tmp_path):
    config = nc.BuildConfig("arm", (30,), ((-1, 1), (-1, 1)), evaluations=600, scale=0.2, niches="cvt")
    with nc.Threads(1) as threads:
        nc.build(config, tmp_path, threads)
    found = sweep(nc.load(tmp_path), (3, 6), l=2, lineages=5, draws=2)
    assert found.built is None
    assert [grid.niches for grid in found.grids] == [9, 36]


@pytest.mark.parametrize(
    ("axes", "first", "last"), [(1, 4, 3200), (2, 2, 57), (3, 2, 15), (5, 2, 5), (12, 2, 2)]
)
def test_default_sizes_are_4_to_3200_niches_in_any_number_of_axes(axes, first, last):
    sizes = default_sizes(axes)
    assert sizes == sorted(set(sizes))
    assert (sizes[0], sizes[-1]) == (first, last)
    assert len(sizes) <= 10


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (((),), {}, "there are no sizes"),
        (((0,),), {}, "at least 1 cell"),
        ((((3, 3, 3),),), {}, "3 axes but bounds have 2"),
        (((3,),), {"behavior": (0.1,)}, "behavior has 1 numbers"),
        (((3,),), {"behavior": (0.1, 2.0)}, "behavior is 0.1, 2, which is out of the archive's bounds"),
        (((3,),), {"l": 0}, "l is 0"),
    ],
)
def test_sweep_refuses(archive, arguments, options, message):
    with pytest.raises(NichechainError, match=message):
        sweep(archive, *arguments, **options)


def test_births_without_behavior_or_parents_cannot_be_binned(archive, tmp_path):
    births = archive.births()
    births.to_csv(tmp_path / "log.csv", index=False)
    import_births(tmp_path / "log.csv", tmp_path / "states", archive.niches)
    with pytest.raises(NichechainError, match="births without behavior"):
        sweep(nc.load(tmp_path / "states"), (3,))
    places = Columns(child=("behavior_x", "behavior_y"))
    import_births(tmp_path / "log.csv", tmp_path / "orphans", archive.niches, columns=places)
    with pytest.raises(NichechainError, match="do not say who their parents are"):
        sweep(nc.load(tmp_path / "orphans"), (3,))
    whole = Columns(child=("behavior_x", "behavior_y"), uid="uid", elite="parent_uid")
    import_births(tmp_path / "log.csv", tmp_path / "whole", archive.niches, columns=whole)
    imported = sweep(nc.load(tmp_path / "whole"), (8,), l=2, lineages=5, draws=2)
    assert imported.grids[0].staying == sweep(archive, (8,), l=2, lineages=5, draws=2).grids[0].staying


def test_pictures_show_the_table(found):
    frame = found.to_frame()
    for plot, names in (
        (plot_filling, ("staying", "self_transition", "visited", "rows_observed", "known")),
        (plot_surprise, ("entropy", "information")),
        (plot_scores, ("evolvability",)),
    ):
        ax = Figure().add_subplot()
        assert plot(found, ax) is ax
        curves = [line.get_xydata() for line in ax.lines if len(line.get_xdata()) == len(frame)]
        for name in names:
            assert any(np.array_equal(curve, frame[["niches", name]]) for curve in curves)
        assert [text.get_text() for text in ax.get_xticklabels()] == ["2×2", "4×3", "8×8", "16×16"]


def test_command_line(archive, tmp_path, capsys):
    picture = tmp_path / "sweep.png"
    asked = [str(archive.folder), "--sizes", "2,4x3", "--l", "2", "--draws", "2"]
    assert command.run([*asked, "--out", str(picture)]) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")
    shown = capsys.readouterr().out
    assert "Suggestion" in shown
    assert "4x3" in shown
    assert command.run([*asked, "--json", "--behavior", "0.5,0.5"]) == 0
    read = json.loads(capsys.readouterr().out)
    assert [grid["niches"] for grid in read["grids"]] == [4, 12]
    assert read["behavior"] == [0.5, 0.5]


def test_parse_sizes():
    assert parse_sizes("5,10x20,7") == [5, (10, 20), 7]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--sizes", "5,,7"], "--sizes is '5,,7'"),
        (["--sizes", "0"], "--sizes is '0'"),
        (["--sizes", "5x"], "--sizes is '5x'"),
        (["--behavior", "a,b"], "--behavior is 'a,b'"),
        (["--draws", "0"], "--draws is 0"),
        (["--min-births", "0"], "--min-births is 0"),
        (["--seed", "-1"], "--seed is -1"),
        (["--out", "x.gif"], "--out is 'x.gif'"),
        (["--out", "nowhere/x.png"], "there is no folder nowhere"),
    ],
)
def test_command_line_refuses(archive, options, message):
    with pytest.raises(NichechainError, match=message):
        command.run([str(archive.folder), *options])
