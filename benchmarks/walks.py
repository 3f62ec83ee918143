"""What a walk costs beside its rollouts, and which neighbour search wins.

    python benchmarks/walks.py [--runs 50] [--steps 50] [--offspring 30]

Prints, from one run, with processor time beside wall time because other programs slow the latter:
- seconds for whole walks on the planar arm, whose rollouts cost next to nothing;
- seconds of one step of Fetch Pick and Place, and how much of it is not rollouts: mutation,
  metric, selection, births. The novelty archives are full, the dearest case;
- a k-d tree per walk against partial sorting, over the size of the population.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from nichechain import domains, variation
from nichechain.domains.base import Domain, Evaluation
from nichechain.execution import Threads, available_cpus
from nichechain.niches import GridNiches
from nichechain.variation.unborn import Unborn
from nichechain.walks import Selective, TopFraction, Uniform, WalkConfig, Walks, diversity, walk
from nichechain.walks.diversity import metrics


class Stopwatch:
    """An executor that knows how long rollouts took, and rolls the same children out only once."""

    def __init__(self, inner: Threads) -> None:
        self._inner = inner
        self._kept: Evaluation | None = None
        self.wall = 0.0
        self.processor = 0.0

    def evaluate(
        self,
        domain: Domain,
        genotypes: NDArray[np.float32] | Unborn,
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        """Evaluate, or give what was evaluated before."""
        if self._kept is None:
            wall, processor = time.perf_counter(), time.process_time()
            self._kept = self._inner.evaluate(domain, genotypes, on_done)
            self.wall = time.perf_counter() - wall
            self.processor = time.process_time() - processor
        return self._kept


def main() -> None:
    """Run all three."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--steps", type=int, default=50)
    parser.add_argument("--offspring", type=int, default=30)
    options = parser.parse_args()
    with Threads() as threads:
        arm(options, threads)
        fetch(options, threads)
    neighbours()


def arm(options: argparse.Namespace, threads: Threads) -> None:
    """Whole walks on the arm."""
    domain = domains.make("arm")
    niches = GridNiches((20, 20), domain.bounds)
    print(f"arm, {options.runs} runs x {options.steps} steps x {options.offspring} offspring:")
    for label, selection, metric in (
        ("selective, knn", Selective(), "knn"),
        ("adaptive 0.1, knn", TopFraction(0.1), "knn"),
        ("random, knn", Uniform(), "knn"),
        ("selective, kde", Selective(), "kde"),
        ("selective, ancestors", Selective(), "ancestors"),
    ):
        config = WalkConfig(selection, diversity.make(metric), offspring=options.offspring)
        started, processor = time.perf_counter(), time.process_time()
        walk(
            domain,
            variation.cauchy(),
            config,
            runs=options.runs,
            steps=options.steps,
            niches=niches,
            executor=threads,
        )
        wall, processor = time.perf_counter() - started, time.process_time() - processor
        print(f"  {label:22s} {wall:6.2f} s, processor {processor:6.2f} s")


def fetch(options: argparse.Namespace, threads: Threads) -> None:
    """One step of Fetch with full novelty archives, for two metrics on the same rollouts."""
    domain = domains.make("fetch")
    niches = GridNiches((20, 20), domain.bounds)
    rollouts = options.runs * options.offspring
    watch = Stopwatch(threads)
    print(f"fetch, one step of {rollouts} rollouts on {available_cpus()} processors, archives full:")
    for metric in ("knn", "kde"):
        config = WalkConfig(Selective(), diversity.make(metric), offspring=options.offspring)
        walks = Walks(domain, variation.cauchy(), config, niches)
        state, _ = walks.start(options.runs, threads)
        state = dataclasses.replace(state, archive=_full(options.runs, config.archive.limit, niches))
        # Rollouts run in other threads: this one's own time is all that is not rollouts.
        started = time.thread_time()
        walks.advance(state, watch)
        other = time.thread_time() - started
        print(
            f"  {metric}: rollouts {watch.wall:.2f} s, processor {watch.processor:.2f} s; all else processor "
            f"{other:.2f} s: {100 * other / watch.processor:.2f} % of the rollouts' processor time, "
            f"{100 * other / watch.wall:.2f} % of their wall time"
        )


def neighbours() -> None:
    """A tree for each of 10 walks against partial sorting, archives of 1200."""
    print("k nearest of n offspring and 1200 archived, 10 walks, milliseconds:")
    rng = np.random.default_rng(0)
    for count in (30, 60, 120, 480):
        pool = rng.normal(size=(10, count + 1200, 2))
        own = np.arange(count)
        query = pool[:, :count]
        tree = _best(lambda q=query, p=pool, o=own: [metrics._by_tree(*pair, 15, o) for pair in zip(q, p)])  # noqa: B905
        sort = _best(
            lambda q=query, p=pool, o=own: [metrics._by_sorting(q[[i]], p[[i]], 15, o) for i in range(10)]
        )
        print(f"  n = {count:4d}: tree {tree:6.1f}, sorting {sort:6.1f}")


def _full(runs: int, limit: int, niches: GridNiches) -> diversity.NoveltyArchive:
    points = np.random.default_rng(0).uniform(niches.lower, niches.upper, (runs, limit, len(niches.shape)))
    return diversity.NoveltyArchive(points, np.zeros((runs, limit), np.int64))


def _best(call: Callable[[], object]) -> float:
    times = []
    for _ in range(5):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return 1e3 * min(times)


if __name__ == "__main__":
    main()
