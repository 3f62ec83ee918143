"""What folders of studies have in common, whatever is studied: ``study.json``, and files of rows."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol, TypeVar

import pyarrow as pa

from nichechain.archive.untrusted import read_file, read_object
from nichechain.core.checks import shown
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.core.files import STUDY_MARK, as_path, write_atomically
from nichechain.core.machine import library_versions
from nichechain.core.parquet import read_parquet
from nichechain.core.text import printable_values

_FILE = STUDY_MARK
_FORMAT = 1
_LARGEST = 1 << 20

Read = TypeVar("Read")


class AnyStudy(Protocol):
    """What studies of any kind have."""

    @property
    def runs(self) -> int:
        """How many of each kind that is compared."""
        ...

    def to_json(self) -> dict[str, Any]:
        """Plain values for JSON."""
        ...


def is_study(folder: str | Path) -> bool:
    """Whether a folder holds a study."""
    return (as_path("folder", folder) / _FILE).is_file()


def write_stored(folder: Path, study: AnyStudy, **more: str) -> None:
    """Write which study the folder holds, and what is told of it besides."""
    values = {"format": _FORMAT, "study": study.to_json(), **more, "versions": library_versions()}
    write_atomically(folder / _FILE, json.dumps(values, indent=1).encode())


def read_stored(folder: Path, read: Callable[[dict[str, Any]], Read], called: str) -> Read:
    """What :func:`write_stored` wrote.

    Parameters
    ----------
    folder : Path
    read : callable
        Makes of the values of the file what is asked for.
    called : str
        What it is a study of.

    Raises
    ------
    ArchiveError
        If there is none, it is damaged, or of another kind or version.
    """
    path = folder / _FILE
    try:
        # It may be a stranger's, as archives may.
        values = printable_values(read_object(read_file(path, folder, _LARGEST)))
        if values["format"] != _FORMAT:
            raise ArchiveError(
                f"{path} has format {shown(values['format'])}, but this version reads {_FORMAT}"
            )
        return read(values)
    except (FileNotFoundError, NotADirectoryError):
        raise ArchiveError(f"{folder} holds no study: it has no {_FILE}") from None
    except OSError as error:
        raise ArchiveError(f"{path} cannot be read: {error.strerror or error}") from error
    except ArchiveError:
        raise
    except (
        ArithmeticError,
        AttributeError,
        KeyError,
        NichechainError,
        RecursionError,
        TypeError,
        ValueError,
    ) as error:
        raise ArchiveError(f"{path} is no study of {called}, or damaged: {error}") from error


def check_continues(old: AnyStudy, new: AnyStudy, folder: Path) -> None:
    """Refuse another study than the one that the folder holds; only ``runs`` may be larger.

    Raises
    ------
    ArchiveError
        If it is another, or has fewer runs.
    """
    before, after = old.to_json(), new.to_json()
    # Searches have a configuration, of which each value is told by its own name.
    names = [name for name in _differing(before, after) if name not in ("runs", "config")]
    names += _differing(before.get("config", {}), after.get("config", {}))
    if names:
        raise ArchiveError(
            f"{folder} holds a study that differs in {', '.join(names)}: go on with that one, "
            "or give another folder"
        )
    if new.runs < old.runs:
        raise ArchiveError(f"{folder} holds a study of {old.runs} runs, more than the {new.runs} asked for")


def _differing(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Names whose values differ."""
    return [name for name in {**before, **after} if before.get(name) != after.get(name)]


def read_rows(path: Path) -> pa.Table:
    """All rows of a file of a study.

    Raises
    ------
    ArchiveError
        If it is damaged.
    """
    try:
        return read_parquet(path, checksums=True)
    except (OSError, pa.ArrowException) as error:
        raise ArchiveError(f"{path} is damaged: {error}") from error
