"""What everything but the rollouts costs: of a build, of threads, of processes and of Ray.

Ratios are taken within one run, round by round, and their median is printed, with the range. All
rounds evaluate the same Fetch genotypes. Wall time is used, so leave the machine alone; where
other work may share it, the share of processor time is printed too. Without Ray installed, its
line is left out.

    python benchmarks/overhead.py --repeats 5
"""

from __future__ import annotations

import argparse
import importlib.util
import itertools
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

import nichechain as nc
from nichechain import domains, execution, variation
from nichechain.archive import read, write
from nichechain.archive.building import build
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains import Evaluation, FetchPickAndPlace, PlanarArm
from nichechain.domains.base import Domain
from nichechain.execution import Executor, Threads, available_cpus
from nichechain.search.config import BuildConfig


class TimedFetch(FetchPickAndPlace):
    """Fetch that adds up the processor time of its rollouts, whichever thread runs them."""

    def __init__(self) -> None:
        super().__init__()
        self.times: list[float] = []

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        """Evaluate, and note how long it took."""
        started = time.thread_time()
        evaluation = super().evaluate(genotypes)
        self.times.append(time.thread_time() - started)
        return evaluation


class Stopwatch:
    """An executor that adds up the time that passes in it."""

    def __init__(self, inner: Executor) -> None:
        self._inner = inner
        self.wall = 0.0

    def evaluate(
        self, domain: Domain, genotypes: NDArray[np.float32], on_done: Callable[[int], None] | None = None
    ) -> Evaluation:
        """Evaluate, and note how long it took."""
        started = time.perf_counter()
        evaluation = self._inner.evaluate(domain, genotypes, on_done)
        self.wall += time.perf_counter() - started
        return evaluation


class Scattered(PlanarArm):
    """An arm whose every genotype is a message of its own, as long as a Fetch policy."""

    chunk = 1

    def __init__(self) -> None:
        super().__init__(1952)


