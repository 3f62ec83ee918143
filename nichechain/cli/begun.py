"""What is done with a study that was begun, whatever it studies: go on with it, report on it."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from nichechain.cli import output, parsing


@dataclass(frozen=True)
class ReportCommand:
    """Tables, figure and report of a study, as far as it is."""

    path: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="PATH")]
    """Folder of the study."""


@dataclass(frozen=True)
class ResumeCommand(ReportCommand):
    """Go on with a study that was begun."""

    runs: Annotated[int | None, parsing.option("INT", "as many as were asked for")] = None
    """Runs of each kind that is compared."""
    workers: parsing.Workers = None
    cache_memory: parsing.CacheMemory = None


def stopped(command: str, folder: Path) -> int:
    """Tell who interrupted a study how to go on; the exit status."""
    again = f"nichechain {command} resume {shlex.quote(str(folder))}"
    output.console().print(f"Stopped; what was made is kept. To go on:\n  {again}")
    return 130
