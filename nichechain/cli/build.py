"""``nichechain build``: fill an archive."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from nichechain.cli import console
from nichechain.core.checks import DomainOption
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.search.config import (
    MOST_FAILED,
    BuildConfig,
    MutationName,
    Outside,
    Replacement,
    Selection,
)

_GRID = "20x20"
_MANY_NICHES = 1000


@dataclass(frozen=True)
class BuildCommand:
    """Fill an archive: MAP-Elites that records who was born where."""

    domain: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="DOMAIN")]
    """What to search: fetch (Fetch Pick and Place), arm (a planar arm, for a quick try), gym:ENV_ID
    (any Gymnasium environment), or another that ``nichechain domains`` lists."""
    evaluations: int = BuildConfig.evaluations
    """Births in total, the initial ones among them."""
    grid: Annotated[str | None, console.option("NXxNY", _GRID)] = None
    """Cells of the grid along each axis of behavior."""
    niches: Annotated[str | None, console.option("cvt:N", "a grid")] = None
    """Niches that are no grid: a Voronoi tessellation of so many, whatever the number of axes."""
    niches_seed: int = BuildConfig.niches_seed
    """Seed of a tessellation; runs that are to be merged share it."""
    bounds: Annotated[str | None, console.option("X0,X1,Y0,Y1", "the domain's, for fetch the table top")] = (
        None
    )
    """Bounds of the niches, in units of behavior."""
    initial: int = BuildConfig.initial
    """Births without a parent."""
    batch: int = BuildConfig.batch
    """Children of a step."""
    mutation: MutationName = BuildConfig.mutation
    """Mutation operator, on every weight."""
    scale: float = BuildConfig.scale
    """Scale of the mutation."""
    df: Annotated[float | None, console.option("DF", "3")] = None
    """Degrees of freedom of student-t."""
    step_bound: Annotated[str | None, console.option("KIND:SIZE", "none")] = None
    """How far a child can be from its parent: per-coordinate:2 truncates the noise on every weight,
    rescaled:50 shortens a step that is longer."""
    layer_scales: Annotated[str | None, console.option("S1,S2,...", "all weights alike")] = None
    """Factor on the scale in each layer of the controller, such as 1,0.5,0.5."""
    self_adaptive: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Step sizes are genes, one per layer scale or else one: they begin at the scale and evolve."""
    selection: Selection = BuildConfig.selection
    """How parents are drawn from the elites: each alike, or by curiosity, whose children enter."""
    lineage_share: float = BuildConfig.lineage_share
    """Share of the births that unselected lineages get, whose parents are their own latest births: they
    show what lineages do. 0 selects all parents."""
    lineage_length: int = BuildConfig.lineage_length
    """Births of such a lineage."""
    replacement: Replacement = BuildConfig.replacement
    """Which birth of a niche is its elite: each alike, the first, the last, or the best."""
    outside: Outside = BuildConfig.outside
    """Where a behavior out of bounds belongs: a state of its own, one never left, or the nearest niche."""
    seed: int = BuildConfig.seed
    """Seed of the run."""
    domain_seed: int = BuildConfig.domain_seed
    """Seed of what the domain holds fixed (fetch: where block and target begin)."""
    descriptor: Annotated[str | None, console.option("DESCRIPTOR", "final-xy")] = None
    """What behavior is, of a gym:ENV_ID: final-xy, final-observation:I,J, mean-observation:I,J,
    final-info:KEY,KEY, or MODULE:FUNCTION of your own."""
    controller: Annotated[str | None, console.option("mlp:N,N", "the domain's")] = None
    """Hidden layers of the policy, where the domain has one."""
    steps: Annotated[int | None, console.option("STEPS", "the environment's limit")] = None
    """Actions of an episode of a gym:ENV_ID."""
    noise: Annotated[str | None, console.option("KIND:SD,...", "none")] = None
    """Noise such as observation:0.01,action:0.1,initial:0.02, drawn alike whenever a genotype is
    evaluated."""
    repeats: Annotated[int | None, console.option("N", "5 with noise, else 1")] = None
    """Evaluations of each genotype, whose mean is its behavior."""
    options: Annotated[tuple[str, ...], console.option("NAME=VALUE ...", "none")] = ()
    """Further options of the domain, such as joints=20 of the arm."""
    workers: Annotated[str | None, console.option("WORKERS", "one thread per processor")] = None
    """Who evaluates: a number of threads, processes:N, ray or ray://HOST:PORT. The result is the same."""
    cache_memory: Annotated[str | None, console.option("SIZE", "2GiB")] = None
    """Memory on each machine for physics that was computed before, such as 500MB, or 0 for none. The result
    is the same."""
    max_failed: float = MOST_FAILED
    """Share of births that may fail, from 0 to 1, before the build is stopped."""
    out: Annotated[Path | None, console.option("PATH", "archives/DOMAIN-seedSEED")] = None
    """Archive folder."""
    resume: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Go on with the archive that the folder holds, to its own budget or a larger --evaluations."""
    force: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Start over, removing the archive that the folder holds."""

    @property
    def folder(self) -> Path:
        """Where the archive goes."""
        return self.out or Path("archives") / f"{re.sub(r'[:/]', '-', self.domain)}-seed{self.seed}"

    def domain_options(self) -> dict[str, DomainOption]:
        """What the domain is told."""
        given = dict(domain_option(text) for text in self.options)
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
        from nichechain.variation.additive import parse_layer_scales, parse_step_bound

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
            domain=self.domain,
            shape=parse_shape(_GRID if self.grid is None else self.grid, "--grid")
            if self.niches is None
            else (parse_niches(self.niches, "--niches"),),
            niches="grid" if self.niches is None else "cvt",
            niches_seed=self.niches_seed,
            bounds=bounds,
            domain_seed=self.domain_seed,
            domain_options=options,
            evaluations=self.evaluations,
            outside=self.outside,
            initial=self.initial,
            batch=self.batch,
            mutation=self.mutation,
            scale=self.scale,
            df=self.df,
            step_bound=None if self.step_bound is None else parse_step_bound(self.step_bound, "--step-bound"),
            layer_scales=()
            if self.layer_scales is None
            else parse_layer_scales(self.layer_scales, "--layer-scales"),
            self_adaptive=self.self_adaptive,
            selection=self.selection,
            lineage_share=self.lineage_share,
            lineage_length=self.lineage_length,
            replacement=self.replacement,
            seed=self.seed,
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
            domain=config.domain,
            evaluations=config.evaluations,
            grid="x".join(map(str, config.shape)) if config.niches == "grid" else None,
            niches=None if config.niches == "grid" else f"cvt:{config.shape[0]}",
            niches_seed=config.niches_seed,
            bounds=",".join(repr(bound) for pair in config.bounds for bound in pair),
            initial=config.initial,
            batch=config.batch,
            mutation=config.mutation,
            scale=config.scale,
            df=config.df,
            step_bound=config.step_bound and f"{config.step_bound[0]}:{config.step_bound[1]!r}",
            layer_scales=",".join(map(repr, config.layer_scales)) or None,
            self_adaptive=config.self_adaptive,
            selection=config.selection,
            lineage_share=config.lineage_share,
            lineage_length=config.lineage_length,
            replacement=config.replacement,
            outside=config.outside,
            seed=config.seed,
            domain_seed=config.domain_seed,
            options=tuple(
                f"{name}={domain_option_text(value)}" for name, value in config.domain_options.items()
            ),
        )


