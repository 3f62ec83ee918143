"""What the chain costs beside the general Markov libraries, and what it costs as it grows.

    python benchmarks/chain.py [--largest 10000]
    python benchmarks/chain.py --commands FOLDER [--sizes 20,50,100]

Prints, from one run, each figure beside its target:
- Monte Carlo walks against QuantEcon's compiled simulator and deeptime's, where they are installed;
- l-evolvability in closed form, of all niches and of one, on chains of random transitions and on
  chains whose transitions lead to neighbours, with the memory it takes;
- the default estimator: its fit, and what a posterior draw costs beside a sparse T that is given;
- or, with ``--commands``, whole commands from the shell on grids of 400, 2,500 and 10,000 niches: processor
  time, time and memory. Archives of the arm are built in the folder where they are missing.

Times are the best of a few, because other programs slow the rest.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

import nichechain as nc
from nichechain.archive import read
from nichechain.births.table import NONE
from nichechain.evolvability.coverage import expected_coverage, sampled_coverage
from nichechain.evolvability.reach import visit_probability
from nichechain.niches import GridNiches

NONZEROS = 17

# Births on a grid of so many cells along each axis, and the seconds that its commands may take.
BIRTHS = {20: 8_000, 50: 20_000, 100: 1_000_000}
COMMANDS: tuple[tuple[str, dict[int, float]], ...] = (
    ("evolvability {a} --top 5", {20: 2.0, 50: 5.0, 100: 60.0}),
    ("evolvability {a} --niche {middle}", {20: 2.0, 50: 2.0, 100: 6.0}),
    ("evolvability {a} --elite {middle}", {20: 2.0, 50: 5.0, 100: 60.0}),
    ("compare {a} {b}", {20: 20.0, 50: 60.0}),
    ("estimate {a} --stability", {20: 20.0, 50: 60.0}),
    ("sweep {a}", {20: 20.0, 50: 60.0}),
    ("validate {a} --elites 3 --lineages 2 --workers 1 --out {out}", {20: 20.0, 50: 60.0}),
    ("explore {a} --out {out}.html", {20: 10.0, 50: 10.0}),
)


def main() -> None:
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--largest", type=int, default=10_000, help="niches of the largest chain")
    parser.add_argument("--commands", type=Path, help="whole commands, on archives in this folder")
    parser.add_argument("--sizes", default="20,50,100", help="for --commands: cells along each axis")
    options = parser.parse_args()
    if options.commands is not None:
        commands(options.commands, [int(size) for size in options.sizes.split(",")])
        return
    monte_carlo()
    exact(options.largest)
    estimator()
    large_estimate()


def monte_carlo(states: int = 1000, walks: int = 10_000, length: int = 11) -> None:
    """Walks from one state."""
    T = random_chain(states, np.random.default_rng(0))
    first = np.zeros(states)
    first[0] = 1.0
    rng = np.random.default_rng(1)
    ours = best(lambda: sampled_coverage(T, first, length, walks, 1, rng))
    print(f"Monte Carlo, {walks} walks of {length} states, n = {states}:")
    print(f"  nichechain  {milliseconds(ours)}, tables and count of niches included")
    try:
        from quantecon.markov import MarkovChain
    except ImportError:
        print("  QuantEcon   is not installed")
    else:
        chain = MarkovChain(sparse.csr_matrix(T))
        theirs = best(lambda: chain.simulate_indices(length, init=0, num_reps=walks, random_state=1))
        verdict(f"  QuantEcon   {milliseconds(theirs)}", "times ours", theirs / ours, at_least=1.0)
    try:
        from deeptime.markov.msm import MarkovStateModel
    except ImportError:
        print("  deeptime    is not installed")
    else:
        model = MarkovStateModel(T.toarray())
        few = walks // 100

        def simulate() -> None:
            for seed in range(few):
                model.simulate(length, start=0, seed=seed)

        theirs = best(simulate) * walks / few
        verdict(f"  deeptime    {milliseconds(theirs)}", "times ours", theirs / ours, at_least=100.0)


def exact(largest: int, generations: int = 10) -> None:
    """All niches and one, in closed form."""
    print(f"\nexact l-evolvability, l = {generations}, {NONZEROS} nonzeros a row:")
    for states, target in ((400, 0.030), (2500, 1.5), (10_000, 20.0)):
        if states > largest:
            continue
        for name, make in (("random", random_chain), ("local", local_chain)):
            T = make(states, np.random.default_rng(0))
            repeats = 5 if states < 1000 else 1
            every = best(lambda T=T: expected_coverage(T, T, generations, 100), repeats)
            verdict(f"  n = {states:6d}, {name}: all {milliseconds(every)}", "of the target", every / target)
            first = T[[0]].toarray()[0]
            visit_probability(T, first, 2)
            one = best(lambda T=T, first=first: visit_probability(T, first, generations), 3)
            verdict(f"{'':16}{name}: one {milliseconds(one)}", "of a tenth of it", one / (target / 10))
        peak = memory(lambda T=T: expected_coverage(T, T, 2, 100))
        verdict(f"{'':16}memory {peak / 1e6:7.1f} MB", "of 500 MB", peak / 500e6)


def estimator(births: int = 30_000, generations: int = 5) -> None:
    """Fit and one draw, on the shipped archive."""
    archive = nc.load("fetch-pick-and-place")
    table = read.read_births(archive.folder, archive.meta)[:births]
    parent, child, elite = (
        table[name].fill_null(NONE).to_numpy() for name in ("parent_niche", "child_niche", "parent_uid")
    )
    counts = nc.TransitionCounts.from_births(parent, child, archive.niches, elite=elite)
    n = len(archive.niches)
    print(f"\ndefault estimator, n = {n}, {births} births:")
    fit = best(lambda: nc.estimate(counts))
    verdict(f"  fit                      {milliseconds(fit)}", "of 2 s", fit / 2.0)
    posterior = nc.estimate(counts).posterior
    assert posterior is not None
    T = random_chain(n, np.random.default_rng(0))
    given = best(lambda: expected_coverage(T, T, generations, 100))
    print(f"  all niches, a sparse T   {milliseconds(given)}, l = {generations}")
    rng = np.random.default_rng(0)
    draw = posterior.draw(rng)
    applied = best(lambda: expected_coverage(draw, draw, generations, 100, counted=n))
    print(f"  all niches, a draw of T  {milliseconds(applied)}, {draw.nnz / n:.0f} nonzeros a row")
    print(f"  drawing it               {milliseconds(best(lambda: posterior.draw(rng)))}")

    def both() -> None:
        drawn = posterior.draw(rng)
        expected_coverage(drawn, drawn, generations, 100, counted=n)

    verdict(f"  both                     {milliseconds(best(both))}", "of 3 times", best(both) / (3 * given))


def large_estimate(cells: int = 100, births: int = 200_000) -> None:
    """Fit and one draw on a large grid, where every niche has places of its own to lead to."""
    niches = GridNiches((cells, cells), ((0.0, 1.0), (0.0, 1.0)), "clip")
    rng = np.random.default_rng(0)
    n = len(niches)
    elite = rng.integers(n, size=births)
    place = rng.random((n, 2))[elite]
    child = niches.of(np.clip(place + 0.05 * rng.standard_cauchy((births, 2)), 0.0, 1.0))
    own = rng.integers(n, size=(n, 3))[niches.of(place), rng.integers(3, size=births)]
    child = np.where(rng.random(births) < 0.5, own, child)

    def run() -> None:
        counts = nc.TransitionCounts.from_births(niches.of(place), child, niches, elite=elite)
        posterior = nc.estimate(counts).posterior
        assert posterior is not None
        strengths.append(posterior.strength)
        posterior.draw(np.random.default_rng(0))

    strengths: list[float] = []
    print(f"\ndefault estimator, n = {n}, {births} births, fit and one draw:")
    print(f"  {milliseconds(best(run, 1))}; strength {strengths[0]:.3g}")
    peak = memory(run)
    verdict(f"  memory {peak / 1e6:7.1f} MB", "of 1 GB", peak / 1e9)


def commands(folder: Path, sizes: list[int]) -> None:
    """Whole commands from the shell, in a table."""
    print(f"{'niches':>7} {'births':>8}  {'processor':>10} {'time':>9} {'memory':>9}  command")
    for size in sizes:
        a, b = (folder / f"arm-{size}-{seed}" for seed in (1, 2))
        for seed, archive in enumerate((a, b), start=1):
            if not (archive / "meta.json").exists() and (archive == a or size in COMMANDS[3][1]):
                shape = (
                    f"--grid {size}x{size} --evaluations {BIRTHS[size]} --batch {64 if size < 50 else 4096}"
                )
                measured(f"build arm {shape} --scale 0.1 --seed {seed} --workers 1 --out {archive}")
        for line, targets in COMMANDS:
            if size not in targets:
                continue
            middle = f"{size // 2},{size // 2}"
            processor, whole, peak, status = measured(
                line.format(a=a, b=b, middle=middle, out=folder / "out")
            )
            missed = "" if processor <= targets[size] else f"   MISSED {targets[size]:g} s"
            print(
                f"{size * size:7d} {BIRTHS[size]:8d}  {processor:8.1f} s {whole:7.1f} s {peak / 1e6:6.0f} MB"
                f"  {line.format(a='A', b='B', middle=middle, out='OUT')}"
                f"{missed}{'' if status == 0 else f'   STATUS {status}'}",
                flush=True,
            )


def measured(line: str) -> tuple[float, float, float, int]:
    """Processor time and time in seconds, largest memory in bytes, and status of a command."""
    began = time.monotonic()
    command = [sys.executable, "-m", "nichechain", *line.split()]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    whole = time.monotonic() - began
    return used.ru_utime + used.ru_stime, whole, used.ru_maxrss * 1024.0, process.returncode


def random_chain(states: int, rng: np.random.Generator) -> sparse.csr_array:
    """Every state leads to states drawn at random."""
    child = np.stack([rng.choice(states, NONZEROS, replace=False) for _ in range(states)])
    return _chain(child, rng)


def local_chain(states: int, rng: np.random.Generator) -> sparse.csr_array:
    """Every state of a square grid leads to the 17 nearest, on a torus."""
    side = round(states**0.5)
    near = [(x, y) for x in range(-2, 3) for y in range(-2, 3)]
    near = sorted(near, key=lambda step: step[0] ** 2 + step[1] ** 2)[:NONZEROS]
    x, y = np.unravel_index(np.arange(states), (side, side))
    child = np.stack([(x + dx) % side * side + (y + dy) % side for dx, dy in near], axis=1)
    return _chain(child, rng)


def _chain(child: NDArray[np.int64], rng: np.random.Generator) -> sparse.csr_array:
    states = len(child)
    share = rng.dirichlet(np.ones(NONZEROS), states)
    row = np.repeat(np.arange(states), NONZEROS)
    return sparse.csr_array((share.ravel(), (row, child.ravel())), shape=(states, states))


def best(call: Callable[[], object], repeats: int = 7) -> float:
    """Shortest of a few times in seconds, the first call, which may compile, left out if there are more."""
    times = []
    for _ in range(repeats + (repeats > 1)):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return min(times)


def memory(call: Callable[[], object]) -> int:
    """Largest memory that the call held at once, in bytes."""
    tracemalloc.start()
    call()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak


def milliseconds(seconds: float) -> str:
    """A time, right-aligned."""
    return f"{1e3 * seconds:9.2f} ms"


def verdict(figure: str, unit: str, ratio: float, *, at_least: float | None = None) -> None:
    """A figure, its ratio and whether that meets the target; the ratio to a target must be at most 1."""
    met = ratio <= 1.0 if at_least is None else ratio >= at_least
    target = "" if at_least is None else f", target {at_least:g}"
    print(f"{figure}: {ratio:.2f} {unit}{target}{'' if met else '   MISSED'}")


if __name__ == "__main__":
    main()
