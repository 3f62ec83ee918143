"""``nichechain landscape``: sensitivity, evolvability and dissimila of the elites of an archive."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from nichechain.cli import begun, output, parsing, progress, workers
from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError
from nichechain.core.text import rounded
from nichechain.search.config import BuildConfig, MutationName

if TYPE_CHECKING:
    import pandas as pd

    from nichechain.archive.archive import Archive
    from nichechain.landscape import Landscape, Measure

TABLES = (".csv", ".parquet")
_NO_MAPS = "none"
_MOST_AXES = 2


@dataclass(frozen=True)
class LandscapeCommand:
    """Measure the behavior landscape around every elite of an archive, by samples of its offspring."""

    path: parsing.ArchivePath
    offspring: int = 30
    """Sample size: offspring of each elite. Measures of different sizes do not compare."""
    mutation: Annotated[MutationName | None, parsing.option("NAME", "the archive's own")] = None
    """Operator that makes them: cauchy, gaussian, student-t or uniform-ball."""
    scale: Annotated[float | None, parsing.option("FLOAT", "the archive's own")] = None
    """Scale of the mutation."""
    step_bound: Annotated[str | None, parsing.option("KIND:SIZE", "the archive's own")] = None
    """Bound the neighbourhood: per-coordinate:SIZE (truncated), rescaled:SIZE (of a whole step), or none."""
    elites: Annotated[int | None, parsing.option("INT", "all")] = None
    """Measure so many elites, drawn at random; a larger sample holds a smaller one."""
    share: float = 0.1
    """Quantile of r* up to which an elite is a dissimilum."""
    l: int = 5
    """Generations, for the l-evolvability that the measures are compared with."""
    lineages: int = 100
    """Lineages, for l-evolvability."""
    min_births: int = 20
    """Niches with fewer births behind their row of T are not compared."""
    top: int = 10
    """Rows to print; the table has them all."""
    by: str = "expected-evolvability"
    """Measure that they are sorted by."""
    lowest: bool = False
    """Print the lowest instead of the highest."""
    map: Annotated[str | None, parsing.option("NAME,NAME,...", "r, r*, LS, LS*, η and η*")] = None
    """Measures to draw, such as expected-ratio,hull-volume; none draws nothing."""
    seed: int = 0
    """Seed of the offspring, of the sample of elites and of posterior draws."""
    workers: parsing.Workers = None
    cache_memory: parsing.CacheMemory = None
    out: Annotated[Path | None, parsing.option("FILE", "NAME-landscape.csv")] = None
    """Table to write, .csv or .parquet; beside it the summary (.json) and the maps (.png)."""
    resume: bool = False
    """Go on with an interrupted measurement."""
    force: bool = False
    """Start an interrupted measurement over."""
    json: bool = False
    """Print summary and rows as JSON."""


def run(arguments: Sequence[str]) -> int:
    """Measure, write, and say what came of it."""
    command = parsing.parse(LandscapeCommand, arguments)
    from nichechain.archive.archive import load
    from nichechain.evolvability.question import Question
    from nichechain.landscape import find_measure, find_measures, measure_archive
    from nichechain.landscape.measures import check_sample_size
    from nichechain.search.making import make_mutation
    from nichechain.variation import SelfAdaptiveDomain

    check_sample_size(command.offspring, "--offspring")
    Question(command.l, command.lineages)
    check_at_least(0, **{"--top": command.top, "--min-births": command.min_births})
    by = find_measure(command.by)
    if command.map is not None and command.map != _NO_MAPS:
        find_measures(command.map.split(","))
    archive = load(command.path)
    out = command.out or Path(f"{archive.folder.name}-landscape.csv")
    output.check_out(out, TABLES)
    keep = out.with_name(f"{out.name}.partial")
    begun.go_on_or_start_over(keep, "measurement", resume=command.resume, force=command.force)
    # Step sizes that are genes come with the archive's own domain; an operator is of the weights' one.
    domain = archive.domain
    weights = domain.domain if isinstance(domain, SelfAdaptiveDomain) else domain
    _, mutate = make_mutation(_config(command, archive), weights)
    measured = len(archive.elites) if command.elites is None else min(command.elites, len(archive.elites))
    total = measured * (1 + command.offspring)
    shown = output.console()
    with workers.hired(command.workers, command.cache_memory) as executor:
        try:
            with progress.adding(total, "evaluations") as tell:
                found = measure_archive(
                    archive,
                    command.offspring,
                    command.seed,
                    executor,
                    mutate=mutate,
                    elites=command.elites,
                    share=command.share,
                    keep=keep,
                    on_done=tell,
                )
        except KeyboardInterrupt:
            # What is printed for people must not spoil what a program reads.
            if not command.json:
                kept = f"what is measured is kept in {keep}. To go on, add --resume."
                shown.print(f"Stopped; {kept if keep.exists() else 'nothing is measured yet.'}")
            return 130
    frame, summary = _results(command, archive, found)
    written = _write(command, archive, found, frame, summary, out)
    keep.unlink(missing_ok=True)
    rows = _top(command, frame, by)
    if command.json:
        records = output.records(rows, digits=15)
        print(json.dumps({**summary, "elites": records}, indent=2))
        return 0
    _show(command, archive, found, summary, rows, by)
    shown.print(f"wrote {', '.join(written)}")
    return 0


def _config(command: LandscapeCommand, archive: Archive) -> BuildConfig:
    """The archive's configuration, with the mutation that is asked for."""
    from nichechain.variation.additive import parse_step_bound

    config = archive.config
    if command.mutation is not None and command.mutation != config.mutation:
        config = replace(config, mutation=command.mutation, df=None)
    if command.scale is not None:
        if config.self_adaptive:
            raise NichechainError(
                f"--scale is {command.scale:g}, but the step sizes of {archive.folder.name} are genes, "
                "which every elite has its own of"
            )
        config = replace(config, scale=command.scale)
    if command.step_bound == "none":
        config = replace(config, step_bound=None)
    elif command.step_bound is not None:
        config = replace(config, step_bound=parse_step_bound(command.step_bound, "--step-bound"))
    return config


