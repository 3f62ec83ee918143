"""What is committed survives whatever happens to the build."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from nichechain.archive.archive import load

from .samples import (
    CONFIG,
    ROOT,
    built,
)

# Builds in forked children that are killed, each going on from what the last one left. A child
# says when it has made its first commit; it then has until a random instant to live.
KILLER = """
import os, random, signal, sys, time
from pathlib import Path
import ribs.archives
import pyarrow.parquet
from nichechain.archive import filling, read, write
from nichechain.archive.building import build
from nichechain.search.config import BuildConfig
from nichechain.execution import Threads
from nichechain.core.randomness import Purpose

folder, kills = Path(sys.argv[1]), int(sys.argv[2])
config = BuildConfig("arm", (9, 7), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=int(sys.argv[3]),
                     initial=100, batch=64, scale=0.3, seed=5)
write.PART_ROWS = 200
filling.CHECKPOINT_SECONDS = -1.0
filling._COMMIT_SHARE = 1e9
random.seed(kills)

for kill in range(kills):
    ready, say = os.pipe()
    child = os.fork()
    if child == 0:
        commit = write.Writer.commit
        def committing(self, state):
            if kill % 3 == 0:
                os.write(say, b".")
            commit(self, state)
            os.write(say, b".")
        write.Writer.commit = committing
        with Threads(1) as executor:
            build(config, folder, executor)
        os._exit(0)
    os.close(say)
    os.read(ready, 1)
    time.sleep(random.random() * 0.06)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    os.close(ready)
    births = read.read_meta(folder).births if read.is_archive(folder) else 0
    print(births, *sorted(path.name for path in folder.rglob("*.tmp")), flush=True)
"""


def check_kills(kills: int, evaluations: int, folder: Path) -> None:
    config = replace(CONFIG, evaluations=evaluations)
    expected = built(folder / "whole", config)
    archive = folder / "killed"
    done = subprocess.run(
        [sys.executable, "-c", KILLER, str(archive), str(kills), str(evaluations)],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        timeout=1800,
    )
    births = [int(line.split()[0]) for line in done.stdout.splitlines()]
    assert len(births) == kills
    # No kill takes back what was committed, and most of them came in the middle.
    assert births == sorted(births)
    assert sum(0 < count < evaluations for count in births) > kills // 2
    assert len(load(archive).births()) == births[-1]
    assert built(archive, config) == expected


def test_resumes_after_kills(tmp_path: Path) -> None:
    check_kills(6, 6_000, tmp_path)


@pytest.mark.slow
def test_resumes_after_many_kills(tmp_path: Path) -> None:
    check_kills(50, 40_000, tmp_path)
