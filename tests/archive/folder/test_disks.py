"""A disk that fails, fills up or may not be written to: the last commit stays whole."""

from __future__ import annotations

import errno
import io
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from nichechain.archive import read, write
from nichechain.archive.archive import load
from nichechain.core.errors import ArchiveError
from nichechain.search.config import BuildConfig

from .samples import CONFIG, ROOT, built, content, read_all, written

LATER = replace(CONFIG, evaluations=700)


class _PowerCutError(BaseException):
    """No handler of ours may catch it."""


class Disk:
    """Fails at the n-th of the operations on files: once, or from then on.

    Parameters
    ----------
    n : int
    error : callable
        Makes what is raised.
    forever : bool
    """

    def __init__(self, n: int, error: Callable[[], BaseException], forever: bool) -> None:
        self.n, self.error, self.forever = n, error, forever
        self.operations: list[str] = []

    def operate(self, name: str) -> None:
        self.operations.append(name)
        if len(self.operations) == self.n + 1 or (self.forever and len(self.operations) > self.n):
            raise self.error()

    @property
    def failed(self) -> bool:
        return len(self.operations) > self.n

    @contextmanager
    def installed(self, folder: Path) -> Iterator[None]:
        """Every creation, write, sync, rename and removal in a folder goes through this."""
        wanted = str(folder)

        def guarded(name: str, original: Callable[..., Any]) -> Callable[..., Any]:
            def call(self_or_path: Any, *arguments: Any, **options: Any) -> Any:
                path = str(self_or_path)
                if isinstance(self_or_path, int):
                    path = str(Path(f"/proc/self/fd/{self_or_path}").readlink())
                if path.startswith(wanted) and not path.endswith((".lock", ".owner")):
                    self.operate(f"{name} {Path(path).name}")
                return original(self_or_path, *arguments, **options)

            return call

        opens = Path.open
        creates = guarded("open", opens)

        def opened(path: Path, mode: str = "r", *arguments: Any, **options: Any) -> Any:
            if mode != "wb" or not str(path).startswith(wanted):
                return opens(path, mode, *arguments, **options)
            return _File(creates(path, mode), lambda: self.operate(f"write {path.name}"))

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Path, "open", opened)
            patch.setattr(Path, "replace", guarded("rename", Path.replace))
            patch.setattr(Path, "unlink", guarded("unlink", Path.unlink))
            patch.setattr(Path, "mkdir", guarded("mkdir", Path.mkdir))
            patch.setattr(os, "fsync", guarded("fsync", os.fsync))
            yield


