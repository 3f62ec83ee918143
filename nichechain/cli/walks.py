"""``nichechain walks``: what evolutionary pressure and the diversity metric do to evolvability."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import tyro

from nichechain.cli import output, parsing, progress, workers
from nichechain.cli.begun import ReportCommand, ResumeCommand, stopped
from nichechain.core.checks import check_at_least, shown
from nichechain.core.errors import NichechainError
from nichechain.core.text import rounded
from nichechain.studies.settings import MetricName, WalkSettings

if TYPE_CHECKING:
    from rich.table import Table

    from nichechain.core.checks import DomainOption
    from nichechain.domains import Domain
    from nichechain.studies.analysis import Analysis
    from nichechain.studies.conditions import Condition
    from nichechain.studies.study import Kind, Study

_HELP = """usage: nichechain walks STUDY ...

Walks on a behavior landscape, many of each kind, measured at every step and compared.

studies:
  pressure DOMAIN     does stronger selection for diversity raise evolvability?
  metrics DOMAIN      does it matter which diversity metric is selected for?
  sensitivity DOMAIN  does it matter how a parameter is set that the paper leaves open?
  population DOMAIN   does the metric matter for the population of a multi-state walk?

and of a study that was begun:
  resume PATH         go on with it, perhaps to more runs
  report PATH         its tables, tests, figure and report, as far as it is

nichechain walks STUDY --help tells a study's options.

try:
  nichechain walks pressure arm --runs 20 --out pressure"""


@dataclass(frozen=True)
class _Walks(WalkSettings):
    """What the studies share."""

    GROUPS: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "mutation": ("mutation", "scale", "step_bound", "initialisation"),
        "metric": ("k", "bandwidth", "mode", "decay", "archive_limit", "archive_scope", "litter"),
        "walk": ("offspring", "states", "other_niche"),
        "coverage": ("grid", "bounds"),
        "domain": ("domain_seed", "options"),
        "running": ("workers", "cache_memory"),
    }

    domain: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="DOMAIN")]
    """What to walk on: fetch (Fetch Pick and Place), arm (a planar arm, in seconds), ..."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder of the study: walks, tables, figure and report."""
    runs: int = 50
    """Walks of each kind."""
    grid: Annotated[str, tyro.conf.arg(metavar="NXxNY")] = "20x20"
    """Cells of the grid that coverage is measured on."""
    bounds: Annotated[str | None, parsing.option("X0,X1,Y0,Y1", "the domain's")] = None
    """Its bounds, in units of behavior."""
    paired: bool = False
    """Run r of every kind starts from the same genotype; the test is then Friedman's."""
    seed: int = 0
    """Seed of the study."""
    domain_seed: int = 0
    """Seed of what the domain holds fixed (fetch: where block and target begin)."""
    options: Annotated[tuple[str, ...], parsing.option("NAME=VALUE ...", "none")] = ()
    """Options of the domain, such as joints=20 of the arm, or descriptor=final-xy of a gym:ENV_ID."""
    workers: parsing.Workers = None
    cache_memory: parsing.CacheMemory = None
    _: KW_ONLY
    step_bound: Annotated[str | None, parsing.option("KIND:SIZE", "unbounded")] = None
    states: Annotated[int | None, parsing.option("INT", "one")] = None
    """States of a multi-state walk at a time, which measures are averaged over."""

    def base(self) -> Condition:
        """What all conditions share."""
        from nichechain.studies.conditions import Condition

        names = [name for name in Condition.names()[1:] if hasattr(self, name)]
        return Condition(label="base", **{name: getattr(self, name) for name in names})


@dataclass(frozen=True)
class PressureCommand(_Walks):
    """Walks under rising evolutionary pressure, from random to highly selective."""

    EXAMPLES: ClassVar[tuple[str, ...]] = ("nichechain walks pressure arm --runs 20 --out pressure",)

    levels: str = "selective,0.1,0.25,0.5,0.75,random"
    """Levels of pressure: selective, random, and the best share of the offspring that may follow."""
    steps: int = 50
    """Steps T of a walk, of T + 1 states."""
    metric: MetricName = "knn"
    """Diversity that is selected for."""

    def conditions(self) -> tuple[Condition, ...]:
        """One for each level."""
        from nichechain.studies.study import pressure_conditions

        return pressure_conditions(parsing.words(self.levels), self.base())


@dataclass(frozen=True)
class MetricsCommand(_Walks):
    """Highly selective walks, each kind selecting for another diversity metric."""

    EXAMPLES: ClassVar[tuple[str, ...]] = (
        "nichechain walks metrics arm --runs 20 --metrics kde,knn --out metrics",
    )

    metrics: str = "kde,knn,knn-no-archive,ancestors,parent"
    """Diversity metrics."""
    steps: int = 100
    """Steps T of a walk, of T + 1 states."""
    level: str = "selective"
    """Pressure: selective, random, or the best share of the offspring that may follow."""

    def conditions(self) -> tuple[Condition, ...]:
        """One for each metric."""
        from nichechain.studies.study import metric_conditions

        return metric_conditions(parsing.words(self.metrics), self.base())


