"""What the cache of motions spares where it is used: whole searches and studies, batch by batch.

    python benchmarks/work.py [build] [pressure] [unsaturated] [--share 0.1] [--cpu]

Every batch that a search or study asks for is evaluated on two threads by the engine without the
cache, by the engine with it, and by EnvPool if that is installed, in turn, one right after the
other. The results of the first two must agree to the bit. Printed are ratios of the summed times,
now and then, and at the end beside what is aimed at:
- build: ``nichechain build fetch`` of 8,000 births, in its default configuration;
- pressure: the pressure study, 6 levels by 5 runs by 50 steps;
- unsaturated: mutation of scale 0.1, 2,000 births, where no motion comes again.

``--share`` takes so much of each, which is quicker, and spares less: the cache learns as it goes.
``--cpu`` takes processor time instead of wall time, for a machine that others use too.
"""

from __future__ import annotations

import argparse
import importlib.util
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rollout import envpool_task

from nichechain.archive.building import build
from nichechain.domains.base import Domain, Evaluation
from nichechain.domains.fetch import FetchPickAndPlace
from nichechain.execution import Threads
from nichechain.search.config import BuildConfig
from nichechain.studies.conditions import Condition
from nichechain.studies.running import run as walk_study
from nichechain.studies.study import Study, pressure_conditions
from nichechain.variation.unborn import Unborn, grown

THREADS = 2
GRID, BOUNDS = (20, 20), FetchPickAndPlace.bounds
LEVELS = ("selective", "0.1", "0.25", "0.5", "0.75", "random")
_EVERY = 60.0
_TARGETS = {"build": (1.55, 1.9), "pressure": (2.3, 2.6), "unsaturated": (0.98, 1.05)}


class Compared:
    """An executor that evaluates everything in every way, and adds up what each takes."""

    def __init__(self, name: str, clock: Callable[[], float]) -> None:
        self._name = name
        self._clock = clock
        self._ways = {"plain": FetchPickAndPlace(cache_memory=0), "cached": FetchPickAndPlace()}
        self._threads = Threads(THREADS)
        self._envpool = importlib.util.find_spec("envpool") is not None
        self._seconds: dict[str, float] = dict.fromkeys(("plain", "cached", "envpool"), 0.0)
        self._steps = self._known = self._rollouts = 0
        self._told = time.monotonic()
        for domain in self._ways.values():
            domain.evaluate(np.zeros((2, domain.genotype_length), np.float32))

    def evaluate(
        self,
        domain: Domain,  # noqa: ARG002  # the executor's own, with and without the cache
        genotypes: NDArray[np.float32] | Unborn,
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        """The rows, from the engine with the cache."""
        # Grown here, so that times are of rollouts alone.
        rows = grown(genotypes)
        found = {way: self._timed(way, self._threads.evaluate, d, rows) for way, d in self._ways.items()}
        if self._envpool:
            self._timed("envpool", envpool_task(rows, THREADS))
        plain, cached = found["plain"], found["cached"]
        if plain.behavior.tobytes() != cached.behavior.tobytes() or plain.reasons != cached.reasons:
            raise RuntimeError("the cache changed a result")
        self._steps += cached.steps
        self._known += cached.known
        self._rollouts += len(rows)
        if time.monotonic() - self._told > _EVERY:
            self._told = time.monotonic()
            self.tell()
        if on_done is not None:
            on_done(len(rows))
        return cached

    def _timed(self, way: str, task: Callable[..., Evaluation], *arguments: object) -> Evaluation:
        began = self._clock()
        result = task(*arguments)
        self._seconds[way] += self._clock() - began
        return result

    def tell(self) -> None:
        """One line of ratios."""
        seconds, (ours, theirs) = self._seconds, _TARGETS[self._name]
        known = self._known / max(1, self._steps)
        line = f"{self._name:12s}{self._rollouts:6d} rollouts, {known:4.0%} of steps known"
        line += f"   without / with cache {seconds['plain'] / seconds['cached']:5.2f} [>= {ours}]"
        if self._envpool:
            line += f"   EnvPool / ours {seconds['envpool'] / seconds['cached']:5.2f} [>= {theirs}]"
        print(line, flush=True)


def main() -> None:
    """Run what is asked for, or all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("work", nargs="*", choices=[*_TARGETS, []], help="all by default")
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--cpu", action="store_true")
    options = parser.parse_args()
    clock = time.process_time if options.cpu else time.perf_counter
    for name in options.work or _TARGETS:
        executor = Compared(name, clock)
        with tempfile.TemporaryDirectory() as folder:
            if name == "pressure":
                runs = max(1, round(5 * options.share))
                conditions = pressure_conditions(LEVELS, Condition(label="base"))
                steps = round(50 * options.share * 5 / runs)
                study = Study("pressure", "fetch", conditions, runs, steps, GRID, BOUNDS)
                walk_study(study, Path(folder) / "study", executor)
            else:
                births, scale = (8000, 1.0) if name == "build" else (2000, 0.1)
                config = BuildConfig(
                    "fetch", GRID, BOUNDS, evaluations=round(births * options.share), scale=scale
                )
                build(config, Path(folder) / "archive", executor)
        executor.tell()


if __name__ == "__main__":
    main()
