"""``nichechain build``: fill an archive."""

from __future__ import annotations

import re
import shlex
import sys
import warnings
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from nichechain.cli import output, parsing, progress
from nichechain.core.checks import DomainOption, StepBound
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.search.config import MOST_FAILED, BuildConfig, SearchConfig, parse_selection

if TYPE_CHECKING:
    from nichechain.domains.base import Domain

_GRID = "20x20"
# Beyond so many niches, only those of the most births are scored; beyond few, with few draws.
_MANY_NICHES = 1000
_SCORED = 200
_FEW_NICHES, _FEW_DRAWS = 500, 20
# Where a first look would take about so many seconds, another command is named instead. What a pair of
# niches takes in the fit of T, and a cubed number of niches in a draw.
_FIRST_LOOK = 2.0
_PAIR, _CUBE = 1.2e-5, 2.7e-10
# Births that a niche must have to be ranked.
_RANKED = 20


def _step_bound(text: str, option: str) -> tuple[StepBound, float]:
    from nichechain.variation.additive import parse_step_bound

    return parse_step_bound(text, option)


def _layer_scales(text: str, option: str) -> tuple[float, ...]:
    from nichechain.variation.additive import parse_layer_scales

    return parse_layer_scales(text, option)


@dataclass(frozen=True)
class BuildCommand(SearchConfig):
    """Fill an archive: MAP-Elites that records who was born where."""

    domain: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="DOMAIN")]
    """What to search: fetch (Fetch Pick and Place), arm (a planar arm, for a quick try), gym:ENV_ID
    (any Gymnasium environment), or another that ``nichechain domains`` lists."""
    _: KW_ONLY
    df: Annotated[float | None, parsing.option("DF", "3")] = None
    """Degrees of freedom of student-t."""
    step_bound: Annotated[
        tuple[StepBound, float] | None,
        parsing.option("KIND:SIZE", "none"),
        parsing.parsed("--step-bound", _step_bound),
    ] = None
    """How far a child can be from its parent: per-coordinate:2 truncates the noise on every weight,
    rescaled:50 shortens a step that is longer."""
    layer_scales: Annotated[
        tuple[float, ...],
        parsing.option("S1,S2,...", "all weights alike"),
        parsing.parsed("--layer-scales", _layer_scales),
    ] = ()
    """Factor on the scale in each layer of the controller, such as 1,0.5,0.5."""
    selection: Annotated[str, parsing.option("NAME", "uniform")] = "uniform"
    """How parents are drawn from the elites: uniform, each alike; curiosity, whose children enter; by
    the chain of the births so far (uniformly until there are births): reach, whose descendants would
    fill niches, l-evolvability, whose descendants would visit many, information, where a birth tells
    most of l-evolvability; or a mixture such as reach:0.7,uniform:0.3."""
    temperature: Annotated[
        float | None, parsing.option("T", "1, and 0.3 for a selection that asks the chain")
    ] = None
    """Elites are drawn in proportion to w^(1/T), for w what the selection says of each."""
    selection_l: Annotated[int | None, parsing.option("INT", "1 for reach, else 5")] = None
    """Generations of the lineages that a selection asks the chain about."""
    selection_lineages: Annotated[int | None, parsing.option("INT", "1 for reach, else 100")] = None
    """How many lineages it asks about."""
    grid: Annotated[str | None, parsing.option("NXxNY", _GRID)] = None
    """Cells of the grid along each axis of behavior."""
    niches: Annotated[str | None, parsing.option("cvt:N", "a grid")] = None
    """Niches that are no grid: a Voronoi tessellation of so many, whatever the number of axes."""
    bounds: Annotated[str | None, parsing.option("X0,X1,Y0,Y1", "the domain's, for fetch the table top")] = (
        None
    )
    """Bounds of the niches, in units of behavior."""
    descriptor: Annotated[str | None, parsing.option("DESCRIPTOR", "final-xy")] = None
    """What behavior is, of a gym:ENV_ID: final-xy, final-observation:I,J, mean-observation:I,J,
    final-info:KEY,KEY, or MODULE:FUNCTION of your own."""
    controller: Annotated[str | None, parsing.option("mlp:N,N", "the domain's")] = None
    """Hidden layers of the policy, where the domain has one."""
    steps: Annotated[int | None, parsing.option("STEPS", "the environment's limit")] = None
    """Actions of an episode of a gym:ENV_ID."""
    noise: Annotated[str | None, parsing.option("KIND:SD,...", "none")] = None
    """Noise such as observation:0.01,action:0.1,initial:0.02, drawn alike whenever a genotype is
    evaluated."""
    repeats: Annotated[int | None, parsing.option("N", "5 with noise, else 1")] = None
    """Evaluations of each genotype, whose mean is its behavior."""
    options: Annotated[tuple[str, ...], parsing.option("NAME=VALUE ...", "none")] = ()
    """Further options of the domain, such as joints=20 of the arm."""
    workers: parsing.Workers = None
    cache_memory: parsing.CacheMemory = None
    max_failed: float = MOST_FAILED
    """Share of births that may fail, from 0 to 1, before the build is stopped."""
    out: Annotated[Path | None, parsing.option("PATH", "archives/DOMAIN-seedSEED")] = None
    """Archive folder."""
    resume: bool = False
    """Go on with the archive that the folder holds, to its own budget or a larger --evaluations."""
    force: bool = False
    """Start over, removing the archive that the folder holds."""

    @property
    def folder(self) -> Path:
        """Where the archive goes."""
        return self.out or Path("archives") / f"{re.sub(r'[:/]', '-', self.domain)}-seed{self.seed}"

    def domain_options(self) -> dict[str, DomainOption]:
        """What the domain is told."""
        given = parsing.domain_options(self.options)
        for name in ("descriptor", "controller", "steps", "noise", "repeats"):
            if getattr(self, name) is not None:
                given[name] = getattr(self, name)
        if self.domain.startswith("gym:") and self.bounds is not None:
            # An environment has no bounds of behavior of its own.
            given.setdefault("bounds", self.bounds)
        return given

    def config(self) -> BuildConfig:
        """What is asked for, checked."""
        from nichechain import domains
        from nichechain.niches import parse_bounds, parse_niches, parse_shape
        from nichechain.search.making import check_niches, make_mutation

        if self.grid is not None and self.niches is not None:
            raise NichechainError(
                f"--grid {self.grid} and --niches {self.niches} exclude each other: choose one"
            )
        options = self.domain_options()
        domain = domains.make(self.domain, seed=self.domain_seed, **options)
        bounds = domain.bounds
        # Bounds that the domain was just told may be of fewer axes than it has in the end.
        if self.bounds is not None and options.get("bounds") != self.bounds:
            bounds = parse_bounds(self.bounds, "--bounds")
        config = BuildConfig(
            shape=parse_shape(_GRID if self.grid is None else self.grid, "--grid")
            if self.niches is None
            else (parse_niches(self.niches, "--niches"),),
            niches="grid" if self.niches is None else "cvt",
            bounds=bounds,
            domain_options=options,
            **self.settings(),
        )
        axes = len(domain.behavior_names)
        if self.niches is None and len(config.shape) != axes:
            raise NichechainError(
                f"--grid is {self.grid or _GRID!r}, but {self.domain} has {axes} axes of behavior"
            )
        if len(config.bounds) != axes:
            raise NichechainError(
                f"--bounds is {self.bounds!r}, but {self.domain} needs {axes} pairs of numbers"
            )
        check_niches(config)
        make_mutation(config, domain)
        return config

    @classmethod
    def of(cls, config: BuildConfig) -> BuildCommand:
        """The options that ask for a configuration."""
        return cls(
            grid="x".join(map(str, config.shape)) if config.niches == "grid" else None,
            niches=None if config.niches == "grid" else f"cvt:{config.shape[0]}",
            bounds=",".join(repr(bound) for pair in config.bounds for bound in pair),
            options=parsing.domain_option_texts(config.domain_options),
            **config.settings(),
        )


