"""``nichechain estimate``: what births say of T, how well, and whether they are enough."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from nichechain.cli import output, parsing, progress
from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError
from nichechain.core.text import rounded

if TYPE_CHECKING:
    import pandas as pd

    from nichechain.archive.archive import Archive
    from nichechain.validation.drift import LevelCourse
    from nichechain.validation.held_out import Comparison
    from nichechain.validation.stability import RankStability


@dataclass(frozen=True)
class EstimateCommand:
    """The estimate of T from births; which estimator foretells births best; whether they are enough."""

    path: parsing.ArchivePath
    compare: bool = False
    """Hold out the children of some elites and see which estimator foretells them best."""
    stability: bool = False
    """Thin the births and see whether fewer would have ranked the niches alike, and how the level drifts."""
    estimator: parsing.EstimatorName = "empirical-bayes"
    """T from births: posteriors around a pooled or a uniform base, or row-normalised counts."""
    folds: Annotated[int | None, parsing.option("INT", "5")] = None
    """For --compare: parts of the elites, each held out in its turn."""
    thin: Annotated[Literal["elite", "birth"] | None, parsing.option("{elite,birth}", "elite")] = None
    """For --stability: leave out whole elites with their children, or single births."""
    repeats: Annotated[int | None, parsing.option("INT", "3")] = None
    """For --stability: how often to thin to each part."""
    min_births: int = 20
    """For --stability: niches with fewer births behind their row of T are not ranked."""
    out: Annotated[Path | None, parsing.option("FILE", "none")] = None
    """For --stability: a picture of it, .png, .svg or .pdf."""
    steps: parsing.Steps = None
    seed: int = 0
    """Of folds, thinning and draws."""
    format: Literal["table", "csv", "json"] = "table"
    """How to write it."""


def run(arguments: Sequence[str]) -> int:
    """Say what the births say of T."""
    command = parsing.parse(EstimateCommand, arguments)
    _check(command)
    from nichechain.archive.archive import load

    archive = parsing.seen(load(command.path), command.steps)
    if command.compare:
        _compare(command, archive)
    elif command.stability:
        _stability(command, archive)
    else:
        _estimate(command, archive)
    return 0


def _check(command: EstimateCommand) -> None:
    if command.compare and command.stability:
        raise NichechainError("--compare and --stability exclude each other: ask for one of them")
    belongs: dict[str, tuple[bool, dict[str, object]]] = {
        "--compare": (command.compare, {"--folds": command.folds}),
        "--stability": (
            command.stability,
            {"--thin": command.thin, "--repeats": command.repeats, "--out": command.out},
        ),
    }
    for owner, (asked, options) in belongs.items():
        for name, value in options.items():
            if value is not None and not asked:
                raise NichechainError(f"{name} belongs to {owner}, which is not given")
    check_at_least(0, **{"--seed": command.seed, "--min-births": command.min_births})
    if command.out is not None:
        output.check_out(command.out)


def _estimate(command: EstimateCommand, archive: Archive) -> None:
    chain = progress.estimated(archive, command.estimator)
    counts, posterior = archive.counts, chain.posterior
    births = int(counts.births.sum())
    content: dict[str, Any] = {
        "estimator": chain.estimator,
        "births_of_parents": births,
        "births_outside": counts.births_outside,
        "niches": len(archive.niches),
        "rows_observed": counts.rows_observed,
        "never_filled": counts.never_filled,
        "filled_never_parent": counts.never_parent,
    }
    if posterior is not None:
        destination, displacement, uniform = posterior.base.weights.tolist()
        neighbours = float(1.0 - posterior.base.shared.mean())
        effect = float((counts.births * posterior.design_effect).sum() / max(1, births))
        content |= {
            "strength": posterior.strength,
            "weight_destination": destination,
            "weight_displacement": displacement,
            "weight_uniform": uniform,
            "share_neighbours": neighbours,
            "births_worth_one": effect,
        }
    if command.format == "table":
        rows = {
            "estimator": chain.estimator,
            "births with a parent": str(births),
            "  outside the grid": f"{counts.births_outside}, initial ones among them",
            "rows of T observed": f"{counts.rows_observed} of {len(archive.niches)}",
            "  never filled": str(counts.never_filled),
            "  filled, never a parent": str(counts.never_parent),
        }
        if posterior is not None:
            rows |= {
                "strength of the base": f"{rounded(posterior.strength)} births",
                "  what neighbours say": f"{neighbours:.1%}",
                "  where children land": f"{(1.0 - neighbours) * destination:.1%}",
                "  how far they land": f"{(1.0 - neighbours) * displacement:.1%}",
                "  anywhere": f"{(1.0 - neighbours) * uniform:.1%}",
                "births worth one": f"{effect:.3g}: children of one elite take after each other"
                if effect > 1
                else "1: every birth counts in full",
            }
        output.console().print(output.facts(rows))
        return
    import pandas as pd

    _write(pd.DataFrame([content]), content, command)


def _compare(command: EstimateCommand, archive: Archive) -> None:
    from nichechain.validation.held_out import compare_estimators

    folds = 5 if command.folds is None else command.folds
    with progress.adding(folds, "folds of elites") as tell:
        found = compare_estimators(archive.counts, folds=folds, seed=command.seed, on_done=tell)
    frame = found.to_frame()
    if command.format != "table":
        about = {"folds": found.folds, "elites": found.elites, "seed": found.seed}
        _write(frame, {**about, "estimators": output.records(frame)}, command)
        return
    _show_comparison(found)


def _show_comparison(found: Comparison) -> None:
    shown = output.console()
    shown.print(
        f"[bold]Births foretold[/]: the children of {found.elites} elites, "
        f"a {found.folds}th of the elites held out at a time"
    )
    best = found.rows[0].estimator
    table = output.table("estimator", "impossible", "nats per birth", "against the first")
    for row in found.rows:
        gain = "" if row.estimator == best else f"{row.difference:+.3f} ± {row.standard_error:.3f}"
        table.add_row(row.estimator, f"{row.impossible:.1%}", f"{row.log_likelihood:.3f}", gain)
    shown.print(table)
    shown.print(
        "impossible: births that were given probability 0 and happened. nats per birth: mean\n"
        "log-probability of the others. against the first: the difference on just these,\n"
        "± its standard error by elite."
    )


def _stability(command: EstimateCommand, archive: Archive) -> None:
    from nichechain.validation.stability import FRACTIONS, rank_stability

    repeats = 3 if command.repeats is None else command.repeats
    with progress.adding(1 + max(0, repeats) * (2 + len(FRACTIONS)), "rankings") as tell:
        found = rank_stability(
            archive.counts,
            thin=command.thin or "elite",
            repeats=repeats,
            min_births=command.min_births,
            estimator=command.estimator,
            seed=command.seed,
            on_done=tell,
        )
    with progress.spinner("the level over steps and births"):
        course = _course(command, archive)
    if command.out is not None:
        _draw(found, course, command.out)
    if command.format != "table":
        frame = found.to_frame()
        about = {
            "answer": found.answer,
            "niches": found.niches,
            "thin": found.thin,
            "halves": found.halves.tolist(),
            "enough": found.enough,
            "all_level": found.all_level,
            "steps": [] if course is None else output.records(course.to_frame()),
        }
        _write(frame, {**about, "parts": output.records(frame)}, command)
        return
    shown = output.console()
    shown.print(
        f"[bold]Ranking of {found.niches} niches[/] by {found.l}-evolvability, thinned births against all: "
        "Spearman's correlation"
    )
    shown.print(f"[dim]level: the mean {found.l}-evolvability of these niches, by the births of each line[/]")
    table = output.table("part", "births", "mean", "lowest", "highest", "level")
    for row in found.to_frame().itertuples():
        values = (f"{value:.2f}" for value in (row.spearman, row.lowest, row.highest))
        table.add_row(f"{row.fraction:.0%}", f"{row.births:.0f}", *values, f"{row.level:.1f}")
    table.add_row("100%", str(found.all_births), "", "", "", f"{found.all_level:.1f}")
    shown.print(table)
    if course is not None:
        _show_course(course)
    shown.print(found.answer)
    if command.out is not None:
        shown.print(f"wrote {command.out}")


def _course(command: EstimateCommand, archive: Archive) -> LevelCourse | None:
    """Level against steps and births; None where births say no step or are too few, or niches too many."""
    from nichechain.chain.filters import COUNTED
    from nichechain.evolvability.question import MOST_EXACT
    from nichechain.validation.drift import level_course

    if command.steps is not None or archive.niches.states > MOST_EXACT:
        return None
    births = archive.table(list(COUNTED))
    like = archive.chain().posterior
    try:
        return level_course(births, archive.niches, seed=command.seed, like=like)
    except NichechainError:
        return None


def _show_course(course: LevelCourse) -> None:
    shown = output.console()
    shown.print(
        f"[bold]Level[/]: mean {course.l}-evolvability over {course.niches} niches that all parts of the "
        "search observed, with 90 % intervals"
    )
    table = output.table("steps", "births", "level by these", "births so far", "level by all so far")
    for row in course.to_frame().itertuples():
        table.add_row(
            f"{row.first_step} to {row.last_step}",
            str(row.births),
            f"{row.level:.1f} ± {row.level - row.low:.1f}",
            str(row.grown),
            f"{row.grown_level:.1f} ± {row.grown_level - row.grown_low:.1f}",
        )
    shown.print(table)


def _draw(found: RankStability, course: LevelCourse | None, out: Path) -> None:
    from nichechain.plots.validation import plot_level, plot_stability

    panels = 1 if course is None else 2
    figure = output.new_figure(6.4 * panels, 4.8)
    axes = figure.subplots(1, panels, squeeze=False)[0]
    plot_stability(found, axes[0])
    if course is not None:
        plot_level(course, axes[1])
    output.save_figure(figure, out, dpi=200)


def _write(frame: pd.DataFrame, content: dict[str, Any], command: EstimateCommand) -> None:
    print(
        frame.to_csv(index=False) if command.format == "csv" else json.dumps(content, indent=2) + "\n", end=""
    )
