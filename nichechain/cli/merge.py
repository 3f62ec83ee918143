"""``nichechain merge``: archives of several runs as one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from nichechain.cli import output, parsing


@dataclass(frozen=True)
class MergeCommand:
    """Make one archive of several of one domain, niches and mutation: counts add, the largest key wins."""

    paths: Annotated[tuple[str, ...], tyro.conf.Positional, parsing.option("PATH", None)]
    """Archive folders, at least two."""
    out: Annotated[Path, tyro.conf.arg(metavar="PATH")]
    """Archive folder to make. No build can go on with it."""


def run(arguments: Sequence[str]) -> int:
    """Merge."""
    command = parsing.parse(MergeCommand, arguments)
    from nichechain.archive.archive import load
    from nichechain.archive.merge import merge

    merge([load(path).folder for path in command.paths], command.out)
    archive = load(command.out)
    counts = archive.counts
    niches = len(archive.niches)
    assert archive.meta.origin is not None
    rows = {
        "runs": str(len(archive.meta.origin["runs"])),
        "births": str(archive.meta.births),
        "niches filled": f"{archive.filled} of {niches}",
        "rows of T observed": f"{counts.rows_observed} of {niches}",
        "archive": str(command.out),
    }
    output.console().print(output.facts(rows))
    return 0
