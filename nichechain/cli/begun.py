"""What is done with work that was begun: go on with it, start over, report on it."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from nichechain.cli import output, parsing
from nichechain.core.errors import NichechainError


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


def go_on_or_start_over(kept: Path, what: str, *, resume: bool, force: bool) -> None:
    """Leave what an interruption left, or remove it, as ``--resume`` and ``--force`` say.

    Raises
    ------
    NichechainError
        If there is something, and neither is given; or if both are.
    """
    if resume and force:
        raise NichechainError("--resume and --force exclude each other: go on, or start over")
    if kept.exists() and not resume:
        if not force:
            raise NichechainError(
                f"{kept} holds an interrupted {what}: --resume goes on with it, --force starts over"
            )
        kept.unlink()
