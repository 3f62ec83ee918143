"""Commands work whatever their standard streams are."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from nichechain.archive import read

BUILD = f"{sys.executable} -m nichechain build arm --evaluations 300 --grid 8x8 --out a"
ROOT = Path(__file__).resolve().parents[2]


def run(line: str, folder: Path, **more: str) -> subprocess.CompletedProcess[str]:
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin", "HOME": str(folder), **more}
    return subprocess.run(
        line, shell=True, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-", "<&-"])
def test_closed_streams_lose_nothing(closed: str, tmp_path: Path) -> None:
    done = run(f"{BUILD} {closed}", tmp_path)
    assert done.returncode == 0
    assert read.read_meta(tmp_path / "a").births == 300
    # Not even a file of the archive was given the number of a closed stream.
    assert read.read_births(tmp_path / "a", read.read_meta(tmp_path / "a")).num_rows == 300


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
def test_progress_on_a_full_disk_stops_no_build(tmp_path: Path) -> None:
    done = run(f"{BUILD} 2>/dev/full", tmp_path)
    assert done.returncode == 0
    assert read.read_meta(tmp_path / "a").births == 300


def test_a_terminal_of_ascii_shows_a_table(tmp_path: Path) -> None:
    done = run(
        f"{sys.executable} -m nichechain evolvability {ROOT}/archives/fetch-pick-and-place --niche 14,14",
        tmp_path,
        PYTHONIOENCODING="ascii",
    )
    assert done.returncode == 0, done.stderr
    assert "14,14" in done.stdout
    assert done.stdout.isascii()


def test_hints_can_be_pasted(tmp_path: Path) -> None:
    done = run(BUILD.replace("--out a", "--out 'my arm'"), tmp_path)
    assert "nichechain info 'my arm'" in done.stdout


def test_bounds_that_hold_nothing_are_said(tmp_path: Path) -> None:
    """The commonest mistake of a first build."""
    done = run(BUILD.replace("--grid 8x8", "--grid 3x3 --bounds=5,6,5,6"), tmp_path)
    assert done.returncode == 0, done.stderr
    assert "300 of 300 births fell outside the bounds; bounds of " in done.stderr
    assert "Traceback" not in done.stderr
    for command in (
        "info a",
        "evolvability a",
        "evolvability a --niche 1,1",
        "evolvability a --niche outside",
    ):
        asked = run(f"{sys.executable} -m nichechain {command}", tmp_path)
        assert "Traceback" not in asked.stderr, command
