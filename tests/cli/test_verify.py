"""The command that verifies an archive."""

from __future__ import annotations

import io
import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from nichechain.archive.read import checksum
from nichechain.cli import progress, verify
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.core.machine import library_versions


def resealed(folder: Path, **values: Any) -> None:
    """Other metadata with a checksum that is right."""
    meta = json.loads((folder / "meta.json").read_text())
    del meta["sha256"]
    meta.update(values)
    (folder / "meta.json").write_text(json.dumps({**meta, "sha256": checksum(meta)}, indent=2))


@pytest.fixture
def copy(built: Path, tmp_path: Path) -> Path:
    shutil.copytree(built, tmp_path / "copy")
    return tmp_path / "copy"


@pytest.fixture
def other_seed(copy: Path) -> Path:
    """An archive whose configuration has another seed than the build had."""
    config = json.loads((copy / "meta.json").read_text())["config"]
    resealed(copy, config={**config, "seed": 6})
    return copy


def test_a_genuine_archive(built: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify.run([str(built), "--sample", "20", "--workers", "2"]) == 0
    shown = capsys.readouterr().out
    assert "1500 births" in shown
    assert "20 births and 20 elites evaluated again" in shown
    assert "All that was compared is equal to the last bit." in shown
    assert "not so" not in shown
    assert "likely cause" not in shown


def test_all_is_all(built: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify.run([str(built), "--sample", "all", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["sampled_births"] == 1500
    assert content["sampled_elites"] == content["elites"]
    assert content["ok"] is True


def test_a_mismatch_that_nothing_explains(other_seed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify.run([str(other_seed), "--sample", "5"]) == 1
    shown = " ".join(capsys.readouterr().out.split())
    assert "not so: parents are those that the seed draws:" in shown
    assert "This archive is not what its configuration leads to." in shown
    assert "genotypes of elites grow from their roots" in shown
    assert "the seed or the rules of the search changed" in shown


def test_a_mismatch_elsewhere_is_a_warning(
    other_seed: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    present = {**library_versions(), "numpy": "9.9"}
    monkeypatch.setattr("nichechain.verification.verifying.library_versions", lambda: present)
    assert verify.run([str(other_seed), "--sample", "5"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "likely cause: other version: numpy was" in shown
    assert "here it is 9.9" in shown
    assert "It differs, as archives may where a library or the machine differs." in shown
    assert verify.run([str(other_seed), "--sample", "5", "--strict"]) == 1


def test_strict_is_content_with_what_is_equal(built: Path) -> None:
    assert verify.run([str(built), "--sample", "3", "--strict"]) == 0


def test_what_cannot_be_verified_is_said(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = json.loads((copy / "meta.json").read_text())["config"]
    resealed(copy, config={**config, "domain": "somebodys"})
    assert verify.run([str(copy)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "not verified: genotypes and evaluations: domain is 'somebodys'" in shown
    assert "All that could be compared is equal to the last bit." in shown


def test_a_damaged_archive(copy: Path) -> None:
    (part,) = (copy / "births").glob("*.parquet")
    part.write_bytes(part.read_bytes()[:-1])
    with pytest.raises(ArchiveError, match=part.name):
        verify.run([str(copy)])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--sample", "-1"], "--sample is '-1', but must be a number of elites, from 0, or all"),
        (["--sample", "some"], "--sample is 'some'"),
        (["--sample", "1e3"], "--sample is '1e3'"),
        (["--sample", "²"], "--sample is '²'"),
        (["--seed", "-1"], "seed is -1, but must not be negative"),
        (["--workers", "0"], "workers is 0"),
    ],
)
def test_bad_values(options: list[str], said: str, built: Path) -> None:
    with pytest.raises(NichechainError) as caught:
        verify.run([str(built), *options])
    assert said in str(caught.value)


def test_progress_lines_tell_rate_and_time_left(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 0.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    monkeypatch.setattr(progress, "_FIRST_LINE", 10.0)
    with progress.stages() as tell:
        tell("evaluations", 0, 100)
        now = 11.0
        tell("evaluations", 22, 100)
        now = 15.0
        tell("evaluations", 30, 100)
    # 22 in 11 s is 2 a second, so the other 78 take 39 s; the next line is not due before 21 s.
    assert capsys.readouterr().err == "evaluations: 22 of 100, 2.0/s, 39 s left\n"


def test_progress_bars_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    import rich.console

    shown = io.StringIO()
    terminal = rich.console.Console(file=shown, force_terminal=True, width=100)
    monkeypatch.setattr(progress, "_console", lambda: terminal)
    with progress.stages() as tell:
        tell("search", 0, 7)
        tell("search", 7, 7)
        tell("evaluations", 1, 20)
    assert "search" in shown.getvalue()
    assert "7/7" in shown.getvalue()
    assert "1/20" in shown.getvalue()
