"""``nichechain list``: the archives that are at hand."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from nichechain.cli import output, parsing
from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive


@dataclass(frozen=True)
class ListCommand:
    """Archives that ship with nichechain, and those of a folder."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")] = Path("archives")
    """Where to look for archives of your own."""
    format: Literal["table", "csv", "json"] = "table"
    """How to write it."""


def run(arguments: Sequence[str]) -> int:
    """List the archives."""
    command = parsing.parse(ListCommand, arguments)
    if not command.folder.is_dir() and command.folder != Path("archives"):
        raise NichechainError(f"folder is {str(command.folder)!r}, but there is no such folder")
    import pandas as pd

    rows = list(_rows(command.folder))
    if command.format == "json":
        print(json.dumps(rows, indent=2))
        return 0
    if command.format == "csv":
        print(pd.DataFrame(rows).to_csv(index=False), end="")
        return 0
    shown = output.console()
    table = output.table("archive", "domain", "births", "niches filled", "made by")
    for row in rows:
        if row["error"]:
            table.add_row(row["archive"], "", "", "", row["error"])
            continue
        filled = f"{row['filled']} of {row['niches']}"
        table.add_row(row["archive"], row["domain"], str(row["births"]), filled, row["made"])
    shown.print(table)
    return 0


def _rows(folder: Path) -> Iterator[dict[str, Any]]:
    from nichechain.archive.archive import load, shipped
    from nichechain.archive.read import is_archive

    # In a checkout, what ships lies in ./archives as well.
    places = {load(name).folder.resolve() for name in shipped()}
    own = [path for path in sorted(folder.iterdir()) if is_archive(path)] if folder.is_dir() else []
    for name in (*shipped(), *(str(path) for path in own if path.resolve() not in places)):
        row: dict[str, Any] = dict.fromkeys(("domain", "births", "niches", "filled", "made"))
        try:
            row |= _row(load(name))
            error = None
        except NichechainError as raised:
            error = str(raised)
        yield {"archive": name, **row, "error": error}


def _row(archive: Archive) -> dict[str, Any]:
    meta = archive.meta
    n = len(archive.niches)
    if meta.origin is not None:
        made = meta.origin["kind"]
    else:
        made = "build" if meta.complete else f"build, unfinished: {archive.config.evaluations} asked for"
    return {
        "domain": "" if meta.imported else archive.config.domain,
        "births": meta.births,
        "niches": n,
        "filled": n - archive.counts.never_filled if meta.imported else archive.filled,
        "made": made,
    }
