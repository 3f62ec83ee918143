"""What everything but the rollouts costs: of a build, of threads, of processes and of Ray.

Ratios are taken within one run, round by round, and their median is printed, with the range. All
rounds evaluate the same Fetch genotypes. Wall time is used, so leave the machine alone; where
other work may share it, the share of processor time is printed too. Without Ray installed, its
line is left out.

    python benchmarks/overhead.py [building] [executors] [driver] [feeding] [disk] --repeats 5

Without a name it is all of them. ``feeding`` builds with workers that sleep as long as a Fetch
rollout takes, so that few processors do: on 200 threads, and, each sleeping less, on fewer processes
and on a local Ray cluster of two nodes. It tells what the driver spends on a birth while workers wait
for it (its own cost), and while they do not (sending and receiving).
"""

from __future__ import annotations

import argparse
import importlib.util
import itertools
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
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
from nichechain.variation.unborn import Unborn, litters

LATENCY = 1 / 35
"""Seconds of a Fetch rollout."""
PROCESSORS = 200
"""How many processors sleeping workers stand for."""


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
    """An executor that adds up the time that passes in it: on the wall, of the thread, of the process."""

    def __init__(self, inner: Executor) -> None:
        self._inner = inner
        self.wall = self.thread = self.process = 0.0

    def evaluate(
        self,
        domain: Domain,
        genotypes: NDArray[np.float32] | Unborn,
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        """Evaluate, and note how long it took."""
        wall, thread, process = time.perf_counter(), time.thread_time(), time.process_time()
        evaluation = self._inner.evaluate(domain, genotypes, on_done)
        self.wall += time.perf_counter() - wall
        self.thread += time.thread_time() - thread
        self.process += time.process_time() - process
        return evaluation


class Scattered(PlanarArm):
    """An arm whose every genotype is a message of its own, as long as a Fetch policy."""

    chunk = 1

    def __init__(self) -> None:
        super().__init__(1952)


class Sleeper(Scattered):
    """A domain that takes time, and no processor."""

    def __init__(self, latency: float) -> None:
        super().__init__()
        self.latency = latency

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        """Sleep; behavior is a function of two weights."""
        rows = np.asarray(genotypes)
        time.sleep(self.latency * len(rows))
        behavior = np.tanh(rows[:, :2].astype(np.float64) / 10.0)
        return Evaluation(behavior, behavior[:, 0].copy(), np.zeros(len(rows), bool), ("",) * len(rows))


def main() -> None:
    """Measure what is asked for, or all of it."""
    parts: dict[str, Callable[[argparse.Namespace], None]] = {
        "building": building,
        "executors": executors,
        "driver": driver,
        "feeding": feeding,
        "disk": disk,
    }
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("part", nargs="*", choices=[*parts, []], help="all by default")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--batch", type=int, default=256, help="genotypes of a round")
    parser.add_argument("--births", type=int, default=1000, help="of a measured build")
    parser.add_argument("--sleepers", type=int, default=8, help="processes, and Ray actors, that sleep")
    parser.add_argument("--feeding", type=int, default=38_400, help="births that sleeping workers evaluate")
    options = parser.parse_args()
    cpus = available_cpus()
    load = os.getloadavg()[0]
    print(f"{cpus} processors, load {load:.1f} before we begin, {options.repeats} repeats, medians (range)")
    for name in options.part or parts:
        parts[name](options)


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
    children = litters(variation.cauchy(), Purpose.MUTATION, scattered.sample(125, seed=0), 0, 4)
    for spec in ("processes:1", "ray") if importlib.util.find_spec("ray") else ("processes:1",):
        with execution.make(spec) as executor:
            executor.evaluate(scattered, children)
            costs = []
            pieces: list[int] = []
            for _ in range(options.repeats):
                pieces.clear()
                began = time.process_time()
                executor.evaluate(scattered, children, pieces.append)
                costs.append(1e6 * (time.process_time() - began) / len(pieces))
        print(f"  a piece sent and received, {spec}: {_range(costs)}")


def feeding(options: argparse.Namespace) -> None:
    """What a driver spends on a birth, fed by sleeping workers at the rate of many processors."""
    births, batch = options.feeding, 6400
    print(f"a search of {births} births, its workers as fast as {PROCESSORS} processors at rollouts:")
    specs = [f"threads:{PROCESSORS}", f"processes:{options.sleepers}"]
    if importlib.util.find_spec("ray"):
        specs.append("ray")
    for spec in specs:
        workers = options.sleepers if spec == "ray" else int(spec.partition(":")[2])
        domain = Sleeper(workers / PROCESSORS * LATENCY)
        config = BuildConfig("arm", (20, 20), ((-1, 1), (-1, 1)), evaluations=births, batch=batch)
        own, sending, busy = [], [], []
        with two_nodes(workers) if spec == "ray" else nullcontext(), execution.make(spec) as executor:
            executor.evaluate(domain, domain.sample(64 * workers, seed=0))
            # The first build, of the initial births, loads what pyribs compiles.
            for first in (True, *[False] * options.repeats):
                watch = Stopwatch(executor)
                with tempfile.TemporaryDirectory() as folder:
                    began, used = time.perf_counter(), time.thread_time()
                    build(replace(config, evaluations=300) if first else config, folder, watch, domain=domain)
                    took, used = time.perf_counter() - began, time.thread_time() - used
                if not first:
                    own.append(1e6 * (used - watch.thread) / births)
                    # Threads do their own growing in this process, so of them it is the caller's alone.
                    sending.append(
                        1e6 * (watch.thread if spec.startswith("threads") else watch.process) / births
                    )
                    busy.append(100 * LATENCY * births / (PROCESSORS * took))
        print(f"  {spec}, {workers} workers that sleep {1e3 * domain.latency:.2f} ms a birth:")
        print(f"    the driver's own, a birth:   {_range(own)} microseconds of processor time (target: < 15)")
        print(f"    sending and receiving:       {_range(sending)} microseconds a birth, while workers sleep")
        print(f"    workers asleep:              {_range(busy)} % of the wall time")


@contextmanager
def two_nodes(workers: int) -> Iterator[None]:
    """A Ray cluster of two nodes on this machine, with so many processors in all, as it believes."""
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    import ray
    from ray.cluster_utils import Cluster

    node = {"num_cpus": workers // 2, "object_store_memory": 2**27}
    cluster = Cluster(initialize_head=True, head_node_args={**node, "include_dashboard": False})
    try:
        cluster.add_node(**node)
        ray.init(address=cluster.address, logging_level="ERROR", log_to_driver=False)
        yield
    finally:
        ray.shutdown()
        cluster.shutdown()


def disk(options: argparse.Namespace) -> None:  # noqa: ARG001  # the archive that ships, once
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
