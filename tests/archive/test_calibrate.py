"""Births of lineages that are added to an archive: which, where, and the same bits whatever happens."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

import nichechain as nc
from nichechain.archive.merge import merge
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.domains import Evaluation
from nichechain.domains.base import Domain
from nichechain.execution import Threads
from nichechain.verification import verify

from ..arms import RoughArm
from .folder.samples import content, edited, written

# The last step is cut, so children are pending that will never be born.
CONFIG = nc.BuildConfig(
    "arm",
    (9, 7),
    ((-0.7, 1.0), (-0.9, 0.8)),
    evaluations=450,
    initial=100,
    batch=64,
    scale=0.3,
    seed=5,
    lineage_length=6,
)


def built(folder: Path, config: nc.BuildConfig = CONFIG) -> Path:
    with Threads(1) as executor:
        nc.build(config, folder, executor)
    return folder


@pytest.fixture(scope="module")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory.mktemp("pristine") / "archive")


def calibrated(pristine: Path, folder: Path, *rollouts: int, workers: int = 1, brood: int = 10) -> Path:
    shutil.copytree(pristine, folder)
    with Threads(workers) as executor:
        for number in rollouts:
            nc.calibrate(folder, number, executor, brood=brood)
    return folder


@pytest.fixture(scope="module")
def more(pristine: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return calibrated(pristine, tmp_path_factory.mktemp("more") / "archive", 1000)


def test_births_are_added_and_none_is_changed(pristine: Path, more: Path) -> None:
    before, after = nc.load(pristine).births(), nc.load(more).births()
    pd.testing.assert_frame_equal(after[:450], before)
    assert after["uid"].tolist() == list(range(1450))
    meta = nc.load(more).meta
    assert (meta.births, meta.built, meta.complete) == (1450, 450, True)
    assert meta.config == CONFIG


def test_all_are_of_lineages_that_begin_at_elites(more: Path) -> None:
    births = nc.load(more).births()
    new = births[450:]
    # 167 lineages are 17 broods, six of them side by side, for 6 steps each: 16 whole steps and 40 births.
    generation = (new["step"] - new["step"].min()) % 6
    assert new.groupby("step").size().tolist() == [60] * 16 + [40]
    pd.testing.assert_series_equal(new["lineage"], generation > 0, check_names=False, check_dtype=False)
    following = new[new["lineage"]]
    assert (following["parent_uid"] == following["uid"] - 60).all()
    first = new[~new["lineage"]]
    brood = (first["uid"] - 450) // 10
    assert (first.groupby(brood)["parent_uid"].nunique() == 1).all()
    # Elites are drawn with replacement: 18 of some fifty.
    assert first.groupby(brood)["parent_uid"].first().nunique() > 10
    elites: dict[int, int] = {}
    for step, rows in births.groupby("step"):
        if step >= new["step"].min():
            begun = rows[~rows["lineage"]]
            assert [elites[niche] for niche in begun["parent_niche"]] == begun["parent_uid"].tolist()
        for row in rows[rows["accepted"]].itertuples():
            elites[row.child_niche] = row.uid
    # By the rule that makes every birth an elite with the same probability.
    assert 0 < new["accepted"].sum() < 100
    assert nc.load(more).elites.uid.tolist() == [elites[niche] for niche in sorted(elites)]


def test_births_go_where_lineages_stand(pristine: Path, tmp_path: Path) -> None:
    """Their parents are in niches as those of lineages are that start at elites drawn alike."""
    # Of lineages that begin at the same elite there are fewer roots to compare.
    archive = nc.load(calibrated(pristine, tmp_path / "archive", 6 * 64 * 20, brood=1))
    states = archive.niches.states
    new = archive.births()[450:]
    found = np.bincount(new["parent_niche"][new["lineage"]], minlength=states)
    rng = np.random.default_rng(3)
    genotypes = np.repeat(archive.elites.genotype, 40, axis=0)
    expected = np.zeros(states)
    for _ in range(5):
        genotypes = (genotypes + 0.3 * rng.standard_cauchy(genotypes.shape)).astype(np.float32)
        born = archive.niches.of(archive.domain.evaluate(genotypes).behavior)
        expected += np.bincount(born, minlength=states)
    apart = np.abs(found / found.sum() - expected / expected.sum()).sum() / 2
    uniform = np.abs(1 / states - expected / expected.sum()).sum() / 2
    # Two samples of 6,400 and 12,000 over 64 states differ by .03 on average where they are of one law.
    assert apart < 0.08
    assert uniform > 0.25


@pytest.mark.parametrize("rollouts", [1, 5, 23])
def test_few_births_are_whole_lineages(rollouts: int, pristine: Path, tmp_path: Path) -> None:
    new = nc.load(calibrated(pristine, tmp_path / "archive", rollouts)).births()[450:]
    assert len(new) == rollouts
    assert new["lineage"].sum() == rollouts - -(-rollouts // 6)


class Stopping:
    """An executor that is stopped at one of its calls, before or after the evaluation."""

    def __init__(self, call: int, after: bool) -> None:
        self.call, self.after = call, after

    def evaluate(
        self, domain: Domain, genotypes: NDArray[np.float32], on_done: Callable[[int], None] | None = None
    ) -> Evaluation:
        self.call -= 1
        if not self.call and not self.after:
            raise KeyboardInterrupt
        with Threads(1) as executor:
            found = executor.evaluate(domain, genotypes, on_done)
        if not self.call:
            raise KeyboardInterrupt
        return found


def test_the_brood_is_remembered(pristine: Path, tmp_path: Path) -> None:
    folder = calibrated(pristine, tmp_path / "archive", 60, brood=5)
    with pytest.raises(KeyboardInterrupt):
        nc.calibrate(folder, 72, Stopping(4, after=False), brood=4)
    with Threads(1) as executor:
        nc.calibrate(folder, executor=executor, resume=True)
        nc.calibrate(folder, 24, executor)
        archive = nc.load(folder)
        assert [each.brood for each in archive.meta.calibrations] == [5, 4, 10]
        assert verify(archive, sample=20, executor=executor).mismatched == ()
    new = archive.births()[450:]
    begun = new[~new["lineage"]]
    # Ten lineages are two broods of five, twelve three of four, and four one of four.
    assert begun.groupby(["step", "parent_uid"], sort=False).size().tolist() == [5, 5, 4, 4, 4, 4]


def test_a_calibration_of_before_there_were_broods_goes_on_as_it_was(pristine: Path, tmp_path: Path) -> None:
    """Metadata of then have no brood, in the configuration or in the calibration."""
    alone = calibrated(pristine, tmp_path / "alone", 300, brood=1)
    folder = tmp_path / "archive"
    shutil.copytree(pristine, folder)
    with pytest.raises(KeyboardInterrupt):
        nc.calibrate(folder, 300, Stopping(3, after=False), brood=1)

    def of_then(meta: dict[str, Any]) -> None:
        del meta["calibrations"][0]["brood"]

    written(folder, edited(content(folder), of_then))
    assert nc.load(folder).meta.calibrations[0].brood == 1
    with Threads(1) as executor:
        assert verify(folder, sample=20, executor=executor).ok
        nc.calibrate(folder, executor=executor, resume=True)
    assert content(folder) == content(alone)
    written(folder, edited(content(folder), of_then))
    with Threads(1) as executor:
        assert verify(folder, sample=20, executor=executor).mismatched == ()


@pytest.mark.parametrize("call", [1, 2, 7, 16])
@pytest.mark.parametrize("after", [False, True])
def test_an_interrupted_one_goes_on_to_the_same_bits(
    call: int, after: bool, pristine: Path, more: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "archive"
    shutil.copytree(pristine, folder)
    with pytest.raises(KeyboardInterrupt):
        nc.calibrate(folder, 1000, Stopping(call, after))
    kept = nc.load(folder).meta
    assert kept.births == 450 + 60 * (call - 1)
    with Threads(1) as executor:
        if call == 1:
            # There was nothing to keep, so the archive is as it was.
            assert content(folder) == content(pristine)
            nc.calibrate(folder, 1000, executor)
        else:
            assert verify(folder, sample=5, executor=executor).ok
            with pytest.raises(ArchiveError, match=f"lacks {1000 - 60 * (call - 1)} of its 1000 births"):
                nc.calibrate(folder, 7, executor)
            nc.calibrate(folder, executor=executor, resume=True)
        with pytest.raises(ArchiveError, match="no calibration to go on with"):
            nc.calibrate(folder, executor=executor, resume=True)
    assert content(folder) == content(more)


def test_workers_change_nothing(pristine: Path, more: Path, tmp_path: Path) -> None:
    assert content(calibrated(pristine, tmp_path / "archive", 1000, workers=3)) == content(more)


@pytest.mark.parametrize(
    "changes",
    [
        {"lineage_share": 0.0},
        {"outside": "absorb", "replacement": "objective"},
        {"selection": "curiosity", "replacement": "newest"},
        {"objective": "l-evolvability", "replacement": "objective", "offspring": 3},
        {"niches": "cvt", "shape": (20,), "self_adaptive": True},
    ],
    ids=str,
)
def test_any_archive_can_be_calibrated_again_and_again(changes: dict[str, object], tmp_path: Path) -> None:
    first = built(tmp_path / "built", replace(CONFIG, **changes))  # type: ignore[arg-type]
    folder = calibrated(first, tmp_path / "archive", 200, 90, 1)
    archive = nc.load(folder)
    assert [each.births for each in archive.meta.calibrations] == [200, 90, 1]
    assert archive.meta.births == 741
    with Threads(1) as executor:
        assert verify(folder, sample=20, executor=executor).mismatched == ()


def test_calibrated_archives_merge(pristine: Path, more: Path, tmp_path: Path) -> None:
    other = built(tmp_path / "other", replace(CONFIG, seed=6))
    merge((more, calibrated(other, tmp_path / "again", 100, 50)), tmp_path / "merged")
    merged = nc.load(tmp_path / "merged")
    assert merged.meta.births == 1450 + 600
    with Threads(1) as executor:
        assert verify(merged, sample=20, executor=executor).mismatched == ()
    with pytest.raises(NichechainError, match="both have the run of seed 5"):
        merge((pristine, more), tmp_path / "twice")


def test_no_build_goes_on(more: Path) -> None:
    before = content(more)
    with (
        Threads(1) as executor,
        pytest.raises(ArchiveError, match="1000 births of a calibration, so no build"),
    ):
        nc.build(replace(CONFIG, evaluations=2000), more, executor)
    assert content(more) == before


def test_what_is_asked_twice_or_not_at_all(pristine: Path) -> None:
    with pytest.raises(NichechainError, match="rollouts 5 and resume exclude each other"):
        nc.calibrate(pristine, 5, resume=True)
    with pytest.raises(NichechainError, match="rollouts is not given"):
        nc.calibrate(pristine)


def test_too_many_failures_stop_it(tmp_path: Path) -> None:
    with Threads(1) as executor:
        nc.build(CONFIG, tmp_path, executor, domain=RoughArm())
        archive = nc.load(tmp_path, domain=RoughArm())
        with pytest.raises(NichechainError, match=r"births failed, more than the share of 0\.01"):
            nc.calibrate(archive, 1000, executor, max_failed=0.01)
        kept = nc.load(tmp_path).meta
        assert 450 < kept.births < 1450
        nc.calibrate(archive, executor=executor, resume=True)
    assert nc.load(tmp_path).meta.births == 1450