@dataclass(frozen=True)
class SensitivityCommand(_Walks):
    """Highly selective walks, each kind with another value of one parameter."""

    EXAMPLES: ClassVar[tuple[str, ...]] = (
        "nichechain walks sensitivity arm --vary k --runs 10 --out sensitivity",
    )

    vary: Literal["scale", "bandwidth-mode", "decay", "k", "offspring", "initialisation"] = "scale"
    """The parameter that is varied."""
    steps: int = 50
    """Steps T of a walk; 0 measures where walks begin, which is all that initialisation needs."""
    level: str = "selective"
    """Pressure: selective, random, or the best share of the offspring that may follow."""
    metric: MetricName = "knn"
    """Diversity that is selected for; bandwidth-mode and decay are parameters of kde, and use it."""

    def conditions(self) -> tuple[Condition, ...]:
        """One for each value."""
        from nichechain.studies.study import variations

        return variations(self.vary, self.base())


@dataclass(frozen=True)
class PopulationCommand(_Walks):
    """Multi-state walks, each kind selecting its population for another diversity metric."""

    EXAMPLES: ClassVar[tuple[str, ...]] = (
        "nichechain walks population arm --runs 20 --scale 0.1 --out population",
    )

    metrics: str = "kde,knn"
    """Diversity metrics."""
    steps: int = 50
    """Steps T of a walk, of T + 1 populations."""
    level: str = "selective"
    """Pressure: selective, random, or the best share of states and offspring that may follow."""
    _: KW_ONLY
    states: int = 10
    """States of a walk at a time, at least 2."""

    def conditions(self) -> tuple[Condition, ...]:
        """One for each metric."""
        from nichechain.studies.study import metric_conditions

        return metric_conditions(parsing.words(self.metrics), self.base())


_Study = PressureCommand | MetricsCommand | SensitivityCommand | PopulationCommand


