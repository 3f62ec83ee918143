"""Unselected lineages in a build, against an account of them from the births table alone."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from nichechain.archive import read
from nichechain.archive.building import build
from nichechain.births.table import NONE
from nichechain.domains import PlanarArm
from nichechain.execution import Threads
from nichechain.search.config import BuildConfig
from nichechain.search.lineages import Calibration, Stretch, UnderWay

from ..arms import RoughArm

CONFIG = BuildConfig(
    "arm",
    (8, 6),
    ((-0.6, 1.0), (-0.8, 0.7)),
    evaluations=3000,
    initial=90,
    batch=47,
    scale=0.3,
    seed=11,
    lineage_share=0.2,
    lineage_length=5,
    lineage_brood=1,
)


def births(config: BuildConfig, folder: Path, domain: PlanarArm | None = None) -> list[dict[str, Any]]:
    with Threads(1) as executor:
        build(config, folder, executor, domain=domain or RoughArm())
    return read.read_births(folder, read.read_meta(folder)).to_pylist()


@pytest.fixture(scope="module", params=["state", "absorb"])
def rows(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    return births(replace(CONFIG, outside=request.param), tmp_path_factory.mktemp("lineages"))


def chains(rows: list[dict[str, Any]]) -> list[list[int]]:
    """Every lineage as the uids of its births, the first of them not flagged."""
    following = {row["parent_uid"]: row["uid"] for row in rows if row["lineage"]}
    flagged = {row["uid"] for row in rows if row["lineage"]}
    found = []
    for first in following:
        if first not in flagged:
            chain = [first]
            while chain[-1] in following:
                chain.append(following[chain[-1]])
            found.append(chain)
    return found


def test_a_lineage_has_one_birth_after_the_other(rows: list[dict[str, Any]]) -> None:
    flagged = [row for row in rows if row["lineage"]]
    assert len(flagged) > 300
    # Nobody is the parent of two births of lineages: each is the latest only once.
    assert max(Counter(row["parent_uid"] for row in flagged).values()) == 1
    found = chains(rows)
    assert sum(len(chain) - 1 for chain in found) == len(flagged)
    for chain in found:
        assert len(chain) <= 5
        steps = [rows[uid]["step"] for uid in chain]
        # Ten slots take turns in the nine or ten births that a step gives to lineages.
        assert set(np.diff(steps)) <= {1, 2}


def test_lineages_end_after_their_length_or_where_nobody_can_be_a_parent(
    rows: list[dict[str, Any]],
) -> None:
    absorbed = not any(row["parent_niche"] == 48 for row in rows)
    reasons = Counter()
    for chain in chains(rows):
        last = rows[chain[-1]]
        if last["failed"] is not None:
            reasons["failed"] += 1
        elif absorbed and last["child_niche"] == 48:
            reasons["outside"] += 1
        elif last["step"] >= rows[-1]["step"] - 1:
            reasons["cut"] += 1
        else:
            reasons["done"] += 1
    assert reasons["failed"] > 5
    assert (reasons["outside"] > 0) == absorbed
    assert reasons["done"] > 50
    # A lineage that begins in place of one that ended early ends when that would have.
    full = [chain for chain in chains(rows) if len(chain) == 5]
    assert len(full) > 40


def test_lineages_get_their_share_and_the_last_births_of_each_step(rows: list[dict[str, Any]]) -> None:
    """The first birth of five is a child of an elite; failures cost the more."""
    after = rows[90:]
    share = np.mean([row["lineage"] for row in after])
    assert 0.13 < share < 0.2 * 4 / 5
    for row in after:
        if row["lineage"]:
            assert (row["uid"] - 90) % 47 >= 47 - 10


def test_births_of_lineages_win_niches_by_the_rule(rows: list[dict[str, Any]]) -> None:
    """Most of them do not: what they leave behind is counts."""
    won = [row["accepted"] for row in rows if row["lineage"]]
    assert 0 < np.mean(won) < 0.5
    assert not any(row["accepted"] for row in rows if row["failed"] is not None)


def test_without_a_share_nothing_tells_of_lineages(tmp_path: Path) -> None:
    """The files are those of before there were lineages."""
    found = births(replace(CONFIG, lineage_share=0.0, evaluations=300), tmp_path)
    assert not any(row["lineage"] for row in found)
    meta = read.read_meta(tmp_path)
    with np.load(tmp_path / meta.elites["file"]) as arrays:
        assert not [name for name in arrays if "lineage" in name]
    import pyarrow.parquet as pq

    assert "lineage" not in pq.read_schema(tmp_path / meta.parts[0]["file"]).names


def test_the_share_takes_no_birth_from_selection_that_it_does_not_use(tmp_path: Path) -> None:
    """The first step draws as it would without lineages, whose first births are ordinary ones."""
    with_, without = (
        births(replace(CONFIG, lineage_share=share, evaluations=90 + 47), tmp_path / str(share))
        for share in (0.2, 0.0)
    )
    assert with_ == without


@pytest.mark.parametrize("share", [0.001, 0.01, 0.05, 0.07, 0.5, 0.999, 1.0])
@pytest.mark.parametrize("batch", [1, 7, 64, 100])
def test_slots_take_turns(share: float, batch: int) -> None:
    stretch = Stretch(3, 500, batch, share, 4, 1)
    given: list[int] = []
    begun = Counter[int]()
    for step in range(3, 403):
        slot, goes_on = stretch.slots(step)
        assert len(slot) == len(goes_on) == batch
        own = slot[slot != NONE]
        # No lineage has two births in a step: the second would need the first to be evaluated.
        assert np.unique(own).size == own.size
        assert not goes_on[slot == NONE].any()
        given += own.tolist()
        begun.update(own[~goes_on[slot != NONE]].tolist())
    assert len(given) == pytest.approx(400 * share * batch, abs=1)
    if len(given) >= 100:
        times = Counter(given)
        assert max(times.values()) - min(times.values()) <= 1
        for which, births_ in times.items():
            assert begun[which] == -(-births_ // 4)


def test_lineages_are_found_and_replaced_by_slot() -> None:
    one = np.ones(3, np.int64)
    three = UnderWay(np.array([1, 4, 6]), np.zeros((3, 2), np.float32), np.array([10, 40, 60]), one, one)
    assert three.rows(np.array([6, 0, 1, 7, 4])).tolist() == [2, NONE, 0, NONE, 1]
    assert UnderWay.none(2).rows(np.array([0, 1])).tolist() == [NONE, NONE]
    new = UnderWay(np.array([5, 1]), np.ones((2, 2), np.float32), np.array([51, 11]), one[:2], one[:2])
    after = three.after(new, np.array([6]))
    assert after.slot.tolist() == [1, 4, 5]
    assert after.uid.tolist() == [11, 40, 51]
    assert after.genotype[:, 0].tolist() == [1, 0, 1]


@pytest.mark.parametrize(
    ("asked", "slots"), [(1, 1), (9, 2), (5, 1), (6, 2), (235, 47), (236, 24), (9999, 47)]
)
def test_a_calibration_runs_whole_lineages_side_by_side(asked: int, slots: int) -> None:
    stretch = Calibration(7, 100, asked, 1).stretch(CONFIG)
    assert (stretch.batch, stretch.uid(7), stretch.uid(8)) == (slots, 100, 100 + slots)
    slot, goes_on = stretch.slots(7)
    assert slot.tolist() == list(range(slots))
    assert not goes_on.any()
    assert stretch.slots(8)[1].all()
    assert not stretch.slots(12)[1].any()