def run(arguments: Sequence[str]) -> int:
    """Build, then say what came of it."""
    command = parsing.parse(BuildCommand, arguments)
    from nichechain import execution
    from nichechain.archive import read, write
    from nichechain.archive.building import build
    from nichechain.archive.trust import check_trusted
    from nichechain.core.files import writing
    from nichechain.search.making import make_domain

    here = str(Path.cwd())
    if command.domain.startswith("gym:") and here not in sys.path:
        # A descriptor is often a file in the current folder; what is installed comes first.
        sys.path.append(here)
    if not command.resume:
        command.config()
    folder = command.folder
    if command.resume and command.force:
        raise NichechainError("--resume and --force exclude each other: go on, or start over")
    if read.is_archive(folder) and not command.force:
        stored = read.read_meta(folder)
        if not command.resume:
            raise ArchiveError(
                f"{folder} already holds an archive of {stored.births} births: "
                "--resume goes on with it, --force starts over"
            )
        if command.descriptor is None:
            check_trusted(stored.config, folder)
        # What is not said again stays as it was.
        command = parsing.parse(BuildCommand, arguments, default=BuildCommand.of(stored.config))
    config = command.config()
    shown = output.console()
    with execution.make(command.workers, command.cache_memory) as executor:
        if command.force and folder.exists():
            with writing(folder):
                write.clear(folder)
        with progress.spinner("loading the simulator; its engine is compiled once, in about 20 s"):
            import ribs.archives  # noqa: F401  # takes seconds, which the bar should not count

            domain = make_domain(config)
            # What goes wrong with it is for the build to say.
            execution.evaluate_rows(domain, domain.sample(1, seed=0))
            if not read.is_archive(folder):
                _check_constant(config, domain)
        try:
            with progress.build_progress(config.evaluations) as tell:
                build(
                    config,
                    folder,
                    executor,
                    domain=domain,
                    on_progress=tell,
                    max_failed=command.max_failed,
                )
        except KeyboardInterrupt:
            progress.leave_at_next_interrupt()
            kept = read.read_meta(folder).births if read.is_archive(folder) else 0
            again = f"nichechain build {config.domain} --out {shlex.quote(str(folder))} --resume"
            shown.print(f"Stopped; {kept} of {config.evaluations} births are kept. To go on:\n  {again}")
            return 130
    _report(folder, shown)
    return 0


