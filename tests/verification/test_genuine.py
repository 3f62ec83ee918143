"""What is genuine is verified, whatever its configuration and whoever evaluates."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from nichechain.archive.archive import Archive, load
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.execution import Threads
from nichechain.search.config import BuildConfig
from nichechain.verification import VerificationProgress, verify

from ..arms import RoughArm
from .conftest import CONFIG, built
from .forgeries import found


def test_a_genuine_archive_is_verified_in_full(genuine: Archive) -> None:
    result = verify(genuine, sample=None)
    assert result.ok
    assert result.causes == result.unverified == result.differences == ()
    assert (result.births, result.elites) == (333, len(genuine.elites))
    assert (result.sampled_births, result.sampled_elites) == (333, len(genuine.elites))
    compared = {check.name: check.checked for check in result.checks}
    rows = genuine.births()
    failed = int(rows["failed"].notna().sum())
    assert failed > 10
    assert compared["uids number the births from 0"] == 333
    assert compared["births fail or not, for the recorded reason"] == 333
    assert compared["births have the recorded behavior"] == 333 - failed
    assert compared["a parent's niche is the one that it was born in"] == 333 - 50
    assert compared["genotypes of elites grow from their roots"] == len(genuine.elites)
    # The last step ends with uid 50 + 9 * 32 = 338.
    assert compared["pending children are the rest of the last step"] == 338 - 333


@pytest.mark.parametrize(
    "values",
    [
        {"outside": "absorb"},
        {"outside": "clip"},
        {"replacement": "first"},
        {"replacement": "newest"},
        {"replacement": "objective"},
        {"mutation": "uniform-ball", "scale": 2.0},
        {"niches": "cvt", "shape": (30,)},
        {"self_adaptive": True},
        {"selection": "curiosity"},
        {"objective": "l-evolvability", "replacement": "objective", "offspring": 3},
        {"step_bound": ("rescaled", 0.5)},
        {"evaluations": 30},
        {"evaluations": 338},
    ],
    ids=str,
)
def test_archives_of_any_configuration_are_verified(values: dict[str, Any], tmp_path: Path) -> None:
    result = verify(built(tmp_path, replace(CONFIG, **values)), sample=None)
    assert result.ok, found(result)
    assert not result.unverified


def test_the_result_is_that_of_any_workers(genuine: Archive) -> None:
    with Threads(1) as executor:
        one = verify(genuine, sample=40, executor=executor)
    with Threads(3) as executor:
        three = verify(genuine, sample=40, executor=executor)
    assert one == three == verify(genuine, sample=40)
    assert one.sampled_births == 40


def test_the_seed_decides_who_is_evaluated(genuine: Archive) -> None:
    def asked(seed: int) -> list[bytes]:
        seen: list[bytes] = []

        class Watched(RoughArm):
            def evaluate(self, genotypes: Any) -> Any:
                """Note what is evaluated."""
                seen.extend(row.tobytes() for row in genotypes)
                return super().evaluate(genotypes)

        with Threads(1) as executor:
            result = verify(load(genuine.folder, domain=Watched()), sample=7, seed=seed, executor=executor)
        assert result.ok
        return seen

    assert len(asked(3)) == 14
    assert asked(3) == asked(3)
    assert asked(3) != asked(4)


def test_progress_ends_with_all_done(genuine: Archive) -> None:
    last: dict[str, VerificationProgress] = {}
    verify(genuine, sample=9, on_progress=lambda now: last.update({now.stage: now}))
    assert {stage: now.done for stage, now in last.items()} == {
        stage: now.total for stage, now in last.items()
    }
    assert last["search"].total == 333
    assert last["evaluations"].total == 18


def test_an_archive_of_the_first_format_is_verified() -> None:
    archive = load(Path(__file__).parents[1] / "data" / "format-1", domain=RoughArm())
    result = verify(archive, sample=None)
    assert not result.unverified
    assert result.sampled_births == 1000
    # Whatever the machine: how an arm's hand is rounded may differ, its record and its search may not.
    assert {check.group for check in result.mismatched} <= {"births evaluated", "elites evaluated"}
    assert all((check.difference or 0.0) < 1e-12 for check in result.mismatched)


@pytest.mark.parametrize(
    ("values", "said"),
    [({"sample": -1}, "sample is -1, but must not be negative"), ({"seed": -2}, "seed is -2")],
)
def test_bad_values_are_refused(values: dict[str, int], said: str, genuine: Archive) -> None:
    with pytest.raises(NichechainError, match=said):
        verify(genuine, **values)  # type: ignore[arg-type]


def test_checksums_come_first(genuine: Archive, tmp_path: Path) -> None:
    for path in genuine.folder.rglob("*.*"):
        copy = tmp_path / path.relative_to(genuine.folder)
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(path.read_bytes())
    (part,) = (tmp_path / "births").glob("*.parquet")
    content = bytearray(part.read_bytes())
    content[100] ^= 1
    part.write_bytes(content)
    with pytest.raises(ArchiveError, match=part.name):
        verify(tmp_path)
    with pytest.raises(ArchiveError, match="no such folder"):
        verify(tmp_path / "nowhere")


def test_json_has_every_check(genuine: Archive) -> None:
    content = json.loads(json.dumps(verify(genuine, sample=3).to_json()))
    assert content["ok"] is True
    assert content["unexplained"] == content["causes"] == []
    assert len(content["checks"]) > 30
    assert BuildConfig.from_json(genuine.config.to_json()) == genuine.config
