"""Ctrl-C: stops soon, keeps what is done, says how to go on; twice leaves at once."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import nichechain
from nichechain.archive import read
from nichechain.core.files import writing

ROOT = Path(nichechain.__file__).parents[1]

SCRIPT = """
import sys, time
from nichechain.archive import filling as building
from nichechain import cli, domains
from nichechain.archive import write
from nichechain.domains import PlanarArm

building.CHECKPOINT_SECONDS = 0.1
building._COMMIT_SHARE = 1.0
mode, arguments = sys.argv[1], sys.argv[2:]

if mode == "slow commits":
    commit = write.Writer._commit
    def slowly(writer, state):
        print("committing", flush=True)
        commit(writer, state)
        time.sleep(0.3)
        print("committed", flush=True)
    write.Writer._commit = slowly

if mode == "stuck":
    # A rollout that does not end, in a thread that nobody can stop.
    def evaluate(arm, genotypes, real=PlanarArm.evaluate):
        if len(genotypes) == 64 and abs(float(genotypes[0, 0])) > 1.5:
            print("stuck", flush=True)
            time.sleep(1000)
        return real(arm, genotypes)
    PlanarArm.evaluate = evaluate

sys.exit(cli.main(arguments))
"""


@contextmanager
def building(folder: Path, mode: str, *options: str, domain: str = "arm") -> Iterator[subprocess.Popen[str]]:
    """A build in a process, once it has made its first commit."""
    command = [sys.executable, "-c", SCRIPT, mode, "build", domain, "--out", str(folder)]
    process = subprocess.Popen(
        [*command, "--evaluations", "1000000", "--scale", "0.3", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        cwd=ROOT,
    )
    try:
        deadline = time.monotonic() + 300
        while not read.is_archive(folder) and time.monotonic() < deadline:
            assert process.poll() is None
            time.sleep(0.02)
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize(
    ("domain", "workers"),
    [
        ("arm", "processes:2"),
        pytest.param("arm", "threads:2", marks=pytest.mark.slow),
        pytest.param("fetch", "threads:2", marks=pytest.mark.slow),
    ],
)
def test_once_stops_and_keeps_all(domain: str, workers: str, tmp_path: Path) -> None:
    options = ("--workers", workers, "--initial", "20", "--batch", "8")
    with building(tmp_path / "a", "plain", *options, domain=domain) as process:
        began = time.monotonic()
        process.send_signal(signal.SIGINT)
        shown, _ = process.communicate(timeout=120)
        print(f"{domain} on {workers} stopped after {time.monotonic() - began:.2f} s")
    assert process.returncode == 130
    kept = read.read_meta(tmp_path / "a").births
    assert f"Stopped; {kept} of 1000000 births are kept." in shown
    assert f"nichechain build {domain} --out {tmp_path / 'a'} --resume" in shown
    assert len(read.read_births(tmp_path / "a", read.read_meta(tmp_path / "a"))) == kept


def test_twice_leaves_while_a_rollout_does_not_end(tmp_path: Path) -> None:
    with building(tmp_path / "a", "stuck", "--workers", "1") as process:
        assert process.stdout is not None
        while process.stdout.readline() != "stuck\n":
            pass
        process.send_signal(signal.SIGINT)
        line = process.stdout.readline()
        kept = read.read_meta(tmp_path / "a").births
        assert line.startswith(f"Stopped; {kept} of 1000000 births are kept")
        # All is said and kept; only the rollout is waited for.
        time.sleep(0.5)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
    assert read.read_meta(tmp_path / "a").births == kept > 0
    with writing(tmp_path / "a"):
        pass


@pytest.mark.parametrize(
    "pause", [0.1, pytest.param(0.0, marks=pytest.mark.slow), pytest.param(0.35, marks=pytest.mark.slow)]
)
def test_twice_in_the_middle_of_a_commit_leaves_the_last(pause: float, tmp_path: Path) -> None:
    with building(tmp_path / "a", "slow commits", "--workers", "1") as process:
        assert process.stdout is not None
        while process.stdout.readline() != "committing\n":
            pass
        process.send_signal(signal.SIGINT)
        time.sleep(pause)
        process.send_signal(signal.SIGINT)
        process.wait(120)
    meta = read.read_meta(tmp_path / "a")
    assert meta.births > 0
    assert len(read.read_births(tmp_path / "a", meta)) == meta.births
    assert len(read.read_state(tmp_path / "a", meta).elites) > 0
    with writing(tmp_path / "a"):
        pass
