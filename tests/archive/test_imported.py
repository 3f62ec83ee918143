"""Logs of other searches as archives."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import nichechain as nc
from nichechain.archive import Axes, Columns, import_births
from nichechain.core.errors import ArchiveError, NichechainError

GRID = nc.GridNiches((4, 3), ((-1.0, 1.0), (-1.0, 1.0)))
NATIVE = Columns(run="run", uid="uid", elite="parent_uid", step="step")


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    folder = tmp_path_factory.mktemp("importing") / "arm"
    config = nc.BuildConfig("arm", GRID.shape, GRID.bounds, evaluations=400, initial=50, batch=25, scale=0.5)
    with nc.Threads(1) as threads:
        nc.build(config, folder, threads)
    return nc.load(folder)


def written(frame, path):
    frame.to_csv(path, index=False) if path.suffix == ".csv" else frame.to_parquet(path)
    return path


@pytest.mark.parametrize("kind", [".csv", ".parquet"])
def test_an_archive_survives_its_own_log(arm, tmp_path, kind):
    log = written(arm.births(), tmp_path / f"log{kind}")
    import_births(log, tmp_path / "in", GRID, columns=NATIVE)
    archive = nc.load(tmp_path / "in")
    np.testing.assert_array_equal(archive.counts.matrix.toarray(), arm.counts.matrix.toarray())
    np.testing.assert_array_equal(archive.counts.visits, arm.counts.visits)
    np.testing.assert_array_equal(archive.counts.families, arm.counts.families)
    np.testing.assert_array_equal(archive.counts_of(steps=(1, 3)).visits, arm.counts_of(steps=(1, 3)).visits)
    assert archive.chain().estimator == arm.chain().estimator
    frame, native = archive.births(), arm.births()
    for name in ("run", "uid", "parent_uid", "parent_niche", "child_niche", "step", "failed"):
        assert frame[name].equals(native[name]), name
    assert frame[["depth", "objective", "accepted", "behavior_axis_0"]].isna().all(axis=None)


def test_behavior_in_place_of_niches(arm, tmp_path):
    births = arm.births()
    parents = births.set_index("uid").reindex(births["parent_uid"])
    frame = pd.DataFrame(
        {
            "px": parents["behavior_x"].to_numpy(),
            "py": parents["behavior_y"].to_numpy(),
            "x": births["behavior_x"],
            "y": births["behavior_y"],
        }
    )
    frame.loc[7, "x"] = np.nan
    log = written(frame, tmp_path / "log.parquet")
    import_births(log, tmp_path / "in", GRID, columns=Columns(("px", "py"), ("x", "y")), axes=Axes(unit="m"))
    archive = nc.load(tmp_path / "in")
    again = archive.births()
    expected = births["child_niche"].astype(object).where(births.index != 7)
    assert again["child_niche"].isna()[7]
    assert again["failed"][7] == "the log has no child"
    assert again["child_niche"].drop(7).tolist() == expected.drop(7).tolist()
    assert again["parent_niche"].equals(births["parent_niche"])
    assert again["behavior_x"].drop(7).tolist() == births["behavior_x"].drop(7).tolist()
    assert archive.meta.facts.behavior_names == ("x", "y")
    assert archive.meta.facts.unit == "m"
    # The log does not say whose children births are.
    assert len(archive.counts.families) == 0


def test_runs_are_told_apart_whatever_they_are_called(tmp_path):
    frame = pd.DataFrame(
        {"parent_niche": [0, 0, 0, 1], "child_niche": [1, 2, 3, 12], "seed": ["b", "a", "b", "a"]}
    )
    import_births(written(frame, tmp_path / "log.csv"), tmp_path / "in", GRID, columns=Columns(run="seed"))
    archive = nc.load(tmp_path / "in")
    births = archive.births()
    assert births["run"].tolist() == [1, 0, 1, 0]
    assert births["uid"].tolist() == [0, 0, 1, 1]
    assert archive.counts.births_outside == 1
    assert archive.counts_of(run=0).visits.sum() == 2


FRAME = pd.DataFrame(
    {"parent_niche": [-1, 0, 0, 1], "child_niche": [1, 2, 3, 12], "worth": [0.5, 1, None, 3]}
)
WORTH = Columns(objective="worth")


def _as_csv_gz(folder):
    FRAME.to_csv(folder / "log.csv.gz", index=False)
    return folder / "log.csv.gz"


def _as_folder(folder):
    for number, rows in enumerate((FRAME[:1], FRAME[1:3], FRAME[3:])):
        (folder / "log").mkdir(exist_ok=True)
        rows.to_parquet(folder / "log" / f"part-{number}.parquet")
    return folder / "log"


def _as_table(folder):
    del folder
    return pa.Table.from_pandas(FRAME)


@pytest.mark.parametrize("given", [_as_csv_gz, _as_folder, _as_table, lambda _: FRAME])
def test_a_log_may_be_zipped_in_pieces_or_a_table(given, tmp_path):
    import_births(given(tmp_path), tmp_path / "in", GRID, columns=WORTH)
    archive = nc.load(tmp_path / "in")
    births = archive.births()
    # No parent is null or -1.
    assert births["parent_niche"].isna().tolist() == [True, False, False, False]
    assert births["child_niche"].tolist() == [1, 2, 3, 12]
    assert births["objective"].fillna(-1).tolist() == [0.5, 1, -1, 3]
    assert archive.meta.facts.objective_name == "worth"
    assert len(archive.meta.origin["sha256"]) == 64


def test_no_parent_may_be_minus_one_as_a_number_too(tmp_path):
    frame = FRAME.assign(elite=[-1, 0, 0, 1])
    import_births(frame, tmp_path / "in", GRID, columns=Columns(elite="elite"))
    assert nc.load(tmp_path / "in").births()["parent_uid"].fillna(-1).tolist() == [-1, 0, 0, 1]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("fixed", [True, False])
def test_behavior_in_a_column_of_lists(tmp_path, dtype, fixed):
    behavior = np.random.default_rng(0).uniform(-1.2, 1.2, (20, 2)).astype(dtype)
    rows = [*behavior.tolist()[:-1], None]
    value = pa.from_numpy_dtype(dtype)
    column = pa.array(rows, pa.list_(value, 2) if fixed else pa.list_(value))
    table = pa.table({"parent": pa.array([None, *[3] * 19]), "descriptor": column})
    import_births(table, tmp_path / "in", GRID, columns=Columns("parent", ("descriptor",)))
    archive = nc.load(tmp_path / "in")
    births = archive.births()
    assert births["child_niche"][:-1].tolist() == GRID.of(behavior[:-1]).tolist()
    assert births["failed"][19] == "the log has no child"
    np.testing.assert_array_equal(births[["behavior_axis_0", "behavior_axis_1"]][:-1], behavior[:-1])


def test_lists_have_a_number_for_each_axis(tmp_path):
    table = pa.table({"parent": [0, 1], "d": [[0.1, 0.2], [0.1, 0.2, 0.3]]})
    with pytest.raises(NichechainError, match="row 2 has 3 numbers in d, but must have 2, one for each axis"):
        import_births(table, tmp_path / "in", GRID, columns=Columns("parent", ("d",)))


def test_what_was_imported_may_be_replaced_and_nothing_else(arm, tmp_path):
    import_births(FRAME, tmp_path / "in", GRID)
    import_births(FRAME[:2], tmp_path / "in", GRID, overwrite=True)
    assert nc.load(tmp_path / "in").meta.births == 2
    with pytest.raises(NichechainError, match="no column 'gone'"):
        import_births(FRAME, tmp_path / "in", GRID, columns=Columns("gone"), overwrite=True)
    assert nc.load(tmp_path / "in").meta.births == 2
    with pytest.raises(ArchiveError, match="was not imported, which is not overwritten"):
        import_births(FRAME, arm.folder, GRID, overwrite=True)
    assert nc.load(arm.folder).meta.births == 400


def test_pieces_that_do_not_belong_together_are_named(tmp_path):
    folder = _as_folder(tmp_path)
    pd.DataFrame({"parent_niche": ["a"], "child_niche": [1]}).to_parquet(folder / "part-9.parquet")
    with pytest.raises(NichechainError, match="has files that do not belong together"):
        import_births(folder, tmp_path / "in", GRID)
    (tmp_path / "empty").mkdir()
    with pytest.raises(NichechainError, match=r"is a folder without a \.parquet file"):
        import_births(tmp_path / "empty", tmp_path / "in", GRID)


@pytest.mark.parametrize("niches", [GRID, nc.CVTNiches.tessellated(9, GRID.bounds, outside="clip")])
def test_births_know_their_niches(niches, tmp_path):
    frame = pd.DataFrame({"parent_niche": [None, 0, 0, 1], "child_niche": [1, 2, 3, 8], "step": [0, 1, 1, 2]})
    import_births(frame, tmp_path / "in", niches, columns=Columns(step="step"))
    archive = nc.load(tmp_path / "in")
    births = archive.births()
    counts = nc.TransitionCounts.from_births(births)
    assert counts.niches == niches
    assert (counts.matrix != archive.counts.matrix).nnz == 0
    np.testing.assert_array_equal(counts.visits, archive.counts.visits)
    assert nc.TransitionCounts.from_births(births[births["step"] == 1]).births.sum() == 2
    # A frame that is written and read again knows them too.
    births.to_parquet(tmp_path / "births.parquet")
    assert nc.TransitionCounts.from_births(pd.read_parquet(tmp_path / "births.parquet")).niches == niches
    births.attrs.clear()
    with pytest.raises(NichechainError, match="a table of births comes with its niches alone"):
        nc.TransitionCounts.from_births(births)


def test_what_an_imported_archive_cannot_do(tmp_path):
    frame = pd.DataFrame({"parent_niche": [0, 0], "child_niche": [1, 2]})
    log = written(frame, tmp_path / "log.csv")
    import_births(log, tmp_path / "in", GRID)
    archive = nc.load(tmp_path / "in")
    assert repr(archive) == f"Archive({str(tmp_path / 'in')!r}: 2 imported births)"
    with pytest.raises(ArchiveError, match="domain is not known"):
        _ = archive.domain
    with pytest.raises(ArchiveError, match="operator is not known"):
        _ = archive.mutate
    with pytest.raises(ArchiveError, match="births but no elites"):
        archive.elite(1)
    with pytest.raises(ArchiveError, match="already holds an archive"):
        import_births(log, tmp_path / "in", GRID)
    assert archive.meta.origin["file"] == "log.csv"
    assert archive.meta.complete


GOOD = {"parent_niche": [0, 1, 2], "child_niche": [1, 2, 3]}


@pytest.mark.parametrize(
    ("values", "columns", "said"),
    [
        ({}, Columns(parent="from"), "has no column 'from': it has parent_niche, child_niche"),
        ({"child_niche": [1, 2, 13]}, Columns(), "row 3 has child_niche 13, but states run from 0 to 12"),
        ({"parent_niche": [0, -2, 2]}, Columns(), "row 2 has parent_niche -2, but must not be negative"),
        ({"child_niche": [1, 2.5, 3]}, Columns(), "row 2 has child_niche 2.5, but must have a whole number"),
        ({"child_niche": ["a", "b", "c"]}, Columns(), "column 'child_niche' has values of type"),
        ({"uid": [1, 1, 2]}, Columns(uid="uid"), "row 2 has uid 1 again"),
        ({"uid": [1, None, 2]}, Columns(uid="uid"), "row 2 has no uid"),
        ({"run": ["a", None, "b"]}, Columns(run="run"), "row 2 has no run"),
        ({"elite": [1, None, 2]}, Columns(elite="elite"), "row 2 has a parent's niche but no elite"),
        ({"step": [2**40, 0, 0]}, Columns(step="step"), "a number is too large"),
        ({"x": [0.0, 1.0, 2.0]}, Columns(child=("x",)), "behavior has columns x, but the grid has 2 axes"),
        ({"x": [0.0, np.inf, 2.0]}, Columns(child=("x", "x")), "row 2 has an infinite behavior"),
    ],
)
def test_bad_logs(tmp_path, values, columns, said):
    log = written(pd.DataFrame({**GOOD, **values}), tmp_path / "log.parquet")
    with pytest.raises(NichechainError, match=said) as caught:
        import_births(log, tmp_path / "in", GRID, columns=columns)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "in").exists()


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("log.txt", b"", "neither a .csv, .csv.gz or .parquet file"),
        ("log.parquet", b"abc", "cannot be read as PARQUET"),
        ("log.csv", b"", "cannot be read as CSV"),
        ("log.csv", b"parent_niche,child_niche\n", "has no rows"),
        ("log.csv", b"parent_niche,child_niche\n1\n", "cannot be read as CSV"),
    ],
)
def test_files_that_are_no_logs(tmp_path, name, content, said):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(NichechainError, match=said):
        import_births(tmp_path / name, tmp_path / "in", GRID)


def test_names_of_axes_are_as_many_as_axes(tmp_path):
    log = written(pd.DataFrame(GOOD), tmp_path / "log.csv")
    with pytest.raises(NichechainError, match="axes are x, y, z, but the grid has 2"):
        import_births(log, tmp_path / "in", GRID, axes=Axes(("x", "y", "z")))


@pytest.mark.parametrize(
    ("columns", "how", "said"),
    [
        ({"x0": [0.1, np.nan], "y0": [0.1, 0.2]}, {}, "row 2 has only some of x0, y0: give all or none"),
        ({"run": [1.0, np.nan]}, {"run": "run"}, "row 2 has no run"),
        ({"run": [[1], [2]]}, {"run": "run"}, "column 'run' has values of type list"),
        ({"run": [{"a": 1}, {"a": 2}]}, {"run": "run"}, "column 'run' has values of type struct"),
        ({"uid": np.array([1, 2**64 - 1], np.uint64)}, {"uid": "uid"}, "less than 2\\*\\*63"),
        (
            {"uid": [1.0, 1e300]},
            {"uid": "uid"},
            r"row 2 has uid 1e\+300, but must have a whole",
        ),
    ],
)
def test_what_stands_in_a_column_is_said(tmp_path, columns, how, said):
    frame = pd.DataFrame({"x0": [0.1, 0.2], "y0": [0.1, 0.2], "child": [3, 4], **columns})
    log = written(frame, tmp_path / "log.parquet")
    with pytest.raises(NichechainError, match=said):
        import_births(log, tmp_path / "a", GRID, columns=Columns(parent=("x0", "y0"), child="child", **how))


def test_a_column_that_is_there_twice(tmp_path):
    (tmp_path / "log.csv").write_text("parent,child,child\n1,3,0\n2,4,1\n")
    with pytest.raises(NichechainError, match="column 'child' more than once"):
        import_births(tmp_path / "log.csv", tmp_path / "a", GRID, columns=Columns("parent", "child"))


def test_as_many_runs_as_births(tmp_path):
    """Numbers within runs are made in one go, and runs are numbered in the order of their names."""
    names = np.random.default_rng(0).permutation(50_000).astype(str)
    log = written(pd.DataFrame({"parent": 1, "child": 2, "run": names}), tmp_path / "log.parquet")
    import_births(log, tmp_path / "a", GRID, columns=Columns("parent", "child", run="run"))
    births = nc.load(tmp_path / "a").births()
    assert births.run.tolist() == np.argsort(np.argsort(names)).tolist()
    assert births.uid.eq(0).all()