def main() -> None:
    """Measure all of it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--batch", type=int, default=256, help="genotypes of a round")
    parser.add_argument("--births", type=int, default=1000, help="of a measured build")
    options = parser.parse_args()
    cpus = available_cpus()
    load = os.getloadavg()[0]
    print(f"{cpus} processors, load {load:.1f} before we begin, {options.repeats} repeats, medians (range)")
    building(options)
    executors(options)
    driver(options)
    disk()


def building(options: argparse.Namespace) -> None:
    """Everything around the rollouts in a build."""
    import ribs.archives  # noqa: F401  # takes seconds once, which is not the build's

    domain = TimedFetch()
    domain.evaluate(domain.sample(1, seed=0))
    wall, processor, busy = [], [], []
    for seed in range(options.repeats):
        config = BuildConfig("fetch", (20, 20), domain.bounds, evaluations=options.births, seed=seed)
        domain.times.clear()
        with tempfile.TemporaryDirectory() as folder, Threads() as threads:
            watch = Stopwatch(threads)
            began, used = time.perf_counter(), time.process_time()
            build(config, folder, watch, domain=domain)
            took, used = time.perf_counter() - began, time.process_time() - used
        wall.append(100 * (1 - watch.wall / took))
        processor.append(100 * (1 - sum(domain.times) / used))
        busy.append(100 * sum(domain.times) / (took * available_cpus()))
    print(f"build of {options.births} births, batches of {config.batch}, threads:")
    print(f"  outside evaluation:      {_range(wall)} % of the wall time (target: at most 3)")
    print(f"  all but rollouts:        {_range(processor)} % of the processor time")
    print(f"  processors at rollouts:  {_range(busy)} % of the wall time; else they wait for a batch's last")


def executors(options: argparse.Namespace) -> None:
    """Executors on the same genotypes, against threads."""
    domain = domains.make("fetch")
    first = domain.sample(options.batch, seed=0)
    mutate = variation.cauchy()
    genotypes = np.stack([mutate(row, keyed(0, Purpose.MUTATION, i)) for i, row in enumerate(first)])
    cpus = available_cpus()
    specs = {"one thread": "1", "threads": "threads", "processes": "processes"}
    if importlib.util.find_spec("ray"):
        specs["ray"] = "ray"
    times: dict[str, list[float]] = {name: [] for name in specs}
    made = {name: execution.make(spec) for name, spec in specs.items()}
    entered = {name: manager.__enter__() for name, manager in made.items()}
    try:
        for repeat in range(options.repeats + 1):
            # Rounds take turns at being first.
            for name in itertools.islice(itertools.cycle(specs), repeat, repeat + len(specs)):
                began = time.perf_counter()
                entered[name].evaluate(domain, genotypes)
                # The first round loads the simulator everywhere.
                if repeat:
                    times[name].append(time.perf_counter() - began)
    finally:
        for manager in made.values():
            manager.__exit__(None, None, None)
    per_core = [options.batch / t for t in times["one thread"]]
    print(f"batches of {options.batch} Fetch rollouts, {cpus} workers:")
    print(f"  one thread:              {_range(per_core)} rollouts a second")
    efficiency = [
        one / (cpus * many) for one, many in zip(times["one thread"], times["threads"], strict=True)
    ]
    print(f"  thread efficiency:       {_range(efficiency, 3)} (target: at least 0.93)")
    for name in list(specs)[2:]:
        over = [100 * (t / base - 1) for t, base in zip(times[name], times["threads"], strict=True)]
        target = " (target: at most 10)" if name == "ray" else ""
        print(f"  {name + ' over threads:':24s} {_range(over)} %{target}")


def driver(options: argparse.Namespace) -> None:
    """Processor time of the process that drives a build, per birth."""
    domain = domains.PlanarArm()
    wide = domains.PlanarArm(1952)
    print("processor time of the driver, microseconds:")
    for label, arm, births in (("arm, 10 joints", domain, 10_000), ("1952 parameters", wide, 3000)):
        for batch in (64, 1024):
            config = BuildConfig("arm", (20, 20), arm.bounds, evaluations=births, batch=batch)
            costs = []
            for _ in range(options.repeats):
                with tempfile.TemporaryDirectory() as folder, Threads(1) as threads:
                    began = time.thread_time()
                    build(config, folder, threads, domain=arm)
                    costs.append(1e6 * (time.thread_time() - began) / births)
            print(f"  a birth, {label}, batch {batch}: {_range(costs)}")
    scattered = Scattered()
    rows = scattered.sample(500, seed=0)
    for spec in ("processes:1", "ray") if importlib.util.find_spec("ray") else ("processes:1",):
        with execution.make(spec) as executor:
            executor.evaluate(scattered, rows)
            costs = []
            pieces: list[int] = []
            for _ in range(options.repeats):
                pieces.clear()
                began = time.process_time()
                executor.evaluate(scattered, rows, pieces.append)
                costs.append(1e6 * (time.process_time() - began) / len(pieces))
        print(f"  a piece sent and received, {spec}: {_range(costs)}")


def disk() -> None:
    """The shipped archive: bytes, commit, counting and adding."""
    archive = nc.load("fetch-pick-and-place")
    folder, meta = archive.folder, archive.meta
    births = sum((folder / part["file"]).stat().st_size for part in meta.parts)
    elites = (folder / meta.elites["file"]).stat().st_size
    print(f"shipped archive of {meta.births} births:")
    print(f"  births on disk:          {births / meta.births:.1f} bytes each")
    print(f"  elites on disk:          {elites / 1e6:.2f} MB for {len(archive.elites)}")
    state, rows = read.read_state(folder, meta), read.read_births(folder, meta)
    with tempfile.TemporaryDirectory() as other:
        writer = write.Writer(Path(other), meta.config, meta.facts)
        writer.append(rows)
        print(f"  a commit:                {1e3 * _best(lambda: writer.commit(state)):.0f} ms")
    counting, counts = _best(lambda: nc.load(folder).counts), archive.counts
    print(f"  births to counts:        {1e6 * counting / meta.births:.2f} microseconds each")
    print(f"  counts + counts:         {1e3 * _best(lambda: counts + counts):.2f} ms")


def _range(values: list[float], digits: int = 1) -> str:
    return f"{statistics.median(values):.{digits}f} ({min(values):.{digits}f} to {max(values):.{digits}f})"


def _best(call: Callable[[], object]) -> float:
    times = []
    for _ in range(5):
        began = time.perf_counter()
        call()
        times.append(time.perf_counter() - began)
    return min(times)


if __name__ == "__main__":
    main()
