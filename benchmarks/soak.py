"""Whether memory stays flat over a million births, and the last is as cheap as the first.

    python benchmarks/soak.py [--births 1000000] [--grid 100x100] [--batch 64] [--folder PATH]

Builds on the planar arm, whose evaluation is next to nothing, so what is measured is nichechain.
Times are of the processor, so that other work on the machine does not show. Prints time per birth
in each tenth, the largest memory, the share of time that commits take, and the size of the folder.

Memory is what the process holds, and of it what is its own: the rest are files of the libraries,
which pyribs loads whether they are used or not (PyTorch, Numba, scikit-learn).
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from nichechain.archive import read, write
from nichechain.archive.building import BuildProgress, build
from nichechain.domains import PlanarArm
from nichechain.execution import Threads
from nichechain.niches import parse_shape
from nichechain.search.config import BuildConfig


class Meter:
    """Time and memory by births."""

    def __init__(self, births: int) -> None:
        self.births = births
        self.marks = [(0, time.process_time(), time.perf_counter(), *memory())]
        self.committing = 0.0
        self.commits = 0
        commit = write.Writer.commit

        def timed(writer: write.Writer, state: object) -> None:
            began = time.perf_counter()
            commit(writer, state)  # type: ignore[arg-type]
            self.committing += time.perf_counter() - began
            self.commits += 1

        write.Writer.commit = timed  # type: ignore[method-assign]

    def __call__(self, progress: BuildProgress) -> None:
        """Take the time whenever a tenth is done."""
        if progress.births >= len(self.marks) * self.births / 10:
            self.marks.append((progress.births, time.process_time(), time.perf_counter(), *memory()))


def memory() -> tuple[float, float]:
    """Memory of this process now, and how much of it is no file's, in MB."""
    lines = Path("/proc/self/status").read_text().splitlines()
    sizes = {
        name: rest.split()[0] for name, _, rest in (line.partition(":") for line in lines) if rest.strip()
    }
    return int(sizes["VmRSS"]) / 1e3, int(sizes["RssAnon"]) / 1e3


def main() -> None:
    """Build, and print."""
    options = argparse.ArgumentParser()
    options.add_argument("--births", type=int, default=1_000_000)
    options.add_argument("--grid", default="100x100")
    options.add_argument("--batch", type=int, default=64)
    options.add_argument("--folder", type=Path)
    given = options.parse_args()
    arm = PlanarArm()
    config = BuildConfig(
        "arm",
        parse_shape(given.grid),
        arm.bounds,
        evaluations=given.births,
        batch=given.batch,
        mutation="gaussian",
        scale=0.3,
    )
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.folder or Path(scratch) / "soak"
        # What is loaded once is no part of the first tenth.
        with Threads(1) as executor:
            build(BuildConfig("arm", (2, 2), arm.bounds, evaluations=500), Path(scratch) / "warm", executor)
            meter = Meter(given.births)
            build(config, folder, executor, domain=arm, on_progress=meter)
        report(meter, folder)


def report(meter: Meter, folder: Path) -> None:
    """Print the figures."""
    births, processor, wall, held, own = np.array(meter.marks).T
    each = np.diff(processor) / np.diff(births) * 1e6
    print("tenth   µs of processor per birth   memory (MB)   its own (MB)")
    for tenth, row in enumerate(zip(each, held[1:], own[1:], strict=True), 1):
        print("{:5d}   {:25.1f}   {:11.0f}   {:12.0f}".format(tenth, *row))
    meta = read.read_meta(folder)
    filled = len(read.read_state(folder, meta).elites)
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    began = time.perf_counter()
    rows = read.read_births(folder, meta)
    reading = time.perf_counter() - began
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    beside = size - sum(path.stat().st_size for path in folder.glob("elites-*"))
    seconds, busy = wall[-1] - wall[0], processor[-1] - processor[0]
    figures = {
        "births": f"{len(rows)} in {seconds:.0f} s, {busy:.0f} s of processor",
        "states with an elite": f"{filled}",
        "last tenth / first": f"{each[-1] / each[0]:.2f}",
        "largest memory": f"{largest:.0f} MB, {held[0]:.0f} MB of it before the first birth",
        "commits": f"{meter.commits}, {100 * meter.committing / seconds:.2f} % of the time",
        "folder": f"{size / 1e6:.1f} MB, {beside / len(rows):.1f} bytes per birth beside elites",
        "reading all births": f"{reading:.1f} s",
    }
    for name, text in figures.items():
        print(f"{name:22s} {text}")


if __name__ == "__main__":
    main()
