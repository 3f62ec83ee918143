"""Whether the genotypes that a direct search keeps are more evolvable than those of a plain search.

    python benchmarks/direct_search.py [--out direct] [--seeds 10] [--tasks arm-fine,arm-coarse,cosinus]
    python benchmarks/direct_search.py --report --out direct

Every task is searched by each kind of search with the same seeds and as many births in all. Real lineages
without selection then begin at elites of niches that all searches of a seed have filled, the same niches for
each, and the niches that they reach are counted. ``measured.csv`` has one row for each search, what is there
already is not done again, and ``report.md`` compares the kinds, paired by seed.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import nichechain as nc
from nichechain.archive.archive import Archive
from nichechain.core.intervals import mean_interval
from nichechain.core.randomness import Purpose, keyed
from nichechain.validation.rollouts import run_lineages

BIRTHS = 20_000
NICHES, LINEAGES, GENERATIONS = 60, 30, 5

_SQUARE = ((-1.0, 1.0), (-1.0, 1.0))
TASKS: dict[str, dict[str, Any]] = {
    "arm-fine": {"domain": "arm", "shape": (20, 20), "bounds": _SQUARE, "scale": 0.02},
    "arm-coarse": {"domain": "arm", "shape": (20, 20), "bounds": _SQUARE, "scale": 0.1},
    "cosinus": {"domain": "cosinus", "shape": (100,), "bounds": ((-5.0, 5.0),), "scale": 0.1},
}
_DIRECT = {"objective": "l-evolvability", "replacement": "objective"}
SEARCHES: dict[str, dict[str, Any]] = {
    "plain": {},
    "direct, 10 offspring": {**_DIRECT, "offspring": 10},
    "direct, 30 offspring": {**_DIRECT, "offspring": 30},
    "direct, 10 offspring, l = 5": {**_DIRECT, "offspring": 10, "objective_l": 5},
}
MEASURES = {
    "children": f"niches that {LINEAGES} children of an elite reach",
    "lineages": f"niches that {LINEAGES} lineages of {GENERATIONS} generations reach",
    "filled": "niches filled",
}


@dataclass(frozen=True)
class Measured:
    """One search: niches filled, and the mean over elites of what their children and lineages reach."""

    task: str
    search: str
    seed: int
    filled: int
    judged: int
    niches: int
    children: float
    lineages: float


def measure(task: str, seed: int) -> list[Measured]:
    """All searches of a task by one seed."""
    with tempfile.TemporaryDirectory() as folder, nc.Threads(1) as executor:
        archives = {
            name: nc.build(
                nc.BuildConfig(**TASKS[task], evaluations=BIRTHS, seed=seed, **options),
                Path(folder) / str(number),
                executor,
                on_progress=lambda _: None,
            )
            for number, (name, options) in enumerate(SEARCHES.items())
        }
        held = [set(_niches(archive)) for archive in archives.values()]
        common = np.array(sorted(set.intersection(*held)))
        rng = keyed(seed, Purpose.CHECKED)
        roots = np.sort(rng.choice(common, min(NICHES, common.size), replace=False))
        found = []
        for name, archive in archives.items():
            # A seed of their own: noise of the search must not come again.
            lineages = run_lineages(
                archive, roots, executor, l=GENERATIONS, lineages=LINEAGES, offspring=1, seed=1000 + seed
            )
            reached = lineages.reached(len(archive.niches)).mean(axis=0)
            judged = int((archive.elites.key >= 0.0).sum()) if "objective" in SEARCHES[name] else 0
            found.append(
                Measured(task, name, seed, archive.filled, judged, roots.size, reached[0], reached[-1])
            )
    return found


def _niches(archive: Archive) -> list[int]:
    niche = archive.elites.niche
    held: list[int] = niche[niche < len(archive.niches)].tolist()
    return held


def compare(rows: pd.DataFrame) -> pd.DataFrame:
    """Means of each kind of search, and its ratio to the plain one with a 95 % interval over seeds."""
    found = []
    for task, of_task in rows.groupby("task", sort=False):
        for measure_ in MEASURES:
            table = of_task.pivot_table(index="seed", columns="search", values=measure_)
            for name in SEARCHES:
                # Of logarithms, so that the ratio of the one to the other is the inverse of the other's.
                mean, low, high = np.exp(mean_interval(np.log(table[name] / table["plain"])))
                found.append(
                    {
                        "task": task,
                        "measure": measure_,
                        "search": name,
                        "mean": table[name].mean(),
                        "ratio": float(mean),
                        "low": float(low),
                        "high": float(high),
                        "seeds": len(table),
                    }
                )
    return pd.DataFrame(found)


def report(rows: pd.DataFrame, command: str) -> str:
    """The comparison as Markdown."""
    table = compare(rows)
    lines = ["# Direct search for evolvability, checked by real lineages", ""]
    lines += [
        f"Searches of {BIRTHS:,} births each, the births that judge among them. Lineages begin at the elites",
        f"of up to {NICHES} niches that all searches of a seed have filled. Means over seeds, and the",
        "geometric mean of the ratio to the plain search of the same seed, with a 95 % t-interval. The plain",
        "search keeps a random birth of each niche.",
    ]
    for task, of_task in table.groupby("task", sort=False):
        seeds = int(of_task["seeds"].iloc[0])
        lines += ["", f"## {task}", "", f"{_said(TASKS[str(task)])}; {seeds} seeds.", ""]
        lines += ["| search | " + " | ".join(MEASURES.values()) + " |", "|---|" + "---|" * len(MEASURES)]
        for name in SEARCHES:
            cells = []
            for measure_ in MEASURES:
                row = of_task[(of_task["search"] == name) & (of_task["measure"] == measure_)].iloc[0]
                ratio = f": {row['ratio']:.3f} ({row['low']:.3f} to {row['high']:.3f})"
                cells.append(f"{row['mean']:.2f}" + ("" if name == "plain" else ratio))
            lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join([*lines, "", f"By `{command}`.", ""])


def _said(options: dict[str, Any]) -> str:
    shape = " × ".join(map(str, options["shape"]))
    return f"`{options['domain']}`, {shape} niches, mutation of scale {options['scale']:g}"


def main() -> None:
    """Measure what is not there yet, then write the report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("direct"))
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--tasks", default=",".join(TASKS))
    parser.add_argument("--report", action="store_true", help="only write the report again")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "measured.csv"
    rows = pd.read_csv(path) if path.exists() else pd.DataFrame(columns=[f.name for f in fields(Measured)])
    for seed in range(0 if options.report else options.seeds):
        for task in options.tasks.split(","):
            if not ((rows["task"] == task) & (rows["seed"] == seed)).any():
                new = pd.DataFrame([asdict(one) for one in measure(task, seed)])
                rows = new if rows.empty else pd.concat([rows, new], ignore_index=True)
                rows.to_csv(path, index=False)
                print(task, seed, flush=True)
    command = f"python benchmarks/direct_search.py --seeds {rows['seed'].nunique()} --out {options.out.name}"
    (options.out / "report.md").write_text(report(rows, command))
    compare(rows).to_json(options.out / "statistics.json", orient="records", indent=1)


if __name__ == "__main__":
    main()
