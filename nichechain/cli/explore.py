"""``nichechain explore``: a page on which one clicks a niche and sees where its descendants go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from nichechain.cli import output, parsing, progress
from nichechain.core.checks import check_at_least


@dataclass(frozen=True)
class ExploreCommand:
    """Write a page on which one clicks a niche and sees where its descendants go.

    The page is one HTML file that needs no network.
    """

    path: parsing.ArchivePath
    out: Path = Path("explore.html")
    """Page to write."""
    l: int = 5
    """Generations that it shows first, 1 to 10."""
    lineages: int = 100
    """Lineages U that it shows first."""
    estimator: parsing.EstimatorName = "empirical-bayes"
    """How T is estimated."""
    draws: Annotated[int | None, parsing.option("INT", "50, and 6 for over 1,000 niches")] = None
    """Posterior draws of T behind numbers and intervals."""
    seed: int = 0
    """Seed of the draws."""
    films: Annotated[Path | None, parsing.option("FOLDER", "none")] = None
    """Folder of what `nichechain watch` made, shown with the elites: 14,14.gif and so on."""
    beside: Annotated[str | None, parsing.option("PATH", "none")] = None
    """A second archive to show beside the first."""
    steps: parsing.Steps = None


def run(arguments: Sequence[str]) -> int:
    """Write the page."""
    command = parsing.parse(ExploreCommand, arguments)
    output.check_out(command.out, ())
    check_at_least(0, **{"--seed": command.seed})
    from nichechain.archive.archive import load
    from nichechain.plots.explorer import check_drawable, draws_of, write_explorer

    archive = parsing.seen(load(command.path), command.steps)
    other = None if command.beside is None else parsing.seen(load(command.beside), command.steps)
    for each in filter(None, (archive, other)):
        check_drawable(each)
    chain = progress.estimated(archive, command.estimator)
    pairs = [(archive, chain)]
    if other is not None:
        pairs.append((other, progress.estimated(other, command.estimator)))
    draws = sum(draws_of(each) if command.draws is None else command.draws for _, each in pairs)
    with progress.adding(draws, "draws of T") as tell:
        write_explorer(
            archive,
            chain,
            command.out,
            l=command.l,
            lineages=command.lineages,
            draws=command.draws,
            seed=command.seed,
            films=command.films,
            beside=None if other is None else pairs[1],
            on_done=tell,
        )
    size = command.out.stat().st_size
    output.console().print(f"wrote {command.out} ({size / 1e6:.1f} MB): open it in a browser")
    return 0
