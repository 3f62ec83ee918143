"""``nichechain import``: births of another program's search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from nichechain.cli import output, parsing
from nichechain.core.errors import NichechainError
from nichechain.search.config import Outside


@dataclass(frozen=True)
class ImportCommand:
    """Make an archive of births that another program logged: no domain is needed, nothing is evaluated."""

    log: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """CSV with a header, plain or gzipped, Parquet, or a folder of Parquet files: one row per evaluated
    child."""
    bounds: Annotated[str, tyro.conf.arg(metavar="X0,X1,Y0,Y1")]
    """Bounds of the niches, in units of behavior."""
    out: Annotated[Path, tyro.conf.arg(metavar="PATH")]
    """Archive folder to make."""
    grid: Annotated[str | None, parsing.option("NXxNY", "none")] = None
    """Cells of the grid along each axis of behavior."""
    niches: Annotated[Path | None, parsing.option("FILE", "none")] = None
    """In place of --grid: centroids of Voronoi niches, a row for each, as .npy, .csv, .txt or .parquet."""
    outside: Outside = "state"
    """Where a behavior out of bounds belongs: a state of its own, one never left, or the nearest niche."""
    parent: Annotated[str | None, parsing.option("COLUMN", "parent_niche")] = None
    """Column with the number of the parent's niche; empty or -1 for initial births."""
    child: Annotated[str | None, parsing.option("COLUMN", "child_niche")] = None
    """Column with the number of the child's niche; empty where the child failed."""
    parent_behavior: Annotated[str | None, parsing.option("COLUMN,COLUMN", "none")] = None
    """In place of --parent: columns with the parent's behavior, or one column of lists."""
    child_behavior: Annotated[str | None, parsing.option("COLUMN,COLUMN", "none")] = None
    """In place of --child: columns with the child's behavior, or one column of lists."""
    run: Annotated[str | None, parsing.option("COLUMN", "one run")] = None
    """Column that tells runs apart."""
    uid: Annotated[str | None, parsing.option("COLUMN", "the row's number")] = None
    """Column with the child's number."""
    elite: Annotated[str | None, parsing.option("COLUMN", "none")] = None
    """Column with the parent's number: lets children of one parent count as related."""
    step: Annotated[str | None, parsing.option("COLUMN", "none")] = None
    """Column with the step of the search."""
    lineage: Annotated[str | None, parsing.option("COLUMN", "none")] = None
    """Column that is true where the parent was not selected: it was the latest birth of a lineage."""
    objective: Annotated[str | None, parsing.option("COLUMN", "none")] = None
    """Column with the child's objective."""
    names: Annotated[str | None, parsing.option("NAME,NAME", "the behavior columns")] = None
    """What the axes of behavior are called."""
    unit: str = "units"
    """Unit of behavior."""
    force: bool = False
    """Replace what was imported to --out before."""


def run(arguments: Sequence[str]) -> int:
    """Import."""
    command = parsing.parse(ImportCommand, arguments)
    for name in ("parent", "child"):
        if getattr(command, name) is not None and getattr(command, f"{name}_behavior") is not None:
            raise NichechainError(f"--{name} and --{name}-behavior exclude each other: give one of them")
    if (command.grid is None) == (command.niches is None):
        raise NichechainError(
            "niches are either the cells of --grid or around the centroids of --niches: give one of them"
        )
    from nichechain.archive import Axes, Columns, import_births, load
    from nichechain.niches import CVTNiches, GridNiches, Niches, parse_bounds, parse_shape, read_centroids

    columns = Columns(
        parsing.words(command.parent_behavior) or command.parent or "parent_niche",
        parsing.words(command.child_behavior) or command.child or "child_niche",
        command.run,
        command.uid,
        command.elite,
        command.step,
        command.lineage,
        command.objective,
    )
    bounds = parse_bounds(command.bounds, "--bounds")
    niches: Niches
    if command.niches is not None:
        niches = CVTNiches(read_centroids(command.niches), bounds, command.outside)
    else:
        assert command.grid is not None
        niches = GridNiches(parse_shape(command.grid, "--grid"), bounds, command.outside)
    axes = Axes(parsing.words(command.names), command.unit)
    import_births(command.log, command.out, niches, columns=columns, axes=axes, overwrite=command.force)
    archive = load(command.out)
    counts = archive.counts
    rows = {
        "births": f"{int(counts.visits.sum())}, {int(counts.births.sum())} of them with a parent",
        "  outside the grid": str(counts.births_outside),
        "niches filled": f"{len(niches) - counts.never_filled} of {len(niches)}",
        "rows of T observed": f"{counts.rows_observed} of {len(niches)}",
        "archive": str(command.out),
    }
    shown = output.console()
    shown.print(output.facts(rows))
    if command.elite is None:
        shown.print(
            "The log does not say whose children births are: all count as unrelated, and what follows "
            "may seem surer than it is."
        )
    if archive.orphan_note is not None:
        shown.print(f"[bold]Warning:[/] {archive.orphan_note}")
    return 0
