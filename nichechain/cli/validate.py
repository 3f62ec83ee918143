"""``nichechain validate``: whether the chain of an archive is one, and whether it predicts."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from nichechain.cli import begun, output, parsing, progress, workers
from nichechain.core.errors import NichechainError
from nichechain.core.files import replace_file
from nichechain.core.text import some

if TYPE_CHECKING:
    from nichechain.validation import Validation, ValidationConfig


@dataclass(frozen=True)
class ValidateCommand:
    """Test whether births are a Markov chain's, and check its predictions on lineages really run."""

    path: parsing.ArchivePath
    elites: int = 24
    """Elites to run lineages from, spread over what the chain predicts."""
    lineages: int = 20
    """Lineages U from each elite."""
    l: int = 5
    """Generations of a lineage."""
    permutations: int = 499
    """Permutations of each test."""
    seed: int = 0
    """Seed of the choice of elites, of their lineages, of permutations and of draws."""
    workers: parsing.Workers = None
    cache_memory: parsing.CacheMemory = None
    out: Annotated[Path | None, parsing.option("DIR", "NAME-validation")] = None
    """Folder for validation.json, calibration.png and lineages.csv."""
    resume: bool = False
    """Go on with lineages that were interrupted."""
    force: bool = False
    """Start over where there are some."""


def run(arguments: Sequence[str]) -> int:
    """Validate."""
    command = parsing.parse(ValidateCommand, arguments)
    from nichechain.archive.archive import load
    from nichechain.validation import ValidationConfig, validate
    from nichechain.validation.direct import DRAWS

    config = ValidationConfig(
        elites=command.elites,
        lineages=command.lineages,
        l=command.l,
        permutations=command.permutations,
        seed=command.seed,
    )
    archive = load(command.path)
    out = command.out or Path(f"{archive.folder.name}-validation")
    if out.exists() and not out.is_dir():
        raise NichechainError(f"--out is {str(out)!r}, but that is a file, not a folder")
    keep = out.with_name(f"{out.name}.partial")
    begun.go_on_or_start_over(keep, "validation", resume=command.resume, force=command.force)
    try:
        with (
            workers.hired(command.workers, command.cache_memory) as executor,
            progress.stages() as tell,
        ):
            result = validate(
                archive,
                executor,
                config,
                keep=keep,
                on_done=progress.more(tell, "evaluations", config.evaluations),
                on_permuted=progress.more(tell, "permutations", config.permuted),
                on_drawn=progress.more(tell, "draws of T", DRAWS),
            )
    except KeyboardInterrupt:
        kept = f"lineages are kept in {keep}. To go on, add --resume."
        output.console().print(f"Stopped; {kept if keep.exists() else 'nothing is evaluated yet.'}")
        return 130
    # Made only now, so that bad input leaves nothing behind.
    out.mkdir(parents=True, exist_ok=True)
    replace_file(out / "validation.json", (json.dumps(result.to_json(), indent=2) + "\n").encode())
    replace_file(out / "lineages.csv", result.direct.lineages.to_frame().to_csv(index=False).encode())
    _draw(result, out / "calibration.png")
    keep.unlink(missing_ok=True)
    _show(result, config)
    output.console().print(f"wrote validation.json, calibration.png and lineages.csv to {out}")
    return 0


def _draw(result: Validation, out: Path) -> None:
    """Calibration after one generation and after all, and the means over generations."""
    from nichechain.plots.validation import plot_calibration, plot_reached

    generations = sorted({1, result.config.l})
    figure = output.new_figure(5.0 * (len(generations) + 1), 5.0, layout="constrained")
    *some, last = figure.subplots(1, len(generations) + 1)
    for generation, ax in zip(generations, some, strict=True):
        plot_calibration(result.direct, ax, generation=generation)
    plot_reached(result.direct, last)
    output.save_figure(figure, out)


def _show(result: Validation, config: ValidationConfig) -> None:
    shown = output.console()
    shown.print(f"[bold]Is it Markov?[/] {result.births} births, {config.permutations} permutations")
    table = output.table("test", "of a chain's", "p", "niches", "births")
    for test in result.tests:
        table.add_row(
            test.name,
            _number(test.ratio, ".3f"),
            f"{test.p_value:.3f}",
            f"{test.niches} of {test.all_niches}",
            f"{test.births} of {test.all_births}",
        )
    shown.print(table)
    shown.print(
        "[dim]of a chain's: the statistic over its mean under permutations; niches and births: those "
        "that\ncould be permuted, the others say nothing[/]"
    )
    direct = result.direct
    shown.print(
        f"\n[bold]Is it right?[/] {some(config.lineages, 'lineage')} of {some(config.l, 'generation')}, "
        f"really run, from each of {len(direct.reached)} elites"
    )
    shown.print(f"[dim]estimator: {direct.estimator}; convention: definition[/]")
    if direct.lineages.failed:
        shown.print(f"{direct.lineages.failed} lineages ended with a failed evaluation")
    for start, rows in direct.summary().groupby("start", sort=False):
        table = output.table(
            "l",
            "real",
            "chain",
            "bias",
            "Spearman",
            "if right",
            "slope",
            "in 90 %",
            title=f"From the {start}",
        )
        for row in rows.itertuples():
            table.add_row(
                str(row.generation),
                f"{row.reached:.2f}",
                f"{row.predicted:.2f}",
                f"{row.bias:+.2f}±{row.bias_high - row.bias:.2f}",
                _number(row.spearman),
                f"{_number(row.spearman_low)}, {_number(row.spearman_high)}",
                _number(row.slope),
                _number(row.covered, ".0%"),
            )
        shown.print(table)
    shown.print(
        "[dim]real, chain: niches reached, means over the elites; bias: with its 95 % interval; if right:\n"
        "the Spearman that so few lineages would give a chain that is right; slope: of the real on\n"
        "the chain's, above 1 where elites differ more than it says; in 90 %: elites within the\n"
        "chain's 90 % interval[/]"
    )


def _number(value: float, form: str = ".2f") -> str:
    """A number, or a dash where there is none, as between values that are all alike."""
    return "-" if value != value else format(value, form)
