"""An archive of the first format, written when it was new, opens for ever."""

from __future__ import annotations

import hashlib
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from nichechain.archive.archive import load
from nichechain.archive.building import build
from nichechain.execution import Threads
from nichechain.search.config import BuildConfig

ARCHIVE = Path(__file__).parents[2] / "data" / "format-1"


def test_its_numbers_are_those_of_then() -> None:
    archive = load(ARCHIVE)
    assert archive.config == BuildConfig(
        "arm",
        (9, 7),
        ((-0.7, 1.0), (-0.9, 0.8)),
        evaluations=1000,
        initial=100,
        batch=64,
        scale=0.3,
        seed=5,
        lineage_share=0.0,
        lineage_brood=1,
    )
    assert not archive.births()["lineage"].any()
    assert archive.meta.complete
    assert archive.meta.versions["nichechain"] == "0.1.0"
    assert archive.filled == 57
    assert archive.elites.uid[:5].tolist() == [877, 881, 311, 420, 801]
    genotypes = hashlib.sha256(archive.elites.genotype.tobytes()).hexdigest()
    assert genotypes == "c24c7bc6bf00282ca50371807e2fbd66912975e19a69a5e74b54347514439fde"
    births = archive.births()
    assert list(births.columns) == [
        "run",
        "uid",
        "parent_uid",
        "depth",
        "parent_niche",
        "child_niche",
        "behavior_x",
        "behavior_y",
        "objective",
        "accepted",
        "failed",
        "step",
        "lineage",
    ]
    assert births["uid"].tolist() == list(range(1000))
    assert births["failed"].notna().sum() == 95
    assert set(births["failed"].dropna()) == {"the first joint broke"}
    assert (births["child_niche"] == 63).sum() == 9
    assert births["behavior_x"].sum() == pytest.approx(192.30903246864787, rel=1e-12)
    assert archive.counts.matrix.nnz == 623
    assert archive.counts.visits[59:].tolist() == [82, 28, 1, 0, 9]


def test_its_elites_come_of_its_births() -> None:
    archive = load(ARCHIVE)
    births = archive.births()
    last = births[births["accepted"]].groupby("child_niche")["uid"].last()
    assert archive.elites.niche.tolist() == last.index.tolist()
    assert archive.elites.uid.tolist() == last.tolist()
    rows = births.loc[archive.elites.uid]
    np.testing.assert_array_equal(archive.elites.behavior, rows[["behavior_x", "behavior_y"]].to_numpy(float))


def test_a_build_goes_on_with_it(tmp_path: Path) -> None:
    folder = tmp_path / "archive"
    shutil.copytree(ARCHIVE, folder)
    before = load(folder).births()
    config = load(folder).config
    with Threads(1) as executor:
        build(replace(config, evaluations=1100), folder, executor)
    after = load(folder)
    assert after.meta.births == 1100
    assert after.births()[:1000].equals(before)
    assert after.births()["uid"].tolist() == list(range(1100))
