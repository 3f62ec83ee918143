"""``nichechain compare``: archives against others."""

from __future__ import annotations

import itertools
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
    """l-evolvability, reach and coverage of archives against others of the same niches.

    Several runs of a search on a side are pooled, and the interval tells how runs differ:
    nichechain compare 'archives/uniform-*' 'archives/reach-*'
    """

    first: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="A")]
    """Archive folder, or the name of an archive that ships with nichechain; for several runs a pattern in
    quotes, such as 'archives/a-*', or names with commas between them."""
    second: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="B")]
    """Others: operators, seeds, searches or domains may differ, niches not."""
    all_births: bool = False
    """All births of all runs, not only as many of each as the shortest has."""
    steps: parsing.Steps = None
    l: int = 5
    """Generations to look ahead."""
    lineages: int = 100
    """Independent lineages U: l times U descendants."""
    min_births: int = 20
    """Niches with fewer births behind their row of T, on either side, are left out."""
    resamples: int = 50
    """Resamples of runs, or of elites where a side has one run, for the interval."""
    draws: int = 4
    """Posterior draws of T for each resample."""
    seed: int = 0
    """Of resamples and draws."""
    format: Literal["table", "csv", "json"] = "table"
    """How to write it."""


def run(arguments: Sequence[str]) -> int:
    """Compare."""
    _check_sides(arguments)
    command = parsing.parse(CompareCommand, arguments)
    from nichechain.cli import groups
    from nichechain.evolvability.question import Question
    from nichechain.validation.contrast import contrast

    Question(command.l, command.lineages)
    check_at_least(0, **{"--seed": command.seed})
    sides = [groups.archives_of(text) for text in (command.first, command.second)]
    first, *others = (archive for side in sides for archive in side)
    for other in others:
        if other.niches != first.niches:
            raise NichechainError(
                f"{first.folder} and {other.folder} have different niches: "
                "compare archives of the same grid, bounds and outside"
            )
    births = [[parsing.seen(archive, command.steps).table() for archive in side] for side in sides]
    with progress.adding(2 * command.resamples, "resamples") as tell:
        found = contrast(
            births[0],
            births[1],
            first.niches,
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
        named = [[str(archive.folder) for archive in side] for side in sides]
        print(json.dumps({"archives": named, **asdict(found)}, indent=2))
    else:
        _show(found)
        for name, side in zip("AB", sides, strict=True):
            if odd := groups.differences(side):
                output.console().print(
                    f"The {len(side)} archives of {name} differ in {', '.join(odd)}: "
                    "pooled, they are no runs of one search."
                )
    return 0


def _check_sides(arguments: Sequence[str]) -> None:
    """Say what to do where a shell has spelled out a pattern."""
    names = list(itertools.takewhile(lambda word: not word.startswith("-"), arguments))
    if len(names) > 2:
        raise NichechainError(
            f"there are {len(names)} archives, but must be two sides: put a pattern in quotes, such as "
            "'archives/a-*', or commas between the archives of a side"
        )


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
            "Several runs on each side, such as 'archives/a-*', have it over runs."
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
