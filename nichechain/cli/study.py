"""``nichechain study``: searches compared, at equal evaluations and paired by seed."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from nichechain.cli import output, parsing, progress, workers
from nichechain.cli.begun import ReportCommand, ResumeCommand, stopped
from nichechain.cli.build import BuildCommand
from nichechain.core.errors import NichechainError
from nichechain.search.config import ObjectiveName, SearchConfig

if TYPE_CHECKING:
    from nichechain.studies.searches.study import SelectionStudy

_HELP = """usage: nichechain study STUDY ...

Searches, many of each kind, compared at equal evaluations.

studies:
  selection DOMAIN    what is a selection of parents worth?

and of a study that was begun:
  resume PATH         go on with it, perhaps to more runs
  report PATH         its tables, figure and report, as far as it is

Several processes may work on one folder: each takes the next search that nobody else is making.

nichechain study STUDY --help tells a study's options.

try:
  nichechain study selection arm --evaluations 2000 --runs 4 --out selection"""


@dataclass(frozen=True)
class SelectionCommand(BuildCommand):
    """Searches by several selections of parents, at equal evaluations."""

    out: Annotated[Path | None, parsing.option("DIR", "selection-DOMAIN")] = None
    """Folder of the study: searches, tables, figure and report."""
    _: KW_ONLY
    selections: tuple[str, ...] = ("uniform", "curiosity", "reach")
    """Selections of parents, as of ``nichechain build --selection``; uniform is what the others are
    compared with."""
    runs: int = 10
    """Searches with each; run r of each has the seed --seed + r."""
    elites: int = 20
    """How many elites of the end of each search are checked; 0 for none."""
    offspring: int = 20
    """Fresh offspring of each elite that is checked."""
    selection: tyro.conf.Suppress[str] = "uniform"
    objective: tyro.conf.Suppress[ObjectiveName] = "domain"
    objective_l: tyro.conf.Suppress[int] = 1
    objective_lineages: tyro.conf.Suppress[int | None] = None
    resume: tyro.conf.Suppress[bool] = False
    force: tyro.conf.Suppress[bool] = False
    seeds: tyro.conf.Suppress[str | None] = None
    max_failed: tyro.conf.Suppress[float] = 0.5

    @property
    def folder(self) -> Path:
        """Where the study goes."""
        return self.out or Path(f"selection-{self.domain.replace(':', '-').replace('/', '-')}")

    def settings(self) -> dict[str, Any]:
        """Those of the searches, of which none judges genotypes by offspring."""
        return {**super().settings(), "offspring": SearchConfig.offspring}

    def study(self) -> SelectionStudy:
        """What is asked for, checked."""
        from nichechain.studies.searches.study import SelectionStudy

        return SelectionStudy(self.config(), self.selections, self.runs, self.elites, self.offspring)


def run(arguments: Sequence[str]) -> int:
    """Make the searches of a study, then report on them."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(_HELP)
        return 0
    verb, rest = arguments[0], arguments[1:]
    if verb == "report":
        return _report(parsing.parse(ReportCommand, rest, name="study report").path)
    if verb == "resume":
        resume = parsing.parse(ResumeCommand, rest, name="study resume")
        return _search(_stored(resume), resume.path, resume)
    if verb == "selection":
        command = parsing.parse(SelectionCommand, rest, name="study selection")
        return _search(command.study(), command.folder, command)
    raise NichechainError(f"there is no study {verb!r}: it must be one of selection, resume or report")


def _stored(command: ResumeCommand) -> SelectionStudy:
    from nichechain.archive.trust import check_trusted
    from nichechain.studies.searches.folder import read_study

    study = read_study(command.path)
    check_trusted(study.config, command.path)
    return study if command.runs is None else replace(study, runs=command.runs)


def _search(study: SelectionStudy, folder: Path, command: SelectionCommand | ResumeCommand) -> int:
    from nichechain import execution
    from nichechain.search.making import make_domain
    from nichechain.studies.searches.running import run_searches

    with workers.hired(command.workers, command.cache_memory) as executor:
        with progress.spinner("loading the domain"):
            import ribs.archives  # noqa: F401  # takes seconds, which the bar should not count

            domain = make_domain(study.config)
            execution.evaluate_rows(domain, domain.sample(1, seed=0))
        try:
            with progress.counting(study.evaluations, "evaluations") as tell:
                elsewhere = run_searches(study, folder, executor, domain=domain, on_progress=tell)
        except KeyboardInterrupt:
            return stopped("study", folder)
    if elsewhere:
        output.console().print(f"{elsewhere} searches are being made by other processes.")
        return 0
    return _report(folder)


def _report(folder: Path) -> int:
    """Write the report of what is made so far, and tell what it found."""
    from nichechain.studies.searches.folder import read_searches
    from nichechain.studies.searches.report import FILES, worth_table, write_selection_report

    study, records = read_searches(folder)
    with progress.spinner("comparing and drawing"):
        worths = write_selection_report(folder, study, records, command=command_of(study, folder))
    found = worth_table(worths)
    table = output.table(*found.headings)
    for row in found.rows:
        table.add_row(*row)
    shown = output.console()
    shown.print(table)
    finished = sum(worth.runs for worth in worths)
    shown.print(f"{finished} of {study.runs * len(study.selections)} searches. Written:")
    for name in FILES:
        shown.print(f"  {folder / name}")
    return 0


def command_of(study: SelectionStudy, folder: Path) -> str:
    """The command line that asks for a study."""
    asked = BuildCommand.of(study.config)
    usual = {field.name: field.default for field in fields(SearchConfig) if field.name != "domain"}
    words = ["nichechain study selection", study.config.domain]
    for name, value in (("grid", asked.grid), ("niches", asked.niches), ("bounds", asked.bounds)):
        if value is not None:
            words.append(f"--{name}={value}")
    for name, default in usual.items():
        value = getattr(study.config, name)
        if value == default or name == "selection":
            continue
        option = f"--{name.replace('_', '-')}"
        if name == "step_bound":
            value = f"{value[0]}:{value[1]:g}"
        elif name == "layer_scales":
            value = ",".join(f"{scale:g}" for scale in value)
        words.append(option if value is True else f"{option} {value}")
    words += [f"--{name} {getattr(study, name)}" for name in ("runs", "elites", "offspring")]
    words.append(f"--selections {' '.join(study.selections)}")
    if asked.options:
        words.append(f"--options {' '.join(map(shlex.quote, asked.options))}")
    return " ".join([*words, f"--out {shlex.quote(str(folder))}"])
