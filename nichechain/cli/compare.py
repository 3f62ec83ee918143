"""``nichechain compare``: one archive against another."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from nichechain.cli import output, parsing, progress
from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    from nichechain.validation.contrast import Contrast

_NAMES = {
    "evolvability": "reached by {lineages} lineages",
    "reach": "reached by one lineage",
    "coverage": "filled by {births} births",
}


@dataclass(frozen=True)
class CompareCommand:
    """l-evolvability, reach and coverage of one archive against another of the same niches."""

    first: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="A")]
    """Archive folder, or the name of an archive that ships with nichechain."""
    second: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="B")]
    """Another: operators, seeds, searches or domains may differ, niches not."""
    all_births: bool = False
    """All births of all runs, not only as many of each as the shortest has."""
    l: int = 5
    """Generations to look ahead."""
    lineages: int = 100
    """Independent lineages U: l times U descendants."""
    min_births: int = 20
    """Niches with fewer births behind their row of T, in either archive, are left out."""
    resamples: int = 100
    """Resamples of runs, or of elites where an archive has one run, for the interval."""
    draws: int = 4
    """Posterior draws of T for each resample."""
    seed: int = 0
    """Of resamples and draws."""
    format: Literal["table", "csv", "json"] = "table"
    """How to write it."""


def run(arguments: Sequence[str]) -> int:
    """Compare."""
    command = parsing.parse(CompareCommand, arguments)
    from nichechain.archive import read
    from nichechain.archive.archive import load
    from nichechain.evolvability.question import Question
    from nichechain.validation.contrast import contrast

    Question(command.l, command.lineages)
    check_at_least(0, **{"--seed": command.seed})
    archives = load(command.first), load(command.second)
    if archives[0].niches != archives[1].niches:
        raise NichechainError(
            f"{command.first} and {command.second} have different niches: compare archives of the same grid, "
            "bounds and outside"
        )
    births = [read.read_births(archive.folder, archive.meta) for archive in archives]
    with progress.adding(2 * command.resamples, "resamples") as tell:
        found = contrast(
            births[0],
            births[1],
            archives[0].niches,
            align=not command.all_births,
            l=command.l,
            lineages=command.lineages,
            min_births=command.min_births,
            resamples=command.resamples,
            draws=command.draws,
            seed=command.seed,
            on_done=tell,
        )
    if command.format == "csv":
        print(found.to_frame().to_csv(index=False), end="")
    elif command.format == "json":
        print(json.dumps(asdict(found), indent=2))
    else:
        _show(found)
    return 0


def _show(found: Contrast) -> None:
    shown = output.console()
    shown.print(
        f"[bold]B against A[/] in niches; evolvability and reach after {found.l} generations, "
        f"over {found.niches} niches with {found.min_births} births in both"
    )
    table = output.table("niches", "A", "B", "B − A", "90 % interval")
    for row in found.rows:
        name = _NAMES[row.figure].format(lineages=found.lineages, births=found.births)
        interval = f"{row.low:+.2f} to {row.high:+.2f}"
        table.add_row(name, f"{row.first:.2f}", f"{row.second:.2f}", f"{row.difference:+.2f}", interval)
    shown.print(table)
    _warn(found)
    for name, (kind, number) in zip("AB", found.clusters, strict=True):
        shown.print(f"{name}: resampled over {number} {kind}")
    if any(kind == "elites" for kind, _ in found.clusters):
        shown.print(
            "One run says nothing of how runs differ: the interval is that of other elites within it. "
            "Merge several runs to have it over runs."
        )


def _warn(found: Contrast) -> None:
    """Say what makes the two less comparable than they look."""
    shown = output.console()
    if found.aligned is None and found.recorded[0] != found.recorded[1]:
        shown.print(
            f"A has {found.recorded[0]} births and B {found.recorded[1]}, and all were used: where the level "
            "drifts as a search goes on, that alone makes them differ."
        )
    if found.used != found.recorded:
        shown.print(
            f"Only the first {found.aligned} births of each run are compared, as many as the shortest has: "
            f"{found.used[0]} of {found.recorded[0]} in A, {found.used[1]} of {found.recorded[1]} in B "
            "(--all-births uses all)."
        )
    if found.shared:
        shown.print(
            f"The first {found.shared} births are the same in A and B: as far as that goes they are one "
            "search, which says nothing of how two of them differ."
        )