def _results(
    command: LandscapeCommand, archive: Archive, found: Landscape
) -> tuple[pd.DataFrame, dict[str, Any]]:
    """The table, with what births say of each niche beside it, and the summary."""
    import numpy as np

    from nichechain.evolvability.niches import answer_for_niches
    from nichechain.evolvability.question import Question

    chain = progress.estimated(archive)
    question = Question(command.l, command.lineages, seed=command.seed)
    inside = found.state < len(archive.niches)
    asked = np.unique(found.state[inside]) if inside.any() else None
    with progress.adding(question.number_of_samples(chain), "draws of T") as tell:
        scores = answer_for_niches(chain, question, roots=asked, on_done=tell)
    assert scores.births is not None
    compared = np.where(scores.births >= command.min_births, scores.value, np.nan)
    births, value = np.full(len(found), np.nan), np.full(len(found), np.nan)
    births[inside], value[inside] = scores.births[found.state[inside]], compared[found.state[inside]]
    frame = found.frame()
    frame["births_of_niche"] = births
    frame["births_of_niche"] = frame["births_of_niche"].astype("Int64")
    frame["l_evolvability"] = value
    config = _config(command, archive)
    bound = config.step_bound
    summary: dict[str, Any] = {
        "archive": archive.folder.name,
        "mutation": config.mutation,
        "scale": config.scale,
        "step_bound": None if bound is None else f"{bound[0]}:{bound[1]:g}",
        **found.summary(),
        "l_evolvability": {
            "l": scores.l,
            "lineages": scores.lineages,
            "convention": scores.convention,
            "estimator": scores.estimator,
            "min_births": command.min_births,
            "saturated": scores.saturated,
            "spearman": [
                {"measure": c.measure, "rho": _finite(c.rho), "p_value": _finite(c.p_value), "n": c.n}
                for c in found.correlations(compared)
            ],
        },
    }
    return frame, summary


def _write(
    command: LandscapeCommand,
    archive: Archive,
    found: Landscape,
    frame: pd.DataFrame,
    summary: dict[str, Any],
    out: Path,
) -> list[str]:
    """Table, summary and maps; the names of the files."""
    import io

    from nichechain.core.files import replace_file

    if out.suffix.lower() == ".csv":
        table = frame.to_csv(index=False, float_format="%.9g").encode()
    else:
        buffer = io.BytesIO()
        frame.to_parquet(buffer, index=False)
        table = buffer.getvalue()
    about = out.with_suffix(".json")
    files = {out: table, about: (json.dumps(summary, indent=2) + "\n").encode()}
    if command.map != _NO_MAPS and len(found.behavior_names) <= _MOST_AXES:
        from nichechain.plots.landscape import MAPS, plot_landscape

        figure = output.new_figure(6.4, 4.8)
        plot_landscape(archive, found, figure, MAPS if command.map is None else command.map.split(","))
        files[out.with_suffix(".png")] = output.figure_bytes(figure, ".png", dpi=110)
    for path, content in files.items():
        replace_file(path, content)
    return [str(path) for path in files]


