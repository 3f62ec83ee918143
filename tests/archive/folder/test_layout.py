"""What a build leaves in its folder."""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from nichechain.archive import read, write

from .samples import (
    CONFIG,
    built,
    edited,
    elites_name,
    part_names,
    written,
)


def test_files_of_an_archive(pristine: dict[str, bytes]) -> None:
    assert list(pristine) == [
        "births/part-000000-00200.parquet",
        "births/part-000001-00200.parquet",
        "births/part-000002-00050.parquet",
        "elites-000000450.npz",
        "meta.json",
    ]
    meta = json.loads(pristine["meta.json"])
    assert meta["births"] == 450
    for entry in (meta["elites"], *meta["parts"]):
        assert hashlib.sha256(pristine[entry["file"]]).hexdigest() == entry["sha256"]
    assert [part["rows"] for part in meta["parts"]] == [200, 200, 50]


def test_parts_are_parquet_that_anything_reads(pristine: dict[str, bytes]) -> None:
    tables = [pq.read_table(io.BytesIO(pristine[name])) for name in part_names(pristine)]
    assert [uid for table in tables for uid in table["uid"].to_pylist()] == list(range(450))


def test_how_births_are_cut_into_parts_does_not_matter(
    pristine: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = written(tmp_path / "small", pristine)
    expected = read.read_births(folder, read.read_meta(folder))
    for rows in (1000, 450, 100, 63):
        monkeypatch.setattr(write, "PART_ROWS", rows)
        files = built(tmp_path / str(rows))
        assert len(part_names(files)) == -(-450 // rows)
        assert files[elites_name(files)] == pristine[elites_name(pristine)]
        table = read.read_births(tmp_path / str(rows), read.read_meta(tmp_path / str(rows)))
        assert table.equals(expected)


def test_full_parts_are_final(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, pristine)
    longer = built(folder, replace(CONFIG, evaluations=700))
    first, second, tail = part_names(pristine)
    assert longer[first] == pristine[first]
    assert longer[second] == pristine[second]
    assert tail not in longer


def test_state_comes_back_as_it_was(pristine: dict[str, bytes], tmp_path: Path) -> None:
    """Elites and the pending children of a batch that the budget cut."""
    folder = written(tmp_path, pristine)
    state = read.read_state(folder, read.read_meta(folder))
    assert (state.births, state.step) == (450, 6)
    # Six batches would be 484 births.
    assert state.pending.uid.tolist() == list(range(450, 484))
    assert state.elites.genotype.dtype == state.pending.genotype.dtype == np.float32
    assert state.elites.behavior.dtype == state.elites.objective.dtype == np.float64
    # The children that wait are those that a larger budget would have had.
    built(folder, replace(CONFIG, evaluations=484))
    births = read.read_births(folder, read.read_meta(folder)).to_pydict()
    assert births["parent_uid"][450:] == state.pending.parent_uid.tolist()
    assert births["depth"][450:] == state.pending.depth.tolist()
    assert read.read_state(folder, read.read_meta(folder)).pending.uid.size == 0


def test_a_build_that_is_not_done_says_so(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, pristine)
    assert read.read_meta(folder).complete
    folder = written(tmp_path, edited(pristine, lambda meta: meta["config"].update(evaluations=500)))
    assert not read.read_meta(folder).complete
