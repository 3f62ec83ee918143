"""Merged archives are verified run by run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from nichechain.archive.archive import Archive, load
from nichechain.archive.merge import merge
from nichechain.core.errors import ArchiveError
from nichechain.verification import verify

from ..arms import RoughArm
from .conftest import CONFIG, built
from .forgeries import Forgery, found, nudged, one_weight_off


@pytest.fixture(scope="module")
def merged(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    folder = tmp_path_factory.mktemp("merged")
    built(folder / "5")
    built(folder / "6", replace(CONFIG, seed=6, evaluations=200, batch=20))
    merge([folder / "5", folder / "6"], folder / "both")
    built(folder / "7", replace(CONFIG, seed=7, evaluations=100))
    merge([folder / "7", folder / "both"], folder / "all")
    return load(folder / "all", domain=RoughArm())


def test_merged_archives_are_verified_run_by_run(merged: Archive) -> None:
    result = verify(merged, sample=None)
    assert result.ok, found(result)
    assert not result.unverified
    assert result.sampled_births == 100 + 333 + 200


@pytest.mark.parametrize("first", [0, 100, 433])
def test_forgeries_in_a_merged_archive_are_named(first: int, merged: Archive, tmp_path: Path) -> None:
    forgery = Forgery(merged)
    births = forgery.births
    row = next(k for k, uid in enumerate(forgery.state.elites.uid) if first <= uid < first + 100)
    uid = int(forgery.state.elites.uid[row])
    forgery.elite(row, genotype=one_weight_off(forgery.state.elites.genotype[row]))
    other = next(u for u in range(first, first + 90) if births.loc[u, "failed"] is None and u != uid)
    forgery.set(other, objective=nudged(births.loc[other, "objective"]))
    names = found(verify(forgery.sealed(tmp_path), sample=None))
    assert names["genotypes of elites grow from their roots"] == (uid,)
    assert other in names["births have the recorded objective"]


def test_runs_that_overlap(merged: Archive, tmp_path: Path) -> None:
    forgery = Forgery(merged)
    assert forgery.meta.origin is not None
    runs = [dict(run) for run in forgery.meta.origin["runs"]]
    runs[1]["births"] += 1
    forgery.meta = replace(forgery.meta, origin={"kind": "merged", "runs": runs})
    try:
        result = verify(forgery.sealed(tmp_path))
    except ArchiveError:
        return
    assert "runs follow one another" in found(result)
    assert "it is not known which births are of which run" in result.unverified[-1]
