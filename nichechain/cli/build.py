"""``nichechain build``: fill an archive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from nichechain.cli import console
from nichechain.config import BuildConfig, MutationName, Outside, Replacement
from nichechain.errors import ArchiveError, NichechainError

_MANY_NICHES = 1000


@dataclass(frozen=True)
class Build:
    """Fill an archive: MAP-Elites that records who was born where."""

    domain: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="DOMAIN")]
    """What to search: fetch (Fetch Pick and Place) or arm (a planar arm, for a quick try)."""
    evaluations: int = BuildConfig.evaluations
    """Births in total, the initial ones among them."""
    grid: Annotated[str, tyro.conf.arg(metavar="NXxNY")] = "20x20"
    """Cells of the grid along each axis of behavior."""
    bounds: Annotated[str | None, console.option("X0,X1,Y0,Y1", "the domain's, for fetch the table top")] = (
        None
    )
    """Bounds of the grid, in units of behavior."""
    initial: int = BuildConfig.initial
    """Births without a parent."""
    batch: int = BuildConfig.batch
    """Children of a step."""
    mutation: MutationName = BuildConfig.mutation
    """Mutation operator, on every weight."""
    scale: float = BuildConfig.scale
    """Scale of the mutation."""
    replacement: Replacement = BuildConfig.replacement
    """Which birth of a niche is its elite: each alike, the first, the last, or the best."""
    outside: Outside = BuildConfig.outside
    """Where a behavior out of bounds belongs: a state of its own, one never left, or the nearest niche."""
    seed: int = BuildConfig.seed
    """Seed of the run."""
    domain_seed: int = BuildConfig.domain_seed
    """Seed of what the domain holds fixed (fetch: where block and target begin)."""
    workers: Annotated[str | None, console.option("WORKERS", "one thread per processor")] = None
    """Who evaluates: a number of threads, processes:N, ray or ray://HOST:PORT. The result is the same."""
    out: Annotated[Path | None, console.option("PATH", "archives/DOMAIN-seedSEED")] = None
    """Archive folder."""
    resume: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Go on with the archive that the folder holds, to its own budget or a larger --evaluations."""
    force: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Start over, removing the archive that the folder holds."""

    @property
    def folder(self) -> Path:
        """Where the archive goes."""
        return self.out or Path("archives") / f"{self.domain}-seed{self.seed}"

    def config(self) -> BuildConfig:
        """What is asked for, checked."""
        from nichechain import domains, variation
        from nichechain.niches import GridNiches, parse_bounds, parse_shape

        domain = domains.make(self.domain, seed=self.domain_seed)
        bounds = domain.bounds if self.bounds is None else parse_bounds(self.bounds)
        config = BuildConfig(
            domain=self.domain,
            shape=parse_shape(self.grid),
            bounds=bounds,
            domain_seed=self.domain_seed,
            evaluations=self.evaluations,
            outside=self.outside,
            initial=self.initial,
            batch=self.batch,
            mutation=self.mutation,
            scale=self.scale,
            replacement=self.replacement,
            seed=self.seed,
        )
        axes = len(domain.behavior_names)
        if len(config.shape) != axes:
            raise NichechainError(f"--grid is {self.grid!r}, but {self.domain} has {axes} axes of behavior")
        if len(config.bounds) != axes:
            raise NichechainError(
                f"--bounds is {self.bounds!r}, but {self.domain} needs {axes} pairs of numbers"
            )
        GridNiches(config.shape, config.bounds, config.outside)
        variation.make(config.mutation, config.scale)
        return config

    @classmethod
    def of(cls, config: BuildConfig) -> Build:
        """The options that ask for a configuration."""
        return cls(
            domain=config.domain,
            evaluations=config.evaluations,
            grid="x".join(map(str, config.shape)),
            bounds=",".join(repr(bound) for pair in config.bounds for bound in pair),
            initial=config.initial,
            batch=config.batch,
            mutation=config.mutation,
            scale=config.scale,
            replacement=config.replacement,
            outside=config.outside,
            seed=config.seed,
            domain_seed=config.domain_seed,
        )


def run(arguments: Sequence[str]) -> int:
    """Build, then say what came of it."""
    command = console.parse(Build, arguments)
    from nichechain import execution, store
    from nichechain.building import build

    command.config()
    folder = command.folder
    if command.resume and command.force:
        raise NichechainError("--resume and --force exclude each other: go on, or start over")
    if store.is_archive(folder) and not command.force:
        stored = store.read_meta(folder)
        if not command.resume:
            raise ArchiveError(
                f"{folder} already holds an archive of {stored.births} births: "
                "--resume goes on with it, --force starts over"
            )
        # What is not said again stays as it was.
        command = console.parse(Build, arguments, default=Build.of(stored.config))
    config = command.config()
    shown = console.console()
    with execution.make(command.workers) as executor:
        if command.force and folder.exists():
            with store.writing(folder):
                store.clear(folder)
        with console.spinner("loading the simulator; its engine is compiled once, in about 20 s"):
            import ribs.archives  # noqa: F401  # takes seconds, which the bar should not count

            from nichechain import domains

            domain = domains.make(config.domain, seed=config.domain_seed)
            domain.evaluate(domain.sample(1, seed=0))
        try:
            with console.build_progress(config.evaluations) as tell:
                build(config, folder, executor, domain=domain, on_progress=tell)
        except KeyboardInterrupt:
            kept = store.read_meta(folder).births if store.is_archive(folder) else 0
            again = f"nichechain build {config.domain} --out {folder} --resume"
            shown.print(f"Stopped; {kept} of {config.evaluations} births are kept. To go on:\n  {again}")
            return 130
    _report(folder, shown)
    return 0


def _report(folder: Path, shown: object) -> None:
    """A short account of a finished build, and what to do next."""
    from rich.console import Console

    from nichechain.archive import load
    from nichechain.evolvability import DRAWS, niche_evolvability

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
