"""Archives, and what lineages of their elites really did: the data sets of ``benchmarks/truth.py``.

A data set is a folder with

- ``archive/``: a plain MAP-Elites build of 40,000 births;
- ``truth-A.npz``: U lineages without selection of 10 generations from each of 100 elites, one out
  of each of 100 equal groups of filled niches, ordered by the births of their row of T. Split B
  holds other elites of the same groups;
- ``broods.parquet``: 4,000 births of lineages without selection that a search could have spent
  itself, ten of each elite and ten generations long. They begin at elites as they were at
  instants drawn uniformly over the search.

Everything is a function of the table below, and is made once; what is there is kept.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

import nichechain
from nichechain.archive import read
from nichechain.births import NONE
from nichechain.core.randomness import Purpose, keyed
from nichechain.execution import Executor
from nichechain.validation import Lineages, run_lineages
from nichechain.verification.replay import replayed

BIRTHS, ELITES, GENERATIONS, OFFSPRING = 40_000, 100, 10, 30
BROODS, BROOD = 40, 10
FIRST_UID = 1_000_000
"""Births of lineages are numbered from here on, beyond those of any build of the table."""
_SEEDS = {"A": 10_001, "B": 10_002, "strata": 30_001, "broods": 20_003}
_BLOCK = {100: 20, 20: 10}
_ROOM = BROOD << 4
"""Numbers that the births of a brood have to themselves."""

_SQUARE = ((-1.0, 1.0), (-1.0, 1.0))
_TABLE_TOP = ((1.05, 1.55), (0.40, 1.10))
_LINE = ((-5.0, 5.0),)
_POLICY = {"descriptor": "final-observation:0,1", "controller": "mlp:16,16", "observations": "observation"}


@dataclass(frozen=True)
class DataSet:
    """One archive and its truth.

    Parameters
    ----------
    domain, shape, bounds, options
        As in :class:`nichechain.BuildConfig`.
    lineages : int
        U.
    development : bool
        Whether estimators were developed on it; the others were looked at once.
    splits : str
        Letters of its sets of elites.
    shipped : str
        Name of an archive that ships with nichechain and need not be built.
    """

    domain: str
    shape: tuple[int, ...]
    bounds: tuple[tuple[float, float], ...]
    lineages: int
    development: bool
    options: Mapping[str, Any] = field(default_factory=dict)
    splits: str = "A"
    shipped: str = ""

    def config(self) -> nichechain.BuildConfig:
        """How its archive is built."""
        return nichechain.BuildConfig(
            domain=self.domain,
            shape=self.shape,
            bounds=self.bounds,
            evaluations=BIRTHS,
            lineage_share=0.0,
            **self.options,
        )


def _arm(shape: tuple[int, ...], development: bool, **options: Any) -> DataSet:
    return DataSet("arm", shape, _SQUARE, 100, development, options)


def _map(name: str, bins: int, development: bool, **options: Any) -> DataSet:
    return DataSet(name, (bins,), _LINE, 100, development, options)


def _maze(name: str, half: float, steps: int, development: bool, **options: Any) -> DataSet:
    bounds = f"{-half:g},{half:g},{-half:g},{half:g}"
    options["domain_options"] = {**_POLICY, "steps": steps, "bounds": bounds}
    return DataSet(f"gym:{name}", (20, 20), ((-half, half),) * 2, 20, development, options)


def _fetch(development: bool, *, splits: str = "A", shipped: str = "", **options: Any) -> DataSet:
    return DataSet("fetch", (20, 20), _TABLE_TOP, 20, development, options, splits, shipped)


DATASETS: dict[str, DataSet] = {
    "arm-0.1": _arm((20, 20), True, scale=0.1),
    "arm-0.02": _arm((20, 20), True, scale=0.02),
    "cosinus": _map("cosinus", 120, True, mutation="gaussian", scale=0.2),
    "umaze": _maze("PointMaze_UMaze-v3", 1.5, 100, True, scale=0.1),
    "fetch-1": _fetch(True, scale=1.0, splits="A", shipped="fetch-pick-and-place"),
    "fetch-0.1": _fetch(True, scale=0.1),
    "arm-0.1-30x30": _arm((30, 30), False, scale=0.1, seed=1),
    "arm-0.05-20joints": _arm((20, 20), False, scale=0.05, seed=2, domain_options={"joints": 20}),
    "linear": _map("linear", 120, False, mutation="gaussian", scale=0.2, seed=1),
    "cosinus-cauchy": _map("cosinus", 200, False, scale=0.05, seed=2),
    "medium-maze": _maze("PointMaze_Medium-v3", 3.0, 150, False, scale=0.3, seed=1, domain_seed=1),
    "fetch-1-seed1": _fetch(False, scale=1.0, seed=1, domain_seed=1),
}
"""Cheap ones first among those for development, and among those held out."""


@dataclass(frozen=True)
class Truth:
    """What an estimator is given, and what it is judged by.

    Parameters
    ----------
    births : pyarrow.Table
        Of the plain build, in order.
    niches : Niches
    extra : pyarrow.Table, optional
        Births of lineages without selection, in the same columns, and ``births_before``.
    uid : (R,) int64 array
        Births that the roots of the lineages are.
    lineages : Lineages
    """

    births: pa.Table
    niches: nichechain.Niches
    extra: pa.Table | None
    uid: np.ndarray
    lineages: Lineages

    def given(self, births: int, share: float) -> pa.Table:
        """What a search of so many births leaves that spends a share of them on lineages."""
        bought = round(share * births)
        table = self.births.slice(0, births - bought)
        if not bought:
            return table
        assert self.extra is not None
        known = self.extra.filter(pa.compute.less_equal(self.extra["births_before"], births - bought))
        if len(known) < bought:
            raise ValueError(f"there are {len(known)} births of lineages, but {bought} are asked for")
        return pa.concat_tables([table, known.slice(0, bought).select(table.column_names)])


def make(name: str, folder: Path, executor: Executor, tell: Callable[[str], None]) -> None:
    """Make what is not there of a data set."""
    data, home = DATASETS[name], folder / name
    home.mkdir(parents=True, exist_ok=True)
    path = home / "archive"
    if data.shipped and not path.exists():
        shutil.copytree(nichechain.load(data.shipped).folder, path)
    if not data.shipped:
        tell(f"{name}: archive")
        nichechain.build(data.config(), path, executor)
    archive = nichechain.load(path)
    for number, split in enumerate(data.splits):
        _make_truth(archive, home / f"truth-{split}.npz", number, data.lineages, executor, tell)
    _make_births(archive, home / "broods.parquet", executor, tell)


def load(name: str, folder: Path, split: str = "A") -> Truth | None:
    """A data set that was made, or None."""
    home = folder / name
    if not (home / f"truth-{split}.npz").exists():
        return None
    archive = nichechain.load(home / "archive")
    births = read.read_births(archive.folder, archive.meta)
    if "lineage" not in births.column_names:
        births = births.append_column("lineage", pa.array(np.zeros(len(births), bool)))
    path = home / "broods.parquet"
    with np.load(home / f"truth-{split}.npz") as kept:
        lineages = Lineages(*(kept[k].astype(np.int64) for k in ("root_niche", "niches", "offspring")))
        uid = kept["root_uid"].astype(np.int64)
    return Truth(births, archive.niches, _extra(path, births) if path.exists() else None, uid, lineages)


def roots_of(archive: nichechain.Archive, split: int) -> np.ndarray:
    """Niches whose elites begin lineages, in random order so that the first few are a fair sample."""
    filled = archive.elites.niche[archive.elites.niche < len(archive.niches)]
    rng = keyed(_SEEDS["strata"], Purpose.CHECKED)
    order = np.lexsort([rng.random(filled.size), archive.counts.births[filled]])
    groups = [rng.permutation(group) for group in np.array_split(filled[order], min(ELITES, filled.size))]
    roots = np.array([group[split] for group in groups if len(group) > split])
    return roots[keyed(_SEEDS["AB"[split]], Purpose.CHECKED).permutation(roots.size)]


def _make_truth(
    archive: nichechain.Archive,
    path: Path,
    split: int,
    lineages: int,
    executor: Executor,
    tell: Callable[[str], None],
) -> None:
    if path.exists():
        return
    roots = roots_of(archive, split)
    part = path.with_suffix(".part.npz")
    states = np.full((roots.size, lineages, GENERATIONS), NONE, np.int32)
    offspring = np.full((roots.size, OFFSPRING), NONE, np.int32)
    done = 0
    if part.exists():
        with np.load(part) as kept:
            done = len(kept["niches"])
            states[:done], offspring[:done] = kept["niches"], kept["offspring"]
    elites = [archive.elite(int(root)) for root in roots]
    while done < roots.size:
        tell(f"{archive.folder.parent.name}: lineages of {done} of {roots.size} elites")
        here = slice(done, min(done + _BLOCK[lineages], roots.size))
        found = run_lineages(
            archive,
            roots[here],
            executor,
            l=GENERATIONS,
            lineages=lineages,
            offspring=OFFSPRING,
            seed=_SEEDS["AB"[split]],
        )
        states[here], offspring[here] = found.states, found.offspring
        done = here.stop
        kept_now = {
            "root_niche": roots[:done],
            "root_uid": np.array([elite.uid for elite in elites[:done]]),
            "root_depth": np.array([elite.depth for elite in elites[:done]]),
            "niches": states[:done],
            "offspring": offspring[:done],
        }
        scratch = path.with_suffix(".tmp.npz")
        np.savez_compressed(scratch, **kept_now)
        scratch.replace(part if done < roots.size else path)
    part.unlink(missing_ok=True)


def _make_births(
    archive: nichechain.Archive, path: Path, executor: Executor, tell: Callable[[str], None]
) -> None:
    if path.exists():
        return
    tell(f"{path.parent.name}: births of lineages")
    seed = _SEEDS["broods"]
    starts = _starts(archive, BROODS, keyed(seed, Purpose.CHECKED))
    uid, niche, depth, when = (np.repeat(some, BROOD) for some in (*starts[:3], starts[4]))
    genotypes = starts[3]
    alive = [(i, genotypes[int(u)], int(u), int(n)) for i, (u, n) in enumerate(zip(uid, niche, strict=True))]
    rows: list[dict[str, Any]] = []
    for generation in range(GENERATIONS):
        if not alive:
            break
        children = [
            archive.mutate(g, keyed(seed, Purpose.LINEAGE, (i << 16) | generation)) for i, g, _, _ in alive
        ]
        evaluation = executor.evaluate(archive.domain, np.stack(children))
        following = []
        for k, ((i, _, parent, here), child) in enumerate(zip(alive, children, strict=True)):
            fine = not evaluation.failed[k]
            landed = int(archive.niches.of(evaluation.behavior[k : k + 1])[0]) if fine else NONE
            number = FIRST_UID + (i << 4) + generation
            rows.append(
                {
                    "lineage": i,
                    "generation": generation + 1,
                    "uid": number,
                    "parent_uid": parent,
                    "parent_niche": here,
                    "child_niche": landed,
                    "depth": int(depth[i]) + generation + 1,
                    "births_before": int(when[i]),
                }
            )
            if fine:
                following.append((i, child, number, landed))
        alive = following
    frame = pd.DataFrame(rows).sort_values(["lineage", "generation"], ignore_index=True)
    scratch = path.with_suffix(".tmp")
    frame.to_parquet(scratch)
    scratch.replace(path)


def _starts(
    archive: nichechain.Archive, number: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[int, np.ndarray], np.ndarray]:
    """Elites as they were over the course of a search: their uids, niches, depths and genotypes."""
    table = read.read_births(archive.folder, archive.meta)
    parent, landed, depth, step = (
        table[name].fill_null(NONE).to_numpy().astype(np.int64)
        for name in ("parent_uid", "child_niche", "depth", "step")
    )
    accepted = table["accepted"].to_numpy()
    config = archive.config
    when = rng.integers(config.initial, archive.meta.births, size=number)
    # Parents of a step are drawn from the elites before it.
    when = np.searchsorted(step, step[when])
    which = rng.random(number)
    uid = np.empty(number, np.int64)
    elite = np.full(archive.niches.states, NONE, np.int64)
    done = 0
    for i in np.argsort(when, kind="stable"):
        for birth in range(done, when[i]):
            if accepted[birth]:
                elite[landed[birth]] = birth
        done = max(done, int(when[i]))
        standing = elite[elite != NONE]
        uid[i] = standing[int(which[i] * standing.size)]
    genotypes = dict(
        replayed(
            np.unique(uid),
            parent,
            roots=lambda: archive.domain.sample(config.initial, seed=keyed(config.seed, Purpose.INITIAL)),
            mutate=archive.mutate,
            seed=config.seed,
        )
    )
    return uid, landed[uid], depth[uid], genotypes, when


def _in_time(kept: pa.Table) -> pa.Table:
    """The same births, numbered in the order in which a search would have spent them."""
    when, brood = (np.array(kept[name]).astype(np.int64) for name in ("births_before", "lineage"))
    brood //= BROOD
    first = np.zeros(brood.max() + 1, np.int64)
    last = FIRST_UID
    for k in np.argsort([when[brood == b][0] for b in range(first.size)], kind="stable"):
        last = max(last + _ROOM, FIRST_UID + _ROOM * int(when[brood == k][0]))
        first[k] = last
    for name in ("uid", "parent_uid"):
        number = np.array(kept[name]).astype(np.int64)
        # Within a brood births stay in their order.
        again = number - FIRST_UID - (brood * BROOD << 4) + first[brood]
        later = pa.array(np.where(number >= FIRST_UID, again, number))
        kept = kept.set_column(kept.column_names.index(name), name, later)
    return kept


def _extra(path: Path, births: pa.Table) -> pa.Table:
    """Births of lineages in the columns of the others; what is not known of them is null."""
    kept = _in_time(pq.read_table(path))
    n = len(kept)
    failed = np.array(kept["child_niche"]) == NONE
    columns = {}
    for column in births.schema:
        if column.name == "child_niche":
            columns[column.name] = pa.array(np.array(kept[column.name]), mask=failed).cast(column.type)
        elif column.name == "lineage":
            columns[column.name] = pa.array(np.array(kept["generation"]) > 1)
        elif column.name in kept.column_names:
            columns[column.name] = kept[column.name].combine_chunks().cast(column.type)
        elif column.name == "failed":
            columns[column.name] = pa.array(np.where(failed, "failed", ""), mask=~failed)
        else:
            plain = {"run": 0, "accepted": False, "step": int(births["step"][-1].as_py()) + 1}
            value = plain.get(column.name)
            columns[column.name] = (
                pa.nulls(n, column.type) if value is None else pa.array([value] * n, column.type)
            )
    return pa.table({**columns, "births_before": kept["births_before"].combine_chunks()})
