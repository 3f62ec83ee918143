"""One writer at a time in a folder, who says who it is."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from nichechain.core.errors import ArchiveError
from nichechain.core.files import sync_folder

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