class _File(io.FileIO):
    """A file that writes half of what it is given before it fails."""

    def __init__(self, file: Any, operate: Callable[[], None]) -> None:
        super().__init__(os.dup(file.fileno()), "wb")
        file.close()
        self.operate = operate

    def write(self, data: Any) -> int:
        try:
            self.operate()
        except BaseException:
            super().write(data[: len(data) // 2])
            raise
        return super().write(data)


def no_space() -> OSError:
    return OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def broken() -> OSError:
    return OSError(errno.EIO, os.strerror(errno.EIO))


SAID = re.compile(r".* cannot be written( to: |: .*; the last commit, of 450 births, is whole: another).*")


def attempt(folder: Path, config: BuildConfig) -> str | None:
    """Build; what was said if that did not work."""
    try:
        built(folder, config)
    except _PowerCutError:
        return "power cut"
    except ArchiveError as error:
        return str(error)
    return None


@pytest.mark.parametrize("kind", ["power cut", "full", "broken once"])
def test_a_failure_at_every_operation_of_a_commit(
    kind: str, pristine: dict[str, bytes], tmp_path: Path
) -> None:
    """Fail each write, sync, rename and removal in turn; go on, and the same bytes are there."""
    expected = built(tmp_path / "whole", LATER)
    seen = set()
    for n in range(200):
        folder = written(tmp_path / str(n), pristine)
        disk = Disk(
            n,
            {"power cut": _PowerCutError, "full": no_space, "broken once": broken}[kind],
            forever=kind != "broken once",
        )
        with disk.installed(folder):
            said = attempt(folder, LATER)
        assert said in (None, "power cut") or SAID.fullmatch(said), said
        if not disk.failed:
            assert content(folder) == expected
            break
        seen |= {operation.split()[0] for operation in disk.operations}
        archive = load(folder)
        # What fails once may be tried again when the build ends, with the births there are by then.
        assert archive.meta.births in ((450, 612, 700) if kind == "broken once" else (450, 700))
        assert len(archive.births()) == archive.meta.births
        assert built(folder, LATER) == expected
        shutil.rmtree(folder)
    assert seen >= {"open", "write", "fsync", "rename", "unlink"}
    # Two parts of births, the elites and the metadata are each opened, written, synced and renamed,
    # and their folder synced.
    assert n >= 4 * 5


def test_a_failure_at_every_operation_of_the_first_commit(tmp_path: Path) -> None:
    """Before there is anything to keep."""
    expected = built(tmp_path / "whole")
    for n in range(200):
        folder = tmp_path / str(n)
        disk = Disk(n, no_space, forever=True)
        with disk.installed(folder):
            said = attempt(folder, CONFIG)
        assert not said or "No space left on device" in said
        if not disk.failed:
            break
        assert not read.is_archive(folder) or load(folder).meta.births == 450
        assert built(folder) == expected
        shutil.rmtree(folder)
    assert n > 20


def test_half_a_file_is_not_left_on_a_full_disk(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, pristine)
    disk = Disk(2, no_space, forever=False)
    with disk.installed(folder), pytest.raises(ArchiveError):
        built(folder, LATER)
    assert not list(folder.rglob("*.tmp"))


SMALL_DISK = """
import shutil, subprocess, sys
from pathlib import Path
from nichechain.archive import read, write
from nichechain.archive.building import build
from nichechain.search.config import BuildConfig
from nichechain.core.errors import ArchiveError
from nichechain.execution import Threads
from nichechain.archive import filling as building
from nichechain.archive.archive import load

write.PART_ROWS = 1000
building.CHECKPOINT_SECONDS = -1.0
building._COMMIT_SHARE = 1e9
disk = Path(sys.argv[1])
config = BuildConfig("arm", (9, 7), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=8_000, initial=100, batch=1000,
                     scale=0.3, seed=5)
subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "none", disk], check=True)


def attempt():
    with Threads(1) as executor:
        try:
            build(config, disk / "archive", executor)
        except ArchiveError as error:
            print(error)


attempt()
meta = read.read_meta(disk / "archive")
print(meta.births)
print(len(read.read_births(disk / "archive", meta)))
subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
attempt()
print(load(disk / "archive").meta.births)
subprocess.run(["mount", "-o", "remount,rw,size=64m", disk], check=True)
attempt()
shutil.copytree(disk / "archive", sys.argv[2])
"""


def test_a_small_disk_and_one_that_is_read_only(tmp_path: Path) -> None:
    """A real one: a file system in memory, which only root may mount."""
    disk = tmp_path / "disk"
    disk.mkdir()
    if (
        os.getuid()
        or subprocess.run(
            ["mount", "-t", "tmpfs", "-o", "size=64k", "none", str(disk)], capture_output=True, check=False
        ).returncode
    ):
        pytest.skip("may not mount a file system")
    subprocess.run(["umount", str(disk)], check=True)
    try:
        done = subprocess.run(
            [sys.executable, "-c", SMALL_DISK, str(disk), str(tmp_path / "copy")],
            capture_output=True,
            text=True,
            check=True,
            cwd=ROOT,
            timeout=300,
        )
    finally:
        subprocess.run(["umount", str(disk)], check=True)
    full, births, rows, read_only, still = done.stdout.splitlines()
    assert 100 < int(births) < 8_000
    assert "No space left on device" in full
    assert f"the last commit, of {births} births, is whole" in full
    assert rows == still == births
    assert "cannot be written to: Read-only file system" in read_only
    # With room, it ends as if nothing had been.
    config = replace(CONFIG, evaluations=8_000, batch=1000)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "PART_ROWS", 1000)
        assert built(tmp_path / "whole", config) == content(tmp_path / "copy")


@pytest.mark.skipif(os.getuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path / "archive", pristine)
    folder.chmod(0o500)
    try:
        with pytest.raises(ArchiveError, match="cannot be written to: Permission denied"):
            built(folder, LATER)
        read_all(folder)
    finally:
        folder.chmod(0o700)


def test_files_are_on_disk_before_they_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every file is synced before it is renamed, and the metadata is renamed last."""
    events: list[str] = []
    fsync, rename = os.fsync, Path.replace

    def synced(descriptor: int) -> None:
        events.append("sync " + Path(f"/proc/self/fd/{descriptor}").readlink().name)
        fsync(descriptor)

    def renamed(self: Path, target: Path) -> Path:
        assert events[-1] == f"sync {self.name}"
        events.append(f"rename {target.name}")
        return rename(self, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(Path, "replace", renamed)
    built(tmp_path / "archive", replace(CONFIG, evaluations=50))
    renames = [event.split()[1] for event in events if event.startswith("rename")]
    assert renames == ["part-000000-00050.parquet", "elites-000000050.npz", "meta.json"]
    # The folders' entries too.
    assert events[-1] == "sync archive"
    assert "sync births" in events
