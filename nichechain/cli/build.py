"""``nichechain build``: fill an archive."""

from __future__ import annotations

import re
import shlex
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

import tyro

from nichechain.cli import output, parsing, progress, workers
from nichechain.core.checks import DomainOption, StepBound, check_at_least, shown
from nichechain.core.errors import NichechainError
from nichechain.search.config import MOST_FAILED, BuildConfig, ObjectiveName, SearchConfig

if TYPE_CHECKING:
    from nichechain.domains.base import Domain

_GRID = "20x20"


def _step_bound(text: str, option: str) -> tuple[StepBound, float]:
    from nichechain.variation.additive import parse_step_bound

    return parse_step_bound(text, option)


def _layer_scales(text: str, option: str) -> tuple[float, ...]:
    from nichechain.variation.additive import parse_layer_scales

    return parse_layer_scales(text, option)


@dataclass(frozen=True)
class BuildCommand(SearchConfig):
    """Fill an archive: MAP-Elites that records who was born where."""

    GROUPS: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "niche": ("grid", "niches", "bounds", "outside", "niches_seed"),
        "mutation": ("mutation", "scale", "df", "step_bound", "layer_scales", "self_adaptive"),
        "search": ("initial", "batch"),
        "elite": ("replacement", "objective", "offspring", "objective_l", "objective_lineages"),
        "parent": ("selection", "temperature", "selection_l", "selection_lineages"),
        "lineage": ("lineage_share", "lineage_length", "lineage_brood"),
        "domain": ("domain_seed", "descriptor", "controller", "steps", "noise", "repeats", "options"),
        "running": ("workers", "cache_memory", "max_failed"),
    }
    EXAMPLES: ClassVar[tuple[str, ...]] = (
        "nichechain build arm --evaluations 20000 --scale 0.1 --seeds 0..9",
        "nichechain build gym:Swimmer-v5 --bounds=-2,2,-2,2 --steps 200 --evaluations 2000",
    )

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
    objective: ObjectiveName = "domain"
    """What is best, where --replacement is objective: the domain's own objective, or the l-evolvability of
    the genotype, by offspring that it gets before it is compared with another of its niche."""
    objective_lineages: Annotated[int | None, parsing.option("INT", "--offspring")] = None
    """How many lineages, of which each begins with another child."""
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
    seeds: Annotated[str | None, parsing.option("FROM..TO", "one search, of --seed")] = None
    """Several searches that differ in their seed, one after the other: 0..9, or 0,3,5. Their archives are
    PATH-seed0 and so on."""
    out: Annotated[Path | None, parsing.option("PATH", "archives/DOMAIN-seedSEED")] = None
    """Archive folder."""
    resume: bool = False
    """Go on with the archive that the folder holds, to its own budget or a larger --evaluations. Where it
    holds none, one is begun."""
    force: bool = False
    """Start over, removing the archive that the folder holds."""

    def folder_of(self, seed: int) -> Path:
        """Where the archive of the search of this seed goes."""
        if self.out is not None and self.seeds is None:
            return self.out
        begin = self.out or Path("archives") / re.sub(r"[:/]", "-", self.domain)
        return Path(f"{begin}-seed{seed}")

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
        check_at_least(0, **{"--domain-seed": self.domain_seed})
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
                f"--grid is {shown(self.grid or _GRID)}, but {self.domain} has {axes} axes of behavior"
            )
        if len(config.bounds) != axes:
            raise NichechainError(
                f"--bounds is {shown(self.bounds)}, but {self.domain} needs {axes} pairs of numbers"
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
    from nichechain.cli import built
    from nichechain.cli.searches import asked_for
    from nichechain.core.files import writing
    from nichechain.search.making import make_domain

    here = str(Path.cwd())
    if command.domain.startswith("gym:") and here not in sys.path:
        # A descriptor is often a file in the current folder; what is installed comes first.
        sys.path.append(here)
    searches = asked_for(command, arguments)
    shown = output.console()
    if command.resume and not any(read.is_archive(search.folder) for search in searches):
        # Perhaps the name of the folder was misspelled.
        shown.print(f"{searches[0].folder} holds no archive to go on with: one is begun.")
    with workers.hired(command.workers, command.cache_memory) as executor:
        for folder in (search.folder for search in searches if command.force):
            if folder.exists():
                with writing(folder):
                    write.clear(folder)
        with progress.spinner("loading the domain"):
            import ribs.archives  # noqa: F401  # takes seconds, which the bar should not count

            first = searches[0]
            domain = make_domain(first.config)
            # What goes wrong with it is for the build to say.
            execution.evaluate_rows(domain, domain.sample(1, seed=0))
            if not read.is_archive(first.folder):
                _check_constant(first.config, domain)
        for number, search in enumerate(searches, 1):
            config, folder = search.config, search.folder
            name = f"seed {config.seed}, {number} of {len(searches)}" if command.seeds is not None else ""
            try:
                with progress.build_progress(config.evaluations, name) as tell:
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
                stopped = f"Stopped at {name}" if name else "Stopped"
                again = _again(command, folder, arguments if name or not kept else None)
                shown.print(
                    f"{stopped}; {kept} of {config.evaluations} births are kept. To go on:\n  {again}"
                )
                return 130
    if command.seeds is None:
        built.report(searches[0].folder, shown)
    else:
        built.report_all([search.folder for search in searches], shown)
    return 0


def _again(command: BuildCommand, folder: Path, arguments: Sequence[str] | None) -> str:
    """The command line that goes on; with all that was asked for where the folder does not know it."""
    if arguments is None:
        return f"nichechain build {command.domain} --out {shlex.quote(str(folder))} --resume"
    kept = [word for word in arguments if word not in ("--resume", "--force")]
    return f"nichechain build {shlex.join(kept)} --resume"


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
