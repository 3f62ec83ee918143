"""``nichechain plot``: an archive as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from nichechain.cli import console
from nichechain.errors import NichechainError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.archive import Archive

FORMATS = (".png", ".svg", ".pdf")


@dataclass(frozen=True)
class Plot:
    """Draw an archive over behavior space, or its chain."""

    path: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PATH")]
    """Archive folder, or the name of an archive that ships with nichechain."""
    kind: Annotated[
        Literal["elites", "visits", "evolvability", "transitions", "reachability"], tyro.conf.Positional
    ]
    """What to draw; reachability is the graph of which niches lead to which."""
    out: Annotated[Path | None, console.option("FILE", "KIND.png")] = None
    """Picture to write: .png, .svg or .pdf."""
    l: int = 5  # noqa: E741  # the paper's name
    """Generations, for evolvability."""
    lineages: int = 100
    """Lineages, for evolvability."""
    threshold: float = 0.05
    """Smallest probability that gets an arrow, for reachability."""
    estimator: Literal["empirical-bayes", "dirichlet", "mle"] = "empirical-bayes"
    """How T is estimated."""
    min_births: int = 20
    """Niches with fewer births behind their row of T are crossed out, for evolvability."""
    dpi: int = 200
    """Resolution of a .png."""


def run(arguments: Sequence[str]) -> int:
    """Draw."""
    command = console.parse(Plot, arguments)
    out = command.out or Path(f"{command.kind}.png")
    if out.suffix.lower() not in FORMATS:
        raise NichechainError(f"--out is {str(out)!r}, but must end in one of {', '.join(FORMATS)}")
    if not out.parent.is_dir():
        raise NichechainError(f"--out is {str(out)!r}, but there is no folder {out.parent}")
    if not 10 <= command.dpi <= 2000:
        raise NichechainError(f"--dpi is {command.dpi}, but must be between 10 and 2000")
    from nichechain.archive import load

    archive = load(command.path)
    # A figure made directly, not through pyplot, needs no display and leaves no state behind.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 7.4))
    _draw(command, archive, figure.add_subplot())
    figure.savefig(out, dpi=command.dpi, bbox_inches="tight", pad_inches=0.15)
    console.console().print(f"wrote {out}")
    return 0


def _draw(command: Plot, archive: Archive, ax: Axes) -> None:
    from nichechain import plots

    match command.kind:
        case "elites":
            plots.plot_elites(archive, ax)
        case "visits":
            plots.plot_visits(archive, ax)
        case "evolvability":
            from nichechain.evolvability import niche_evolvability

            chain = archive.chain(command.estimator)
            scores = niche_evolvability(chain, l=command.l, lineages=command.lineages)
            plots.plot_evolvability(archive, scores, ax, min_births=command.min_births)
        case "transitions":
            plots.plot_transitions(archive, archive.chain(command.estimator), ax)
        case "reachability":
            plots.plot_reachability(
                archive, archive.chain(command.estimator), ax, threshold=command.threshold
            )
