"""``nichechain table``: one row per niche."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from nichechain.cli import output, parsing, progress
from nichechain.core.checks import check_at_least
from nichechain.core.text import some

if TYPE_CHECKING:
    import pandas as pd

_SHOWN = 20
# What single births decide where there are few.
_OF_FEW_BIRTHS = ("evolvability", "entered")


@dataclass(frozen=True)
class TableCommand:
    """One row per niche: births, curiosity, l-evolvability with its interval, wormholes, dissimila.

    Rows of --format csv and json are those of all niches that births fell in.
    """

    path: parsing.ArchivePath
    by: Literal[
        "niche",
        "visits",
        "births",
        "curiosity",
        "entered",
        "evolvability",
        "wormholes-out",
        "wormholes-in",
        "expected-ratio",
    ] = "evolvability"
    """What to sort by, the largest first; niche is the order of niches."""
    min_births: int = 20
    """By evolvability or entered, niches with fewer births of parents there are not ranked and come last."""
    top: Annotated[int | None, parsing.option("INT", f"{_SHOWN} in a table, else all")] = None
    """So many rows."""
    l: int = 5
    """Generations to look ahead."""
    lineages: int = 100
    """Independent lineages U: l times U descendants."""
    estimator: parsing.EstimatorName = "empirical-bayes"
    """T from births: posteriors around a pooled or a uniform base, or row-normalised counts."""
    children: int = 5
    """Recorded children that an elite needs for its ratio r*."""
    draws: int = 50
    """Posterior draws of T to average over."""
    steps: parsing.Steps = None
    seed: int = 0
    """Seed of the draws."""
    format: Literal["table", "csv", "json"] = "table"
    """How to write it."""


def run(arguments: Sequence[str]) -> int:
    """Write the table."""
    command = parsing.parse(TableCommand, arguments)
    if command.top is not None:
        check_at_least(1, **{"--top": command.top})
    check_at_least(0, **{"--seed": command.seed, "--min-births": command.min_births})
    check_at_least(1, **{"--draws": command.draws})
    check_at_least(2, **{"--children": command.children})
    from nichechain.archive.archive import load
    from nichechain.evolvability.question import Question
    from nichechain.landscape.niche_table import niche_table

    Question(command.l, command.lineages)
    archive = parsing.seen(load(command.path), command.steps)
    draws = 1 if command.estimator == "mle" else command.draws
    with progress.adding(draws, "draws of T") as tell:
        frame = niche_table(
            archive,
            l=command.l,
            lineages=command.lineages,
            estimator=command.estimator,
            children=command.children,
            draws=command.draws,
            seed=command.seed,
            on_done=tell,
        )
    frame, last = _sorted(frame, command)
    known = len(frame)
    frame = frame.head(command.top or (_SHOWN if command.format == "table" else known))
    if command.format == "csv":
        print(frame.to_csv(index=False), end="")
    elif command.format == "json":
        print(json.dumps(output.records(frame), indent=2))
    else:
        _show(frame, command, known, last)
    return 0


def _sorted(frame: pd.DataFrame, command: TableCommand) -> tuple[pd.DataFrame, int]:
    """The rows in order, and how many of them come last for want of births."""
    import pandas as pd

    column = command.by.replace("-", "_")
    frame = frame.sort_values(column, ascending=command.by == "niche", kind="stable")
    if command.by not in _OF_FEW_BIRTHS:
        return frame, 0
    few = frame["births"] < command.min_births
    # Among themselves in the order of niches, which claims nothing.
    rest = frame[few].sort_values("niche")
    return pd.concat([frame[~few], rest]), len(rest)


def _show(frame: pd.DataFrame, command: TableCommand, known: int, last: int) -> None:
    import pandas as pd

    shown = output.console()
    shown.print(f"[bold]{len(frame)} of {known} niches[/] that births fell in, by {command.by}")
    shown.print(
        f"[dim]reached: by {some(command.lineages, 'lineage')} of {some(command.l, 'generation')}, "
        f"by {command.estimator}[/]"
    )
    headings = ("niche", "born\nin", "born\nof", "curiosity", "reached", "90 %\ninterval")
    table = output.table(*headings, "wormholes", "r*")
    # So that it fits into 80 columns.
    table.collapse_padding = True
    for column in table.columns:
        column.no_wrap = True
    for row in frame.itertuples():
        flagged = not pd.isna(row.dissimilum) and row.dissimilum
        both = None if pd.isna(row.wormholes_out) else row.wormholes_out + row.wormholes_in
        table.add_row(
            row.index,
            str(row.visits),
            str(row.births),
            _number(row.curiosity, "g"),
            _number(row.evolvability, ".1f"),
            "" if row.low == row.high else f"{row.low:.1f} to {row.high:.1f}",
            _number(both, "d"),
            ("* " if flagged else "") + _number(row.expected_ratio, ".2f"),
            style="dim" if row.births < command.min_births and last else None,
        )
    shown.print(table)
    shown.print(
        "born in, born of: births that fell there, and births of parents there. wormholes: out\n"
        "of it and into it. r*: how far recorded children of its elite are from each other, over\n"
        f"how far they are from it; at least {command.children} children are needed, and * marks dissimila.\n"
        "--format csv writes all niches."
    )
    if last:
        shown.print(
            f"{some(last, 'niche')} with fewer than {command.min_births} births of parents there "
            f"{'is not ranked and comes' if last == 1 else 'are not ranked and come'} last (--min-births)."
        )


def _number(value: object, how: str) -> str:
    """A number as text, nothing where it is missing."""
    import pandas as pd

    return "" if pd.isna(value) else format(value, how)
