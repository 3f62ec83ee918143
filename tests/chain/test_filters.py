"""Counts of some births, against the same births picked with pandas."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from nichechain import GridNiches, NichechainError, TransitionCounts
from nichechain.births.table import schema
from nichechain.chain.filters import counts_of

GRID = GridNiches((2, 2), ((0.0, 1.0), (0.0, 1.0)))


def births(size=300, seed=0):
    """Two runs whose parents bear the same numbers, some of them null."""
    rng = np.random.default_rng(seed)
    initial, failed = rng.random(size) < 0.1, rng.random(size) < 0.1
    states = rng.integers(5, size=(2, size))
    frame = pd.DataFrame(
        {
            "run": rng.integers(2, size=size),
            "uid": np.arange(size),
            "parent_uid": pd.array(
                np.where(initial, -1, 3 * states[0] + rng.integers(3, size=size)), "Int64"
            ),
            "depth": 0,
            "parent_niche": pd.array(states[0], "Int32"),
            "child_niche": pd.array(states[1], "Int32"),
            "behavior_0": 0.0,
            "behavior_1": 0.0,
            "objective": 0.0,
            "accepted": rng.random(size) < 0.5,
            "failed": pd.array([None] * size, "string"),
            "step": np.arange(size) // 30,
            "lineage": rng.random(size) < 0.3,
        }
    )
    frame.loc[initial, ["parent_uid", "parent_niche"]] = pd.NA
    frame.loc[failed, "child_niche"] = pd.NA
    return frame


def table(frame):
    return pa.Table.from_pandas(frame, schema=schema(2), preserve_index=False)


@pytest.mark.parametrize(
    ("options", "kept"),
    [
        ({}, lambda f: f["uid"] >= 0),
        ({"run": 1}, lambda f: f["run"] == 1),
        ({"steps": (2, 5)}, lambda f: (f["step"] >= 2) & (f["step"] < 5)),
        ({"accepted": True}, lambda f: f["accepted"]),
        ({"lineages": True}, lambda f: f["lineage"]),
        ({"lineages": False}, lambda f: ~f["lineage"]),
        (
            {"run": 0, "steps": (0, 1), "accepted": True},
            lambda f: (f["run"] == 0) & (f["step"] == 0) & f["accepted"],
        ),
    ],
)
def test_are_those_of_the_births_kept(options, kept):
    frame = births()
    counts = counts_of(table(frame), GRID, **options)
    some = frame[kept(frame)]
    born = some.dropna(subset=["child_niche"])
    # Births of lineages are kept apart, unless it is they that are asked for.
    moved = born.dropna(subset=["parent_niche"])
    moved = moved[~moved["lineage"] | ("lineages" in options)]
    expected = np.zeros((5, 5), int)
    np.add.at(expected, (moved["parent_niche"].to_numpy(int), moved["child_niche"].to_numpy(int)), 1)
    np.testing.assert_array_equal(counts.matrix.toarray(), expected)
    np.testing.assert_array_equal(counts.visits, np.bincount(born["child_niche"].to_numpy(int), minlength=5))
    # One family for each elite of each run and each niche of its children.
    sizes = moved.groupby(["parent_niche", "run", "parent_uid", "child_niche"]).size()
    assert sorted(counts.families[:, 3]) == sorted(sizes)
    owners = moved.groupby(["run", "parent_uid"]).ngroups
    assert np.unique(counts.families[:, 1]).size == owners


def test_runs_add_up_to_all():
    rows = table(births())
    whole = counts_of(rows, GRID)
    parts = counts_of(rows, GRID, run=0) + counts_of(rows, GRID, run=1)
    np.testing.assert_array_equal(parts.matrix.toarray(), whole.matrix.toarray())
    assert len(parts.families) == len(whole.families)


def test_parents_that_are_not_known_make_no_families():
    frame = births()
    frame["parent_uid"] = pd.NA
    counts = counts_of(table(frame), GRID)
    assert isinstance(counts, TransitionCounts)
    assert len(counts.families) == 0
    assert counts.births.sum() > 0


@pytest.mark.parametrize(
    ("options", "column", "said"),
    [
        ({"run": 2}, None, "run is 2, but there are runs 0 to 1"),
        ({"steps": (3, 3)}, None, "steps are 3 to 3"),
        ({"steps": (-1, 3)}, None, "steps are -1 to 3"),
        ({"steps": (0, 3)}, "step", "300 births do not say their step"),
        ({"accepted": True}, "accepted", "300 births do not say whether they were accepted"),
    ],
)
def test_bad_choices(options, column, said):
    frame = births()
    if column:
        frame[column] = pd.NA
    with pytest.raises(NichechainError, match=said):
        counts_of(table(frame), GRID, **options)
