"""``nichechain plot``: an archive as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from nichechain.cli import output, parsing, progress
from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from nichechain.archive.archive import Archive
    from nichechain.chain import NicheChain
    from nichechain.evolvability import NicheEvolvability

_WITH_THRESHOLD = ("reachability", "classes", "transitions-by-class")

_MAPS = ("elites", "visits", "evolvability", "uncertainty", "reach", "reachability", "wormholes", "classes")

# Figures of two pictures, and their sizes in inches.
_PAIRS = {"uncertainty": (14.0, 7.4), "growth": (12.0, 5.6)}
_FEW_DRAWS = 5


@dataclass(frozen=True)
class PlotCommand:
    """Draw an archive over behavior space, or its chain."""

    path: parsing.ArchivePath
    kind: Annotated[
        Literal[
            "elites",
            "visits",
            "evolvability",
            "uncertainty",
            "growth",
            "reach",
            "reachability",
            "wormholes",
            "classes",
            "transitions",
            "transitions-by-class",
        ],
        tyro.conf.Positional,
    ]
    """What to draw. Maps of niches: elites, visits (births), evolvability, uncertainty (with its interval
    beside it), reach (where descendants of --niche go), classes (communicating ones, of observed
    transitions). Graphs: reachability (which niches lead to which; a long jump is over a quarter of the
    grid's diagonal), wormholes. Curves against l and U: growth. Matrices: transitions,
    transitions-by-class."""
    out: Annotated[Path | None, parsing.option("FILE", "KIND.png")] = None
    """Picture to write: .png, .svg or .pdf."""
    l: int = 5
    """Generations, for evolvability and reach."""
    lineages: int = 100
    """Lineages, for evolvability and reach."""
    niche: Annotated[str | None, parsing.option("I,J", "for growth the best, the middle and the last")] = None
    """Niche whose descendants reach shows, or growth counts."""
    threshold: Annotated[float | None, parsing.option("FLOAT", "0.05, for classes 0")] = None
    """Probability that a transition needs for an arrow, for reachability, or must exceed to count, for
    classes and transitions-by-class."""
    estimator: parsing.EstimatorName = "empirical-bayes"
    """How T is estimated; classes are always those of mle, as a posterior has no zeros."""
    min_births: int = 20
    """Niches with fewer births behind their row of T are hatched, for evolvability."""
    steps: parsing.Steps = None
    dpi: int = 200
    """Resolution of a .png."""


def run(arguments: Sequence[str]) -> int:
    """Draw."""
    command = parsing.parse(PlotCommand, arguments)
    out = command.out or Path(f"{command.kind}.png")
    output.check_out(out)
    if not 10 <= command.dpi <= 2000:
        raise NichechainError(f"--dpi is {command.dpi}, but must be between 10 and 2000")
    check_at_least(0, **{"--min-births": command.min_births})
    if command.threshold is not None and command.kind not in _WITH_THRESHOLD:
        raise NichechainError(f"--threshold belongs to {', '.join(_WITH_THRESHOLD)}, not to {command.kind}")
    from nichechain.archive.archive import load

    if command.kind == "reach" and command.niche is None:
        raise NichechainError("--niche is missing, but reach is drawn from a niche, such as --niche 7,11")
    if command.niche is not None and command.kind not in ("reach", "growth"):
        raise NichechainError(f"--niche belongs to reach and growth, not to {command.kind}")
    archive = parsing.seen(load(command.path), command.steps)
    axes = len(archive.niches.bounds)
    if command.kind in _MAPS and axes > 2:
        # Before anything is computed for a map that cannot be drawn.
        raise NichechainError(
            f"behavior has {axes} axes, but {command.kind} is drawn over 1 or 2: "
            "growth, transitions and transitions-by-class are drawn of any number"
        )
    pair = command.kind in _PAIRS
    figure = output.new_figure(*(_PAIRS[command.kind] if pair else (7.0, 7.4)))
    if pair:
        left, right = figure.subplots(
            1, 2, gridspec_kw={"wspace": 0.55 if command.kind == "uncertainty" else 0.2}
        )
        _draw_pair(command, archive, left, right)
    else:
        _draw(command, archive, figure.add_subplot())
    output.save_figure(figure, out, command.dpi)
    output.console().print(f"wrote {out}")
    return 0


def _draw_pair(command: PlotCommand, archive: Archive, left: Axes, right: Axes) -> None:
    if command.kind == "growth":
        from nichechain.plots.growth import check_growth

        check_growth(archive.niches.states)
    chain = progress.estimated(archive, command.estimator)
    if command.kind == "uncertainty":
        from nichechain.plots import plot_evolvability
        from nichechain.plots.maps import plot_uncertainty

        scores = _scores(command, chain)
        plot_evolvability(archive, scores, left, min_births=command.min_births)
        plot_uncertainty(archive, scores, right)
        return
    from nichechain.niches import parse_niche
    from nichechain.plots.growth import plot_generations, plot_lineages

    if command.niche is not None:
        niches = [chain.state(parse_niche(command.niche, "--niche"))]
    else:
        # A few draws tell the best from the last.
        scores = _scores(command, chain, draws=_FEW_DRAWS)
        ranking = scores.ranking(chain, min_births=command.min_births)["niche"]
        if ranking.empty:
            raise NichechainError(f"no niche has {command.min_births} births: choose one with --niche")
        places = sorted({0, len(ranking) // 2, len(ranking) - 1})
        niches = [int(ranking.iloc[place]) for place in places]
    plot_generations(chain, left, niches=niches, lineages=command.lineages)
    plot_lineages(chain, right, niches=niches, l=command.l)
    left.figure.suptitle(chain.estimator, fontsize="small", color="#555555")


def _scores(command: PlotCommand, chain: NicheChain, draws: int | None = None) -> NicheEvolvability:
    """l-evolvability of every niche, with a bar of the draws that it takes."""
    from nichechain.evolvability.niches import answer_for_niches
    from nichechain.evolvability.question import DRAWS, Question

    question = Question(command.l, command.lineages, draws=draws or DRAWS)
    with progress.adding(1 if chain.posterior is None else question.draws, "draws of T") as tell:
        return answer_for_niches(chain, question, on_done=tell)


def _draw(command: PlotCommand, archive: Archive, ax: Axes) -> None:
    from nichechain import plots

    match command.kind:
        case "elites":
            plots.plot_elites(archive, ax)
        case "visits":
            plots.plot_visits(archive, ax)
        case "evolvability":
            scores = _scores(command, progress.estimated(archive, command.estimator))
            plots.plot_evolvability(archive, scores, ax, min_births=command.min_births)
        case "transitions":
            chain = progress.estimated(archive, command.estimator)
            with progress.spinner("drawing"):
                plots.plot_transitions(archive, chain, ax)
        case "reachability":
            threshold = 0.05 if command.threshold is None else command.threshold
            chain = progress.estimated(archive, command.estimator)
            with progress.spinner("drawing"):
                plots.plot_reachability(archive, chain, ax, threshold=threshold)
        case "reach":
            from nichechain.evolvability.question import DRAWS
            from nichechain.evolvability.reach import reach
            from nichechain.niches import parse_niche
            from nichechain.plots.maps import plot_reach

            assert command.niche is not None
            chain = progress.estimated(archive, command.estimator)
            niche = chain.state(parse_niche(command.niche, "--niche"))
            with progress.adding(1 if chain.posterior is None else DRAWS, "draws of T") as tell:
                found = reach(chain, niche=niche, l=command.l, lineages=command.lineages, on_done=tell)
            plot_reach(archive, found, ax, niche=niche)
        case "wormholes":
            from nichechain.chain.structure.wormholes import wormholes
            from nichechain.plots.graphs import plot_wormholes

            # Broken children all land at the start, which is no secret passage.
            chain = progress.estimated(archive, command.estimator)
            with progress.spinner("drawing"):
                plot_wormholes(archive, wormholes(chain, beyond="both"), ax)
        case "classes":
            from nichechain.plots.classes import plot_classes

            with progress.spinner("drawing"):
                plot_classes(archive, archive.chain("mle"), ax, threshold=command.threshold or 0.0)
        case "transitions-by-class":
            from nichechain.plots.classes import plot_transitions_by_class

            with progress.spinner("drawing"):
                plot_transitions_by_class(
                    archive, archive.chain("mle"), ax, threshold=command.threshold or 0.0
                )
