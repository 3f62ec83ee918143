"""Several archives in one word of a command line: a pattern such as 'runs/a-*', or names between commas."""

from __future__ import annotations

import glob
from collections.abc import Sequence
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive

# What runs of one search may differ in.
_FREE = ("seed", "evaluations")


def archives_of(text: str) -> list[Archive]:
    """The archives that a word names, in the order of their folders, each once.

    Parameters
    ----------
    text : str
        The folder of an archive or the name of a shipped one, a pattern of folders, or several of these
        between commas. A folder that is called so is meant before any pattern.

    Raises
    ------
    NichechainError
        If a pattern matches no archive, or two hold the same run.
    """
    from nichechain.archive.archive import load
    from nichechain.archive.merge import check_distinct

    found: dict[Path, Archive] = {}
    for name in [text] if Path(text).exists() else text.split(","):
        for each in _matching(name):
            archive = load(each)
            found.setdefault(archive.folder.resolve(), archive)
    archives = list(found.values())
    check_distinct([archive.folder for archive in archives], [archive.meta for archive in archives])
    return archives


def _matching(name: str) -> Sequence[str]:
    from nichechain.archive.read import is_archive

    if Path(name).exists() or not glob.has_magic(name):
        return [name]
    # Path.glob takes no pattern that begins at the root.
    found = sorted(path for path in glob.glob(name) if is_archive(Path(path)))  # noqa: PTH207
    if not found:
        raise NichechainError(
            f"{name!r} matches no archive: it must be a folder, a name or a pattern of folders"
        )
    return found


def differences(archives: Sequence[Archive]) -> list[str]:
    """Names of the settings in which archives differ, as runs of one search do not."""
    return [
        field.name
        for field in fields(archives[0].config)
        if field.name not in _FREE
        and any(
            getattr(one.config, field.name) != getattr(other.config, field.name)
            for one, other in pairwise(archives)
        )
    ]