def run(arguments: Sequence[str]) -> int:
    """Walk a study, then report on it."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_HELP)
        return 0
    verb, rest = arguments[0], arguments[1:]
    if verb == "report":
        return _report(parsing.parse(ReportCommand, rest, name="walks report").path)
    if verb == "resume":
        return _resume(parsing.parse(ResumeCommand, rest, name="walks resume"))
    if verb == "pressure":
        return _begin(parsing.parse(PressureCommand, rest, name="walks pressure"), "pressure")
    if verb == "metrics":
        return _begin(parsing.parse(MetricsCommand, rest, name="walks metrics"), "metrics")
    if verb == "sensitivity":
        return _begin(parsing.parse(SensitivityCommand, rest, name="walks sensitivity"), "sensitivity")
    if verb == "population":
        return _begin(parsing.parse(PopulationCommand, rest, name="walks population"), "population")
    raise NichechainError(
        f"there is no study {verb!r}: it must be one of pressure, metrics, sensitivity, population, resume "
        "or report"
    )


def _begin(command: _Study, kind: Kind) -> int:
    from nichechain import domains

    check_at_least(0, **{"--domain-seed": command.domain_seed})
    options = parsing.domain_options(command.options)
    domain = domains.make(command.domain, seed=command.domain_seed, **options)
    return _walk(_study(command, kind, domain, options), domain, command.out, command)


def _resume(command: ResumeCommand) -> int:
    from nichechain.archive.trust import check_trusted
    from nichechain.search.config import BuildConfig
    from nichechain.studies.folder import read_study

    study = read_study(command.path)
    same = BuildConfig(study.domain, study.shape, study.bounds, domain_options=study.domain_options)
    check_trusted(same, command.path)
    if command.runs is not None:
        study = replace(study, runs=command.runs)
    return _walk(study, study.make_domain(), command.path, command)


def _walk(study: Study, domain: Domain, folder: Path, command: _Walks | ResumeCommand) -> int:
    from nichechain.studies.running import run as walk_study

    with workers.hired(command.workers, command.cache_memory) as executor:
        with progress.spinner("loading the domain"):
            domain.evaluate(domain.sample(1, seed=0))
        try:
            with progress.counting(study.evaluations, "evaluations") as tell:
                walk_study(study, folder, executor, domain=domain, on_progress=tell)
        except KeyboardInterrupt:
            return stopped("walks", folder)
    return _report(folder)


def _report(folder: Path) -> int:
    """Write the report of what is walked so far, and tell what it found."""
    from nichechain.studies.findings import find
    from nichechain.studies.folder import read_records, read_study, read_unit
    from nichechain.studies.report import FILES, write_report

    study, unit = read_study(folder), read_unit(folder)
    records = read_records(folder, study)
    with progress.spinner("testing and drawing"):
        analysis = write_report(folder, study, records, command=command_of(study, folder), unit=unit)
    found = output.table("claim", "paper", "here", "verdict")
    for column in found.columns[1:]:
        column.justify = "left"
    for finding in find(analysis):
        found.add_row(finding.claim, finding.paper, finding.ours, finding.verdict)
    shown = output.console()
    shown.print(found if found.row_count else _means(analysis, unit))
    finished = [analysis.finished.get(condition.label, 0) for condition in study.conditions]
    least, most = min(finished), max(finished)
    runs = f"{least}" if least == most else f"{least} to {most}"
    shown.print(f"{runs} of {study.runs} runs of each kind, {analysis.evaluations} evaluations. Written:")
    for name in FILES:
        shown.print(f"  {folder / name}")
    return 0


def _means(analysis: Analysis, unit: str) -> Table:
    """What a study ends with on which the paper has no numbers."""
    from nichechain.studies.analysis import POPULATION

    said = "ρ*" if analysis.main == POPULATION else "η*"
    made = output.table("condition", "runs", f"mean {said} at step {analysis.last} ({unit})", "95 % interval")
    for summary in analysis.summaries:
        if summary.measure == analysis.main and summary.step == analysis.last:
            interval = f"{rounded(summary.low)} to {rounded(summary.high)}"
            made.add_row(summary.condition, str(summary.n), rounded(summary.mean), interval)
    for asked in analysis.asked:
        if asked.test and asked.measure == analysis.main and asked.step == analysis.last:
            test = asked.test
            made.caption = f"{test.name}: {test.symbol} = {rounded(test.statistic)}, p = {test.p:.2g}"
    return made


def command_of(study: Study, folder: Path) -> str:
    """The command line that asks for a study."""
    from nichechain.studies.conditions import Condition
    from nichechain.studies.study import LEVELS, METRICS, POPULATION_METRICS, POPULATION_SIZE, VARIATIONS

    base = study.conditions[0]
    labels = [condition.label for condition in study.conditions]
    options = {"runs": str(study.runs), "steps": str(study.steps)}
    varied = "level" if study.kind == "pressure" else "metric"
    if study.kind == "pressure" and labels != list(LEVELS):
        options["levels"] = ",".join(labels)
    if study.kind == "metrics" and labels != list(METRICS):
        options["metrics"] = ",".join(labels)
    if study.kind == "sensitivity":
        varied = base.label.partition(" ")[0]
        options["vary"] = next(name for name, change in VARIATIONS.items() if varied in change)
    flags = ["paired"] if study.paired else []
    if study.kind == "population" and labels != list(POPULATION_METRICS):
        options["metrics"] = ",".join(labels)
    usual = Condition(label="usual", states=POPULATION_SIZE if study.kind == "population" else None)
    for name in Condition.names()[1:]:
        value = getattr(base, name)
        if name != varied and value != getattr(usual, name):
            if value is True:
                flags.append(name)
            else:
                options[name] = str(value)
    if study.shape != (20,) * len(study.shape):
        options["grid"] = "x".join(map(str, study.shape))
    options["bounds"] = ",".join(repr(bound) for pair in study.bounds for bound in pair)
    for name in ("seed", "domain_seed"):
        if getattr(study, name):
            options[name] = str(getattr(study, name))
    words = [f"--{name.replace('_', '-')} {shlex.quote(value)}" for name, value in options.items()]
    words += [f"--{name.replace('_', '-')}" for name in flags]
    if study.domain_options:
        words += ["--options", *map(shlex.quote, parsing.domain_option_texts(study.domain_options))]
    return " ".join(["nichechain walks", study.kind, study.domain, *words, "--out", shlex.quote(str(folder))])


def _study(
    command: _Study,
    kind: Kind,
    domain: Domain,
    options: Mapping[str, DomainOption],
) -> Study:
    """What is asked for, checked."""
    from nichechain.niches import parse_bounds, parse_shape
    from nichechain.studies.study import Study

    shape = parse_shape(command.grid, "--grid")
    axes = len(domain.behavior_names)
    if len(shape) != axes:
        raise NichechainError(
            f"--grid is {shown(command.grid)}, but {command.domain} has {axes} axes of behavior"
        )
    return Study(
        kind=kind,
        domain=command.domain,
        conditions=command.conditions(),
        runs=command.runs,
        steps=command.steps,
        shape=shape,
        bounds=domain.bounds if command.bounds is None else parse_bounds(command.bounds, "--bounds"),
        domain_seed=command.domain_seed,
        seed=command.seed,
        paired=command.paired,
        domain_options=options,
    )
