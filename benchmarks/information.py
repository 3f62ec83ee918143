"""Births that ``--selection information`` saves for an interval of a given width.

Searches by uniform parents and by other selections, paired by seed. At several numbers of births the
90 % interval of 5-evolvability is computed for the niches that both searches of a pair had filled by
the first of these numbers. Births needed for the width that the selection ends with are interpolated in
logarithms along the course of the uniform search.

    python benchmarks/information.py [--tasks arm cosinus] [--seeds 5] [--selections information]

Printed are ratios of births, selection over uniform, below 1 where it saves some, with 95 % t-intervals
over seeds: for the mean width over niches, and for the width of the mean over niches, which is what the
selection narrows.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from scipy import stats
from truth_models import coverage

import nichechain as nc
from nichechain.evolvability.question import Question, dense

DRAWS = 100
AT = (1000, 2000, 4000, 8000)
TASKS = {
    "arm": ((20, 20), ((-1.0, 1.0), (-1.0, 1.0)), 0.1),
    "arm-fine": ((20, 20), ((-1.0, 1.0), (-1.0, 1.0)), 0.02),
    "cosinus": ((400,), ((-5.0, 5.0),), 0.05),
}


def main() -> None:
    """Print a line for every task and selection."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", nargs="+", default=list(TASKS), choices=list(TASKS))
    parser.add_argument("--selections", nargs="+", default=["information"])
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--temperature", type=float, help="by default that of the package")
    given = parser.parse_args()
    print("task       selection       births for the mean width   for the width of the mean")
    for task in given.tasks:
        for selection in given.selections:
            found = []
            for seed in range(given.seeds):
                one = _births(task, "uniform", seed, None)
                other = _births(task, selection, seed, given.temperature)
                niches = np.intersect1d(*(_filled(births) for births in (one, other)))
                found.append(_saved(_widths(one, task, niches), _widths(other, task, niches)))
            print(f"{task:10} {selection:15} {_interval(found, 0):27} {_interval(found, 1)}", flush=True)


def _births(task: str, selection: str, seed: int, temperature: float | None):
    shape, bounds, scale = TASKS[task]
    config = nc.BuildConfig(
        "arm" if task.startswith("arm") else task,
        shape,
        bounds,
        evaluations=AT[-1],
        scale=scale,
        seed=seed,
        selection=selection,
        temperature=temperature,
        lineage_share=0.0,
    )
    with tempfile.TemporaryDirectory() as folder, nc.Threads(1) as threads:
        return nc.build(config, Path(folder) / "a", threads).births()


def _filled(births) -> np.ndarray:
    niche = births["child_niche"].to_numpy()[: AT[0]]
    return np.unique(niche[niche >= 0])


def _widths(births, task: str, niches: np.ndarray) -> np.ndarray:
    """Mean width over niches, and width of the mean, at each number of births, (2, N)."""
    shape, bounds, _ = TASKS[task]
    grid = nc.GridNiches(shape, bounds)
    niches = niches[niches < len(grid)]
    found = []
    for number in AT:
        some = births.iloc[:number]
        chain = nc.estimate(nc.TransitionCounts.from_births(some, grid))
        values = []
        for drawn in Question(l=5, lineages=100, draws=DRAWS).samples(chain):
            rows = dense(drawn.children(niches))
            values.append(coverage(dense(drawn.onward), rows, 5, 100, len(grid))[:, -1])
        each = np.quantile(values, (0.05, 0.95), axis=0, method="weibull")
        whole = np.quantile(np.mean(values, axis=1), (0.05, 0.95), method="weibull")
        found.append((np.ptp(each, axis=0).mean(), np.ptp(whole)))
    return np.array(found).T


def _saved(uniform: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Births over those of the uniform search at the same width, (2,)."""
    saved = []
    for course, reached in zip(np.log(uniform), np.log(other[:, -1]), strict=True):
        # The slope of the whole course says how much a birth narrows; it goes through the last point.
        slope = np.polyfit(np.log(AT), course, 1)[0]
        saved.append(float(np.exp((course[-1] - reached) / slope)))
    return np.array(saved)


def _interval(found: list[np.ndarray], column: int) -> str:
    logs = np.log([pair[column] for pair in found])
    middle = logs.mean()
    half = stats.t.ppf(0.975, logs.size - 1) * logs.std(ddof=1) / np.sqrt(logs.size)
    low, high = np.exp([middle - half, middle + half])
    return f"{np.exp(middle):.2f} ({low:.2f} to {high:.2f})"


if __name__ == "__main__":
    main()
