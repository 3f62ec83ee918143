"""One writer at a time, and what writers leave behind."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from nichechain.archive import filling as building
from nichechain.archive import read, write
from nichechain.archive.archive import load
from nichechain.archive.building import build
from nichechain.core.errors import ArchiveError
from nichechain.core.files import writing
from nichechain.execution import Threads

from .samples import (
    CONFIG,
    ROOT,
    built,
    content,
    read_all,
    written,
)


def test_a_second_writer_is_refused(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, pristine)
    with writing(folder), Threads(1) as executor:
        with pytest.raises(
            ArchiveError,
            match=f"is being written by process {os.getpid()} on {platform.node()}: wait for it, or stop it",
        ):
            build(replace(CONFIG, evaluations=500), folder, executor)
        # Readers need not wait.
        read_all(folder)
    assert content(folder) == pristine
    built(folder, replace(CONFIG, evaluations=500))


def test_a_killed_writer_lets_go(tmp_path: Path) -> None:
    code = (
        "import sys, time; from pathlib import Path; from nichechain.core.files import writing\n"
        "with writing(Path(sys.argv[1])): print('held', flush=True); time.sleep(60)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path)], stdout=subprocess.PIPE, cwd=ROOT
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"held\n"
        with pytest.raises(ArchiveError, match="is being written"), writing(tmp_path):
            pass
        process.kill()
    with writing(tmp_path):
        pass


def test_the_owner_is_nobody_after_a_crash(pristine: dict[str, bytes], tmp_path: Path) -> None:
    """Whoever is named in the folder, only a living process holds the lock."""
    folder = written(tmp_path, pristine)
    (folder / ".owner").write_text('{"pid": 1, "host": "elsewhere"}')
    with writing(folder):
        pass
    assert not (folder / ".owner").exists()


@pytest.mark.parametrize(
    ("owner", "said"),
    [
        ('{"pid": 12, "host": "node7"}', "by process 12 on node7:"),
        ('{"pid": 12, "host": "\\u001b[31m"}', "by process 12:"),
        ('{"pid": "x", "host": "node7"}', "by another process:"),
        ("[]", "by another process:"),
        ("", "by another process:"),
        ("[" * 100_000, "by another process:"),
    ],
)
def test_what_is_said_of_the_owner(owner: str, said: str, tmp_path: Path) -> None:
    with writing(tmp_path):
        (tmp_path / ".owner").write_text(owner)
        with pytest.raises(ArchiveError, match=said), writing(tmp_path):
            pass


# Reads as fast as it can while another process commits.
READER = """
import sys
from pathlib import Path
import numpy as np
from nichechain.archive import filling as building, read, write
from nichechain.archive.archive import load

folder, total = Path(sys.argv[1]), int(sys.argv[2])
seen, reads, kept = set(), 0, None
print("ready", flush=True)
while True:
    if not read.is_archive(folder):
        continue
    archive = load(folder)
    births = archive.births()
    count = archive.meta.births
    assert len(births) == count
    assert births["uid"].tolist() == list(range(count))
    # The elites are those of just these births.
    born = births.loc[births["accepted"]].groupby("child_niche")["uid"].last()
    assert archive.elites.niche.tolist() == born.index.tolist()
    assert archive.elites.uid.tolist() == born.tolist()
    # An archive that was opened long ago still has the births of its own commit.
    if kept is None:
        kept = archive
    assert len(kept.births()) == kept.meta.births
    assert kept.counts_of().matrix.sum() <= kept.meta.births
    seen.add(count)
    reads += 1
    if count == total:
        break
print(reads, len(seen), kept.meta.births)
"""


def test_readers_see_whole_commits_and_are_never_kept_waiting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(building, "CHECKPOINT_SECONDS", -1.0)
    monkeypatch.setattr(building, "_COMMIT_SHARE", 1e9)
    config = replace(CONFIG, evaluations=5_000)
    with subprocess.Popen(
        [sys.executable, "-c", READER, str(tmp_path / "a"), str(config.evaluations)],
        stdout=subprocess.PIPE,
        cwd=ROOT,
        text=True,
    ) as reader:
        assert reader.stdout is not None
        assert reader.stdout.readline() == "ready\n"
        with writing(tmp_path / "a"):
            # Nobody reads what is not there yet, nor waits for the lock.
            assert reader.poll() is None
        built(tmp_path / "a", config)
        reads, commits, first = map(int, reader.communicate(timeout=120)[0].split())
    assert reader.returncode == 0
    assert reads >= commits >= 2
    assert first < config.evaluations


def test_reading_begins_no_threads(pristine: dict[str, bytes], tmp_path: Path) -> None:
    """One that still held Python's bytes when the interpreter ended would abort it."""
    code = (
        "import os, sys\n"
        "from nichechain.archive.archive import load\n"
        "before = len(os.listdir('/proc/self/task'))\n"
        "archive = load(sys.argv[1])\n"
        "archive.births(), archive.counts_of()\n"
        "print(len(os.listdir('/proc/self/task')) - before)"
    )
    if not Path("/proc/self/task").is_dir():
        pytest.skip("threads are counted where /proc tells them")
    done = subprocess.run(
        [sys.executable, "-c", code, str(written(tmp_path, pristine))],
        capture_output=True,
        cwd=ROOT,
        text=True,
        check=True,
    )
    assert done.stdout == "0\n"


def test_a_folder_that_is_built_anew_is_no_later_commit(pristine: dict[str, bytes], tmp_path: Path) -> None:
    """Births of another build must not pass for those of the one that was opened."""
    folder = written(tmp_path, pristine)
    archive = load(folder)
    write.clear(folder)
    built(folder, replace(CONFIG, evaluations=700, seed=6))
    with pytest.raises(ArchiveError, match=r"births.part-000000-00200"):
        archive.births()


STALE = {
    "elites-000000001.npz": b"of an earlier commit",
    "elites-000000450.npz.tmp": b"cut short",
    "births/part-000002-00049.parquet": b"of an earlier commit",
    "births/part-000009-00001.parquet.tmp": b"cut short",
    "meta.json.tmp": b"{",
}
FOREIGN = {"notes.txt": b"mine", "births/notes.txt": b"mine", "figure.png": b"mine", "elites.csv": b"mine"}


def test_stale_files_are_ignored_and_swept(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path / "archive", {**pristine, **STALE, **FOREIGN})
    read_all(folder)
    assert load(folder).meta.births == 450
    expected = built(tmp_path / "fresh", replace(CONFIG, evaluations=500))
    assert built(folder, replace(CONFIG, evaluations=500)) == {**expected, **FOREIGN}


def test_clear_removes_the_archive_and_nothing_else(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, {**pristine, **STALE, **FOREIGN})
    write.clear(folder)
    assert content(folder) == FOREIGN
    assert not read.is_archive(folder)
    write.clear(folder)
    assert built(folder) == {**pristine, **FOREIGN}
