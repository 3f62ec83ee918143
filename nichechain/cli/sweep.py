"""``nichechain sweep``: how many niches an archive's births fill."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from nichechain.cli import output, parsing, progress
from nichechain.core.checks import check_at_least, shown
from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    import nichechain.validation.grid_size


@dataclass(frozen=True)
class SweepCommand:
    """Bin an archive's births into grids of other sizes: too few niches, too many, and a suggestion."""

    path: parsing.ArchivePath
    sizes: Annotated[str | None, parsing.option("N,N,...", "ten, from 4 to 3,200 niches")] = None
    """Cells along every axis, such as 5,10,20, or along each one, such as 10x20,20x40."""
    behavior: Annotated[str | None, parsing.option("X,Y", "that of the parent with the most children")] = None
    """Behavior whose niche is scored on every grid."""
    l: int = 5
    """Generations, for the score."""
    lineages: int = 100
    """Lineages, for the score."""
    min_births: int = 20
    """Births behind a row of T that is known."""
    draws: int = 10
    """Posterior draws of T behind the score."""
    steps: parsing.Steps = None
    seed: int = 0
    """Of draws, and of the elites that are held out."""
    out: Annotated[Path | None, parsing.option("FILE", "none")] = None
    """A picture of it, .png, .svg or .pdf."""
    json: bool = False
    """Write JSON."""


def run(arguments: Sequence[str]) -> int:
    """Sweep, and say what was found."""
    command = parsing.parse(SweepCommand, arguments)
    _check(command)
    from nichechain.archive.archive import load
    from nichechain.validation.grid_size import default_sizes, sweep

    archive = parsing.seen(load(command.path), command.steps)
    sizes = None if command.sizes is None else parse_sizes(command.sizes)
    tried = len(default_sizes(len(archive.niches.bounds)) if sizes is None else sizes)
    behavior = None if command.behavior is None else _numbers(command.behavior)
    with progress.adding(tried, "grids") as tell:
        found = sweep(
            archive,
            sizes,
            behavior=behavior,
            l=command.l,
            lineages=command.lineages,
            min_births=command.min_births,
            draws=command.draws,
            seed=command.seed,
            on_done=tell,
        )
    if command.out is not None:
        _draw(found, command.out)
    if command.json:
        suggested = None if found.suggestion is None else list(found.suggestion.shape)
        print(json.dumps({**asdict(found), "suggestion": suggested, "advice": found.advice}, indent=2))
        return 0
    shown = output.console()
    table = output.table("grid", "niches", "visited", "rows", "births", "known", "stay", "told", "reached")
    for grid in found.grids:
        table.add_row(
            "x".join(map(str, grid.shape)),
            str(grid.niches),
            f"{grid.visited:.0%}",
            f"{grid.rows_observed:.0%}",
            f"{grid.births_per_row:.0f}",
            f"{grid.known:.0%}",
            f"{grid.staying:.0%}",
            f"{grid.information:.2f}",
            f"{grid.evolvability:.1f}",
        )
    shown.print(table)
    place = ", ".join(f"{x:.4g}" for x in found.behavior)
    explained = {
        "visited": "niches that somebody was born in",
        "rows": "niches of parents: rows of T that births speak of",
        "births": "median number of births behind such a row",
        "known": f"time of a lineage in niches of {found.min_births} births or more",
        "stay": "children born in the niche of their parent",
        "told": "bits that the parent's niche tells of a child's, on elites held out",
        "reached": f"niches reached from {place} ({found.l} generations, {found.lineages} lineages)",
    }
    shown.print(output.facts(explained))
    shown.print(f"\n[bold]Suggestion[/]  {found.advice}")
    if found.built is not None:
        shown.print(
            f"The search kept one elite for each niche of {'x'.join(map(str, found.built))}: "
            "of finer grids, most rows had no parent to speak of."
        )
    if command.out is not None:
        shown.print(f"wrote {command.out}")
    return 0


def parse_sizes(text: str) -> list[int | tuple[int, ...]]:
    """``"5,10x20"`` as ``[5, (10, 20)]``.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    sizes: list[int | tuple[int, ...]] = []
    for part in text.split(","):
        try:
            cells = tuple(int(number) for number in part.split("x"))
        except ValueError:
            cells = ()
        if not cells or min(cells) < 1:
            raise NichechainError(
                f"--sizes is {shown(text)}, but must be cells along every axis such as 5,10,20, "
                "or along each such as 10x20,20x40"
            )
        sizes.append(cells[0] if len(cells) == 1 else cells)
    return sizes


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise NichechainError(f"--behavior is {shown(text)}, but must be numbers such as 1.3,0.7") from None


def _check(command: SweepCommand) -> None:
    check_at_least(1, **{"--min-births": command.min_births, "--draws": command.draws})
    check_at_least(0, **{"--seed": command.seed})
    if command.out is not None:
        output.check_out(command.out)


def _draw(found: nichechain.validation.grid_size.Sweep, out: Path) -> None:
    from nichechain.plots.validation import plot_filling, plot_scores, plot_surprise

    figure = output.new_figure(15.0, 5.0)
    left, middle, right = figure.subplots(1, 3, gridspec_kw={"wspace": 0.28})
    plot_filling(found, left)
    plot_surprise(found, middle)
    plot_scores(found, right)
    output.save_figure(figure, out)