def domain_option(text: str) -> tuple[str, DomainOption]:
    """``"joints=20"`` as ``("joints", 20)``."""
    name, equals, value = text.partition("=")
    if not name or not equals:
        raise NichechainError(f"option {text!r} of the domain must be NAME=VALUE, such as joints=20")
    if value in ("true", "false"):
        return name, value == "true"
    for kind in (int, float):
        try:
            return name, kind(value)
        except ValueError:
            continue
    return name, value


def domain_option_text(value: DomainOption) -> str:
    """What :func:`domain_option` reads as the value."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def run(arguments: Sequence[str]) -> int:
    """Build, then say what came of it."""
    command = console.parse(BuildCommand, arguments)
    from nichechain import execution
    from nichechain.archive import read, write
    from nichechain.archive.build import build
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
        command = console.parse(BuildCommand, arguments, default=BuildCommand.of(stored.config))
    config = command.config()
    shown = console.console()
    with execution.make(command.workers, command.cache_memory) as executor:
        if command.force and folder.exists():
            with writing(folder):
                write.clear(folder)
        with console.spinner("loading the simulator; its engine is compiled once, in about 20 s"):
            import ribs.archives  # noqa: F401  # takes seconds, which the bar should not count

            domain = make_domain(config)
            # What goes wrong with it is for the build to say.
            execution.evaluate_rows(domain, domain.sample(1, seed=0))
        try:
            with console.build_progress(config.evaluations) as tell:
                build(
                    config,
                    folder,
                    executor,
                    domain=domain,
                    on_progress=tell,
                    max_failed=command.max_failed,
                )
        except KeyboardInterrupt:
            console.leave_at_next_interrupt()
            kept = read.read_meta(folder).births if read.is_archive(folder) else 0
            again = f"nichechain build {config.domain} --out {folder} --resume"
            shown.print(f"Stopped; {kept} of {config.evaluations} births are kept. To go on:\n  {again}")
            return 130
    _report(folder, shown)
    return 0


def _report(folder: Path, shown: object) -> None:
    """A short account of a finished build, and what to do next."""
    from rich.console import Console

    from nichechain.archive.archive import load
    from nichechain.evolvability import DRAWS, niche_evolvability
    from nichechain.search import savings

    assert isinstance(shown, Console)
    archive = load(folder)
    counts = archive.counts
    chain = archive.chain()
    n = len(archive.niches)
    # A first look; many states take minutes with as many draws as an answer should rest on.
    scores = niche_evolvability(chain, draws=DRAWS if n <= _MANY_NICHES else 5)
    ranking = scores.ranking(chain).head(5)
    failed = archive.meta.births - int(counts.visits.sum())
    births = archive.meta.births
    rows = {
        "niches filled": f"{archive.filled} of {n}",
        "births": f"{births}, {counts.births_outside} of them outside the grid"
        + (f", {failed} failed" if failed else ""),
        "rows of T observed": f"{counts.rows_observed} of {n}",
        **console.physics(savings.read(folder)),
        "archive": str(folder),
    }
    shown.print()
    shown.print(console.facts(rows))
    if len(ranking):
        top = console.table("niche", "niches reached", "90 % interval", "births behind its row")
        for row in ranking.itertuples():
            top.add_row(row.index, f"{row.value:.1f}", f"{row.low:.1f} to {row.high:.1f}", str(row.births))
        shown.print(
            f"\n[bold]Top niches by l-evolvability[/]  (l = {scores.l}, {scores.lineages} lineages, "
            f"{scores.convention}, {scores.estimator})"
        )
        shown.print(top)
    else:
        shown.print("\nNo niche has 20 births behind its row yet: too few to rank.")
    shown.print("Next:")
    best = f" --niche {ranking['index'].iloc[0]}" if len(ranking) else ""
    for line in (
        f"nichechain evolvability {folder}{best}",
        f"nichechain plot {folder} reachability --out reachability.png",
        f"nichechain info {folder}",
    ):
        shown.print(f"  {line}")
