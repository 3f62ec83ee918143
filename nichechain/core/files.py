"""Files that are either the old ones or the new ones, and folders with one writer at a time."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from nichechain.core.checks import shown
from nichechain.core.errors import ArchiveError, NichechainError

# The file by which a folder is known to hold an archive, or a study.
ARCHIVE_MARK, STUDY_MARK = "meta.json", "study.json"

# Bytes of a name, by every file system that Linux has.
_LONGEST_NAME = 255


def as_path(name: str, value: str | Path) -> Path:
    """A path that files can have, whether one does or not.

    Parameters
    ----------
    name : str
        What the caller knows it by.
    value : str or Path

    Raises
    ------
    NichechainError
        If it is no path, or no file can have such a name.
    """
    try:
        path = Path(value)
        longest = max(map(len, map(os.fsencode, path.parts)), default=0)
    except (TypeError, ValueError):
        raise NichechainError(f"{name} is {shown(value)}, but must be a path") from None
    if longest > _LONGEST_NAME or "\0" in str(path):
        raise NichechainError(
            f"{name} is {shown(str(path))}, "
            f"but names of files must have at most {_LONGEST_NAME} bytes, none of them 0"
        )
    return path


def keep_apart(folder: Path, mark: str) -> None:
    """Refuse a folder that holds the other thing: archives and studies have folders of the same names.

    Parameters
    ----------
    folder : Path
    mark : str
        :data:`ARCHIVE_MARK` where a study is to be written, :data:`STUDY_MARK` where an archive is.

    Raises
    ------
    ArchiveError
        If it has that file.
    """
    if (folder / mark).is_file():
        held, wanted = ("an archive", "a study") if mark == ARCHIVE_MARK else ("a study", "an archive")
        raise ArchiveError(f"{folder} holds {held}, but {wanted} needs a folder of its own")


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file so that whoever reads it finds the whole of it, even after a crash.

    Parameters
    ----------
    path : Path
        In a folder that exists; what it held is replaced.
    content : bytes

    Raises
    ------
    OSError
        If it cannot be written; what it held is then still there.
    """
    part = path.with_name(f"{path.name}.tmp")
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        # Half a file is of no use, and a full disk needs the room.
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def replace_file(path: str | Path, content: bytes) -> None:
    """:func:`write_atomically` for a file that somebody named.

    Raises
    ------
    NichechainError
        If it cannot be written; what it held is then still there.
    """
    try:
        write_atomically(as_path("path", path), content)
    except OSError as error:
        raise NichechainError(f"{path} cannot be written: {error.strerror or error}") from error


def sync_folder(folder: Path) -> None:
    """Make renames within a folder durable."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


_LOCK = ".lock"
# Beside the lock, for some releases of filelock empty the lock's own file when they only try it.
_OWNER = ".owner"


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Hold the right to write to a folder; the system lets go of it if the process dies.

    So the lock of a process that crashed is nobody's, whatever it left in the folder.

    Raises
    ------
    ArchiveError
        If another process holds it, or the folder cannot be written to.
    """
    from filelock import FileLock, Timeout

    try:
        if not folder.is_dir():
            folder.mkdir(parents=True, exist_ok=True)
            sync_folder(folder.parent)
        lock = FileLock(folder / _LOCK)
        lock.acquire(blocking=False)
    except Timeout:
        raise ArchiveError(
            f"{folder} is being written by {_owner(folder)}: wait for it, or stop it"
        ) from None
    except (OSError, NotImplementedError) as error:
        raise ArchiveError(
            f"{folder} cannot be written to: {getattr(error, 'strerror', None) or error}"
        ) from error
    try:
        # Who we are is a courtesy; without room for it the lock holds all the same.
        with suppress(OSError):
            (folder / _OWNER).write_text(json.dumps({"pid": os.getpid(), "host": platform.node()}))
        yield
    finally:
        with suppress(OSError):
            (folder / _OWNER).unlink(missing_ok=True)
        lock.release()


def _owner(folder: Path) -> str:
    try:
        with (folder / _OWNER).open(encoding="utf-8") as file:
            owner = json.loads(file.read(1000))
        pid, host = int(owner["pid"]), str(owner["host"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return "another process"
    return f"process {pid} on {host}" if host.isprintable() else f"process {pid}"
