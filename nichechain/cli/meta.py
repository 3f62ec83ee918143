"""``nichechain evolvability PATH --elite I,J --meta N``: how evolvable the children of an elite are."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from nichechain.cli import output, progress, workers
from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive
    from nichechain.cli.evolvability import EvolvabilityCommand

_OFFSPRING = 10
_CHILDREN_ALONE = ("l", "lineages", "method", "convention", "estimator", "unvisited", "uncertainty", "steps")


def check(command: EvolvabilityCommand) -> None:
    """Refuse what belongs to a chain: both generations are measured."""
    assert command.meta is not None
    if command.elite is None:
        raise NichechainError("--meta belongs to --elite, which is not given")
    check_at_least(2, **{"--meta": command.meta})
    if command.offspring is not None:
        check_at_least(1, **{"--offspring": command.offspring})
    if command.fresh_only:
        raise NichechainError(
            "--fresh-only and --meta exclude each other: with --meta all offspring are fresh"
        )
    for name in _CHILDREN_ALONE:
        value, usual = getattr(command, name), getattr(type(command), name)
        if value != usual:
            raise NichechainError(
                f"--{name} is {value}, but belongs to what a chain foretells: --meta measures two generations"
            )


def show(command: EvolvabilityCommand, archive: Archive) -> int:
    """Measure, and write what came of it."""
    import pandas as pd

    from nichechain.evolvability import meta_evolvability
    from nichechain.niches import parse_niche

    assert command.elite is not None
    assert command.meta is not None
    elite = archive.elite(parse_niche(command.elite, "--elite"))
    offspring = _OFFSPRING if command.offspring is None else command.offspring
    evaluations = max(1, command.meta * (1 + offspring))
    with (
        workers.hired(command.workers, command.cache_memory) as executor,
        progress.adding(evaluations, "evaluations") as tell,
    ):
        found = meta_evolvability(
            archive,
            elite,
            children=command.meta,
            offspring=offspring,
            seed=command.seed,
            executor=executor,
            on_done=tell,
        )
    values = {name: value for name, value in asdict(found).items() if name != "of_children"}
    label = archive.niches.label(elite.state)
    frame = pd.DataFrame(
        [{"niche": elite.state, "index": label, "root": "elite", **values, "children": command.meta}]
    )
    if command.format == "csv":
        print(frame.to_csv(index=False), end="")
    elif command.format == "json":
        print(json.dumps(output.records(frame), indent=2))
    else:
        shown = output.console()
        shown.print(
            f"[bold]meta-evolvability[/]: niches that {found.lineages} offspring of a child reach, mean over "
            f"{command.meta} children of the elite"
        )
        table = output.table("elite", "of its children", "95 % interval", "of itself", "failed")
        interval = f"{found.low:.2f} to {found.high:.2f}"
        table.add_row(label, f"{found.value:.2f}", interval, f"{found.own:.2f}", str(found.failed))
        shown.print(table)
    return 0