def _check_constant(config: BuildConfig, domain: Domain) -> None:
    """Warn of a domain of others whose behaviors are not functions of the genotype."""
    from nichechain import execution
    from nichechain.domains.constancy import inconstancy
    from nichechain.domains.registry import is_proven
    from nichechain.search.making import make_domain

    if is_proven(config.domain):
        return
    found = inconstancy(
        lambda rows: execution.evaluate_rows(domain, rows),
        lambda rows: execution.evaluate_rows(make_domain(config), rows),
        domain.sample(3, seed=config.seed),
    )
    if found is not None:
        warnings.warn(
            f"{config.domain} has something random that its seed does not fix: {found}, so that no birth can "
            "be replayed or verified; what is random belongs to --noise or --repeats, which average over it",
            stacklevel=2,
        )


def _parents(config: BuildConfig) -> dict[str, str]:
    """From when on the chain steers, which needs births to learn from."""
    if {name for name, _ in parse_selection(config.selection)} <= {"uniform", "curiosity"}:
        return {}
    first = config.initial + config.batch
    return {"parents": f"by {config.selection}; uniformly up to birth {first}, with no child to learn from"}


def _report(folder: Path, shown: object) -> None:
    """A short account of a finished build, and what to do next."""
    import numpy as np
    import pandas as pd
    from rich.console import Console

    from nichechain.archive.archive import load
    from nichechain.evolvability.niches import answer_for_niches
    from nichechain.evolvability.question import DRAWS, Question
    from nichechain.search import savings

    assert isinstance(shown, Console)
    archive = load(folder)
    counts = archive.counts
    n = len(archive.niches)
    # A first look, which should keep nobody waiting: only the niches that it may show are scored.
    births_of = counts.births[:n]
    most = np.argsort(-births_of, kind="stable")[: _SCORED if n > _MANY_NICHES else n]
    roots = np.sort(most[births_of[most] >= _RANKED])
    question = Question(draws=DRAWS if n <= _FEW_NICHES else _FEW_DRAWS)
    seconds = _PAIR * counts.matrix.nnz + (question.draws * _CUBE * n**3 if n <= _MANY_NICHES else 0.0)
    ranking = pd.DataFrame()
    if roots.size and seconds <= _FIRST_LOOK:
        chain = archive.chain()
        scores = answer_for_niches(chain, question, roots=roots)
        ranking = scores.ranking(chain, min_births=_RANKED).dropna().head(5)
    failed = archive.meta.births - int(counts.visits.sum())
    births = archive.meta.births
    rows = {
        "niches filled": f"{archive.filled} of {n}",
        "births": f"{births}, {counts.births_outside} of them outside the grid"
        + (f", {failed} failed" if failed else ""),
        "rows of T observed": f"{counts.rows_observed} of {n}",
        **_parents(archive.meta.config),
        **output.physics(savings.read(folder)),
        "archive": str(folder),
    }
    shown.print()
    shown.print(output.facts(rows))
    if len(ranking):
        top = output.table("niche", "niches reached", "90 % interval", "births behind its row")
        for row in ranking.itertuples():
            top.add_row(row.index, f"{row.value:.1f}", f"{row.low:.1f} to {row.high:.1f}", str(row.births))
        shown.print(
            f"\n[bold]Top niches by l-evolvability[/]  (l = {scores.l}, {scores.lineages} lineages, "
            f"{scores.convention}, {scores.estimator})"
        )
        shown.print(top)
    elif roots.size:
        shown.print(f"\n{roots.size} niches have {_RANKED} births behind their row: evolvability ranks them.")
    else:
        shown.print(f"\nNo niche has {_RANKED} births behind its row yet: too few to rank.")
    shown.print("Next:")
    best = f" --niche {ranking['index'].iloc[0]}" if len(ranking) else ""
    path = shlex.quote(str(folder))
    for line in (
        f"nichechain evolvability {path}{best}",
        f"nichechain plot {path} reachability --out reachability.png",
        f"nichechain info {path}",
    ):
        shown.print(f"  {line}")
