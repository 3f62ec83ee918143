"""``nichechain calibrate``: births of unselected lineages for an archive that is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from nichechain.cli import output, parsing, progress, workers
from nichechain.core.errors import NichechainError
from nichechain.search.config import BROOD, MOST_FAILED


@dataclass(frozen=True)
class CalibrateCommand:
    """Add births of unselected lineages to a finished archive: they show what lineages do.

    Lineages begin in broods at elites drawn alike, so births go where lineages stand: most to the niches that
    many descendants fall into, and outside. No build goes on with the archive afterwards.
    """

    path: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="PATH")]
    """Archive folder."""
    rollouts: Annotated[int | None, parsing.option("N", "none, but given unless --resume is")] = None
    """How many births to add, such as 2000."""
    brood: int = BROOD
    """Lineages that begin at the same elite."""
    workers: parsing.Workers = None
    cache_memory: parsing.CacheMemory = None
    max_failed: float = MOST_FAILED
    """Share of these births that may fail, from 0 to 1, before it is stopped."""
    resume: bool = False
    """Go on with a calibration that was stopped, in place of --rollouts."""


def run(arguments: Sequence[str]) -> int:
    """Calibrate, then say what came of it."""
    command = parsing.parse(CalibrateCommand, arguments)
    from nichechain.archive import read
    from nichechain.archive.archive import load, shipped

    if command.rollouts is None and not command.resume:
        raise NichechainError(
            "--rollouts is missing: give the number of births to add, such as --rollouts 2000, "
            "or --resume where a calibration was stopped"
        )
    if not command.path.exists() and str(command.path) in shipped():
        raise NichechainError(
            f"{command.path} ships with nichechain, and calibrate adds to a folder of your own: copy the "
            "archive that nichechain info names, and give the copy"
        )
    from nichechain.archive.calibrating import calibrate

    shown = output.console()
    before = read.read_meta(command.path)
    end = before.births + (command.rollouts or 0)
    if command.resume and before.calibrations:
        end = before.calibrations[-1].end
    with workers.hired(command.workers, command.cache_memory) as executor:
        try:
            with progress.build_progress(end) as tell:
                calibrate(
                    command.path,
                    command.rollouts,
                    executor,
                    brood=command.brood,
                    resume=command.resume,
                    on_progress=tell,
                    max_failed=command.max_failed,
                )
        except KeyboardInterrupt:
            progress.leave_at_next_interrupt()
            kept = read.read_meta(command.path)
            if kept.births == before.births:
                shown.print("Stopped; no births were added.")
            else:
                last = kept.calibrations[-1]
                shown.print(
                    f"Stopped; {kept.births - last.first_uid} of {last.births} births are kept. To go on:\n"
                    f"  nichechain calibrate {command.path} --resume"
                )
            return 130
    archive = load(command.path)
    of_lineages = int(archive.counts_of(lineages=True).births.sum())
    rows = {
        "births": f"{archive.meta.births}, {archive.meta.births - before.births} of them new",
        "  of unselected lineages": str(of_lineages),
        "niches filled": f"{archive.filled} of {len(archive.niches)}",
        "rows of T observed": f"{archive.counts.rows_observed} of {len(archive.niches)}",
        "archive": str(command.path),
    }
    shown.print(output.facts(rows))
    return 0