def _top(command: LandscapeCommand, frame: pd.DataFrame, by: Measure) -> pd.DataFrame:
    """The rows to print. Those that a measure says nothing about come last, whichever end is asked for."""
    ranked = frame
    if by.name in ("ratio", "expected_ratio"):
        ranked = frame[~frame["neutral"]]
    return ranked.sort_values(by.name, ascending=command.lowest, kind="stable").head(command.top)


def _show(
    command: LandscapeCommand,
    archive: Archive,
    found: Landscape,
    summary: dict[str, Any],
    rows: pd.DataFrame,
    by: Measure,
) -> None:
    from nichechain.landscape import MEASURES

    shown = output.console()
    unit = f" {found.unit}" if found.unit else ""
    of_all = f" of {len(archive.elites)}" if len(found) < len(archive.elites) else ""
    made = f"{summary['mutation']} mutation of "
    made += "self-adaptive scale" if archive.config.self_adaptive else f"scale {summary['scale']:g}"
    if summary["step_bound"]:
        made += f", bounded {summary['step_bound']}"
    shown.print(f"[bold]Behavior landscape[/] of {len(found)}{of_all} elites of {archive.folder.name}")
    shown.print(f"[dim]each by {found.sample_size} offspring; {made}; seed {found.seed}[/]")
    if not found.bounded:
        shown.print("[dim]neighbourhoods are unbounded, so LS, GS and η are lower bounds[/]")
    failed = summary["failed"]
    flagged, quantiles = summary["dissimila"], summary["expected_ratio_quantiles"]
    facts = {
        "global sensitivity GS": f"{_number(summary['global_sensitivity'])}{unit}",
        "expected, GS*": f"{_number(summary['expected_global_sensitivity'])} ± "
        f"{_number(summary['expected_global_sensitivity_error'])}{unit}",
        "r* at quantiles": ", ".join(f"{_number(value)} ({level})" for level, value in quantiles.items()),
        "dissimila": f"{flagged['count']}, r* ≤ {_number(flagged['threshold'])}",
        "neutral elites": str(summary["neutral"]),
        "failed offspring": f"{failed} of {len(found) * found.sample_size}",
    }
    shown.print(output.facts(facts))
    if len(rows):
        names = [name for name in MEASURES if name not in ("ratio", "hull_volume")]
        if by.name not in names:
            names[0] = by.name
        which = "Lowest" if command.lowest else "Highest"
        table = output.table(
            "niche",
            *(MEASURES[name].symbol for name in names),
            f"{command.l}-ev.",
            "",
            title=f"{which} {by.title}, {by.symbol}",
        )
        for row in rows.to_dict("records"):
            flag = "dissimilum" if row["dissimilum"] else "neutral" if row["neutral"] else ""
            table.add_row(
                str(row["index"]),
                *(_number(row[name]) for name in names),
                _number(row["l_evolvability"]),
                flag,
            )
        shown.print(table)
    _show_correlations(summary["l_evolvability"])


def _show_correlations(compared: dict[str, Any]) -> None:
    """Measures beside l-evolvability; in one sentence where there is nothing to compare."""
    from nichechain.landscape import MEASURES

    shown = output.console()
    of, births = f"{compared['l']}-evolvability", compared["min_births"]
    rhos = [entry["rho"] for entry in compared["spearman"]]
    needed = f"three elites that differ, in niches of {births} births or more"
    if all(rho is None for rho in rhos):
        shown.print(f"No rank correlation with {of} of the niche: it needs {needed}.")
        return
    table = output.table("measure", "Spearman", "p", "n", title=f"Rank correlation with {of} of the niche")
    for entry in compared["spearman"]:
        rho = "-" if entry["rho"] is None else f"{entry['rho']:.2f}"
        p_value = "-" if entry["p_value"] is None else f"{entry['p_value']:.2g}"
        measure = MEASURES[entry["measure"]]
        table.add_row(f"{measure.title}, {measure.symbol}", rho, p_value, str(entry["n"]))
    shown.print(table)
    shown.print(
        f"[dim]{compared['lineages']} lineages; convention: {compared['convention']}; estimator: "
        f"{compared['estimator']}; niches of {births} births or more[/]"
    )
    if None in rhos:
        shown.print(f"[dim]-: none, which needs {needed}[/]")
    if compared["saturated"]:
        shown.print(
            "Nearly all niches that can be reached are: fewer --lineages would tell niches apart better."
        )


def _number(value: float | None) -> str:
    return "-" if value is None or value != value else rounded(value)


def _finite(value: float) -> float | None:
    return value if value == value else None
