import dataclasses
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from numpy.typing import NDArray

from nichechain import BuildConfig, Threads, births, build, domains
from nichechain.archive import write
from nichechain.core.errors import ArchiveError
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Domain, Evaluation
from nichechain.niches import GridNiches
from nichechain.studies import (
    Condition,
    Study,
    metric_conditions,
    pressure_conditions,
    read_births,
    read_records,
    read_study,
    run,
    running,
)
from nichechain.studies.folder import write_study
from nichechain.walks import run_seed, walk

ARM = domains.make("arm")
BASE = Condition("base", offspring=6)
STUDY = Study(
    "pressure",
    "arm",
    pressure_conditions(("selective", "0.5", "random"), BASE),
    runs=5,
    steps=7,
    shape=(6, 6),
    bounds=ARM.bounds,
)


def files(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


def finish(study: Study, folder: Path, workers: int = 1) -> Path:
    with Threads(workers) as threads:
        run(study, folder, threads)
    return folder


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finish(STUDY, tmp_path_factory.mktemp("study") / "whole")


def test_a_study_is_its_walks(whole: Path) -> None:
    records = read_records(whole)
    assert records["condition"].unique().to_pylist() == ["selective", "0.5", "random"]
    condition = STUDY.conditions[1]
    expected = walk(
        ARM,
        condition.mutate(),
        condition.walk_config(STUDY.seed),
        runs=5,
        steps=7,
        niches=GridNiches(STUDY.shape, STUDY.bounds),
    )
    mine = records.filter(pc.equal(records["condition"], "0.5")).drop_columns("condition")
    assert mine.equals(expected.table().sort_by([("run", "ascending"), ("step", "ascending")]))
    offspring = read_births(whole)
    offspring = offspring.filter(pc.equal(offspring["condition"], "0.5")).drop_columns("condition")
    order = [("run", "ascending"), ("step", "ascending"), ("uid", "ascending")]
    assert offspring.equals(expected.births.sort_by(order))


def test_nothing_is_left_of_what_was_under_way(whole: Path) -> None:
    assert {path.name for path in whole.iterdir()} - {".lock"} == {"study.json", "records", "births"}
    assert read_births(whole).num_rows == STUDY.evaluations
    assert read_study(whole) == STUDY


def test_neither_workers_nor_blocks_matter(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert files(finish(STUDY, tmp_path / "two", workers=2)) == files(whole)
    monkeypatch.setattr(running, "BLOCK", 2)
    assert read_records(finish(STUDY, tmp_path / "blocks")).equals(read_records(whole))
    assert read_births(tmp_path / "blocks").equals(read_births(whole))


def test_runs_are_added(whole: Path, tmp_path: Path) -> None:
    finish(dataclasses.replace(STUDY, runs=2), tmp_path)
    finish(STUDY, tmp_path)
    assert read_records(tmp_path).equals(read_records(whole))
    with pytest.raises(ArchiveError, match="5 runs, more than the 2 asked for"):
        finish(dataclasses.replace(STUDY, runs=2), tmp_path)


class Interrupting:
    """An executor that is interrupted at its n-th batch."""

    def __init__(self, batches: int) -> None:
        self.left = batches

    def evaluate(
        self,
        domain: Domain,
        genotypes: NDArray[np.float32],
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        if not self.left:
            raise KeyboardInterrupt
        self.left -= 1
        if on_done is not None:
            on_done(len(genotypes))
        return domain.evaluate(genotypes)


@pytest.mark.parametrize("batches", [0, 1, 2, 8, 9, 10, 20])
def test_an_interrupt_loses_no_step(whole: Path, tmp_path: Path, batches: int) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(STUDY, tmp_path, Interrupting(batches))
    made = []
    with Threads(1) as threads:
        run(STUDY, tmp_path, threads, on_progress=made.append)
    # 9 batches are a condition: its starts, and 8 states.
    steps = batches % 9
    assert made[-1] == STUDY.evaluations
    assert (batches // 9) * 5 * (1 + 8 * 6) + (5 * (1 + (steps - 1) * 6) if steps else 0) in made
    assert files(tmp_path) == files(whole)


def test_runs_are_added_while_a_block_is_under_way(whole: Path, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(dataclasses.replace(STUDY, runs=3), tmp_path, Interrupting(14))
    finish(STUDY, tmp_path)
    assert read_records(tmp_path).equals(read_records(whole))
    assert {path.stem for path in (tmp_path / "records").glob("random-*")} == {"random-0000-0004"}
    assert {path.stem for path in (tmp_path / "records").glob("0.5-*")} == {"0.5-0000-0002", "0.5-0003-0004"}


KILLED = """
import sys, time
from nichechain.studies import read_study, run, running
from nichechain import Threads
running._CHECKPOINT_SECONDS = 0.0
with Threads(1) as threads:
    run(read_study(sys.argv[1]), sys.argv[1], threads)
"""


def kill_until_done(folder: Path, rng: np.random.Generator, kills: int, longest: float) -> int:
    """Kill the walker at random instants, then let it finish; tells how many kills hit it alive."""
    hit = 0
    for _ in range(kills):
        process = subprocess.Popen([sys.executable, "-c", KILLED, str(folder)])
        begun = ("running.npz", "records/*.parquet")
        while process.poll() is None and not any(next(folder.glob(name), None) for name in begun):
            time.sleep(0.01)
        time.sleep(rng.uniform(0, longest))
        if process.poll() is None:
            os.kill(process.pid, signal.SIGKILL)
            hit += 1
        process.wait()
        assert read_study(folder).kind == "pressure"
    return hit


@pytest.mark.slow
def test_fifty_kills(tmp_path: Path) -> None:
    study = dataclasses.replace(STUDY, runs=20, steps=60)
    expected = finish(study, tmp_path / "whole")
    rng = np.random.default_rng(0)
    hit = 0
    attempt = 0
    while hit < 50:
        folder = tmp_path / f"killed-{attempt}"
        attempt += 1
        folder.mkdir()
        write_study(folder, study, ARM.unit)
        hit += kill_until_done(folder, rng, 10, 0.4)
        finish(study, folder)
        assert files(folder) == files(expected)


def test_a_kill(whole: Path, tmp_path: Path) -> None:
    write_study(tmp_path, STUDY, ARM.unit)
    kill_until_done(tmp_path, np.random.default_rng(1), 1, 0.05)
    assert files(finish(STUDY, tmp_path)) == files(whole)


def test_another_study_is_refused(whole: Path) -> None:
    before = files(whole)
    with pytest.raises(ArchiveError, match="differs in steps, seed"):
        finish(dataclasses.replace(STUDY, steps=8, seed=1), whole)
    with pytest.raises(ArchiveError, match="differs in conditions"):
        finish(dataclasses.replace(STUDY, conditions=STUDY.conditions[:2]), whole)
    assert files(whole) == before


def test_an_archive_and_a_study_do_not_share_a_folder(whole: Path, archive_folder: Path) -> None:
    study, archive = files(whole), files(archive_folder)
    config = BuildConfig(domain="arm", shape=(5, 5), bounds=ARM.bounds, evaluations=300)
    with (
        Threads(1) as threads,
        pytest.raises(ArchiveError, match="holds a study, but an archive needs a folder"),
    ):
        build(config, whole, threads)
    with pytest.raises(ArchiveError, match="holds a study"):
        write.clear(whole)
    with pytest.raises(ArchiveError, match="holds an archive, but a study needs a folder of its own"):
        finish(STUDY, archive_folder)
    assert (files(whole), files(archive_folder)) == (study, archive)


def test_runs_that_share_an_archive_stay_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(running, "BLOCK", 2)
    shared = dataclasses.replace(
        STUDY, conditions=(dataclasses.replace(BASE, archive_scope="configuration"),)
    )
    finish(shared, tmp_path)
    assert [path.stem for path in (tmp_path / "records").iterdir()] == ["base-0000-0004"]
    with pytest.raises(ArchiveError, match="no run can be added to condition base"):
        finish(dataclasses.replace(shared, runs=6), tmp_path)


def starts(folder: Path, condition: str) -> pa.Table:
    rows = read_births(folder)
    chosen = pc.and_(pc.equal(rows["condition"], condition), pc.is_null(rows["parent_uid"]))
    return rows.filter(chosen).select(["run", "behavior_0", "behavior_1"])


def test_paired_walks_start_alike_and_others_do_not(whole: Path, tmp_path: Path) -> None:
    conditions = metric_conditions(("knn", "ancestors"), BASE)
    study = dataclasses.replace(STUDY, kind="metrics", conditions=conditions, paired=True)
    finish(study, tmp_path)
    assert starts(tmp_path, "knn").equals(starts(tmp_path, "ancestors"))
    assert not starts(whole, "0.5").equals(starts(whole, "random"))
    first = ARM.sample(1, seed=keyed(run_seed(study.seed, 3), Purpose.INITIAL))
    expected = ARM.evaluate(first).behavior[0]
    assert list(starts(tmp_path, "knn").to_pylist()[3].values())[1:] == expected.tolist()
    # What follows the start is each condition's own.
    rows = read_births(tmp_path)
    later = [
        rows.filter(pc.equal(rows["condition"], name)).drop_columns("condition")
        for name in ("knn", "ancestors")
    ]
    assert not later[0].equals(later[1])


def test_walks_are_births_with_niches(whole: Path) -> None:
    rows = read_births(whole).to_pandas()
    niches = GridNiches(STUDY.shape, STUDY.bounds)
    landed = niches.of(rows[["behavior_0", "behavior_1"]].to_numpy())
    np.testing.assert_array_equal(rows["child_niche"], landed)
    child = rows[rows["parent_uid"].notna()].iloc[-1]
    same = (rows["condition"] == child["condition"]) & (rows["run"] == child["run"])
    parent = rows[same & (rows["uid"] == child["parent_uid"])].iloc[0]
    assert child["parent_niche"] == parent["child_niche"]
    assert births.NONE not in rows["child_niche"].to_numpy()


def damage(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(bytes(content))


def test_damage_is_named(tmp_path: Path) -> None:
    finish(dataclasses.replace(STUDY, conditions=STUDY.conditions[:1]), tmp_path)
    study = tmp_path / "study.json"
    text = study.read_text()
    study.write_text(text[: len(text) // 2])
    with pytest.raises(ArchiveError, match=r"study.json is no study of walks, or damaged"):
        read_study(tmp_path)
    study.write_text(text.replace('"format": 1', '"format": 9'))
    with pytest.raises(ArchiveError, match="has format 9"):
        read_study(tmp_path)
    study.write_text(text)
    damage(tmp_path / "records" / "selective-0000-0004.parquet")
    with pytest.raises(ArchiveError, match=r"selective-0000-0004.parquet is damaged"):
        read_records(tmp_path)


def test_damage_of_what_is_under_way_is_named(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        run(STUDY, tmp_path, Interrupting(3))
    damage(tmp_path / "running.npz")
    with pytest.raises(ArchiveError, match=r"running.npz is damaged.*begin anew"):
        finish(STUDY, tmp_path)
    (tmp_path / "running.npz").unlink()
    finish(STUDY, tmp_path)


def test_no_study_and_no_walks(tmp_path: Path) -> None:
    with pytest.raises(ArchiveError, match="holds no study"):
        read_study(tmp_path)
    write_study(tmp_path, STUDY, ARM.unit)
    with pytest.raises(ArchiveError, match="no finished walks yet"):
        read_records(tmp_path)
