"""Archives of several runs of one search as one archive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from nichechain.archive import read, write
from nichechain.births.table import NONE
from nichechain.core.checks import as_tuple, shown
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.core.files import as_path, writing
from nichechain.niches import Niches
from nichechain.search.config import BuildConfig
from nichechain.search.elites import Elites, SearchState

# What archives must have in common: what T is about, and what makes a birth an elite.
_SHARED = (
    "domain",
    "domain_seed",
    "domain_options",
    "niches",
    "niches_seed",
    "shape",
    "bounds",
    "outside",
    "epsilon",
    "mutation",
    "scale",
    "df",
    "step_bound",
    "layer_scales",
    "self_adaptive",
    "replacement",
)


def merge(folders: Sequence[str | Path], out: str | Path) -> None:
    """Make one archive of several.

    Births are put one after the other, runs and births numbered on, so that counts add. The elite of
    a niche is the birth with the largest key, as if one search had met them all; the birth
    of the earlier run stays where keys are equal. What was pending and lineages under way are
    dropped: no build goes on with the result.

    Parameters
    ----------
    folders : sequence of paths
        At least two archives of the same domain, niches, mutation and replacement. They may be
        merged themselves, or calibrated.
    out : path
        Where the result goes; it must not hold an archive.

    Raises
    ------
    NichechainError
        If there are fewer than two archives, or they do not belong together.
    ArchiveError
        If a folder is no archive, or ``out`` is one.

    Notes
    -----
    ``meta.origin["runs"]`` has, for every run of the result, its configuration, its number of
    births and the uid of its first: the uid that a birth had in its own run is what lies above. Of a
    run that was calibrated it tells which births that added, by their uids in the run.
    """
    for folder in as_tuple("folders", folders):
        if not isinstance(folder, (str, Path)):
            raise NichechainError(f"folders have {shown(folder)}, but must be folders of archives")
    paths, out = [as_path("folders", folder) for folder in folders], as_path("out", out)
    if len(paths) < 2:
        raise NichechainError(f"{len(paths)} archive cannot be merged: give at least two")
    metas = [read.read_meta(path) for path in paths]
    runs = _runs(paths, metas)
    niches = _niches(paths, metas)
    # Checked before anything is read at length.
    if read.is_archive(out):
        raise ArchiveError(f"{out} already holds an archive: merge into another folder")
    tables: list[pa.Table] = []
    elites: list[Elites] = []
    first_run = first_uid = 0
    for path, meta in zip(paths, metas, strict=True):
        births = read.read_births(path, meta)
        _check_ancestry(path, births)
        tables.append(_renumbered(births, first_run, first_uid))
        own = read.read_state(path, meta).elites
        if elites and own.genotype.shape[1] != elites[0].genotype.shape[1]:
            raise NichechainError(
                f"{paths[0]} has genotypes of {elites[0].genotype.shape[1]} parameters and {path} has "
                f"{own.genotype.shape[1]}, but must have the same"
            )
        elites.append(replace(own, uid=own.uid + first_uid))
        first_run += len(meta.origin["runs"]) if meta.origin is not None else 1
        first_uid += meta.births
    births = pa.concat_tables(tables)
    config = replace(metas[0].config, evaluations=len(births))
    step = max(meta.step for meta in metas)
    state = SearchState.at_rest(Elites.concatenate(elites).winners(), len(births), step)
    with writing(out):
        if read.is_archive(out):
            raise ArchiveError(f"{out} already holds an archive: merge into another folder")
        origin = {"kind": "merged", "runs": runs}
        writer = write.Writer(out, config, metas[0].facts, origin, niches=niches)
        writer.append(births)
        writer.commit(state)


def _runs(paths: list[Path], metas: list[read.Meta]) -> list[dict[str, Any]]:
    """One entry per run of the result, after checking that the archives belong together."""
    runs: list[dict[str, Any]] = []
    for path, meta in zip(paths, metas, strict=True):
        if meta.imported:
            raise NichechainError(
                f"{path} was imported: import both logs as one, with a column of runs, instead"
            )
        for name in _SHARED:
            ours, theirs = getattr(metas[0].config, name), getattr(meta.config, name)
            if ours != theirs:
                raise NichechainError(
                    f"{paths[0]} has {name} {ours} and {path} has {theirs}, but must have the same"
                )
        first = sum(run["births"] for run in runs)
        runs += [{**run, "first_uid": first + run["first_uid"]} for run in _runs_of(meta)]
    check_distinct(paths, metas)
    return runs


def check_distinct(paths: Sequence[Path], metas: Sequence[read.Meta]) -> None:
    """Refuse two archives that hold the same run; of what was imported nothing is known.

    Raises
    ------
    NichechainError
        If the births of a run would count twice.
    """
    seen: list[tuple[Path, dict[str, Any]]] = []
    for path, meta in zip(paths, metas, strict=True):
        own = [] if meta.imported else [run["config"] for run in _runs_of(meta)]
        for config in own:
            for whose, other in seen:
                if _same_search(config, other):
                    raise NichechainError(
                        f"{whose} and {path} both have the run of seed {config['seed']}, "
                        "whose births would count twice"
                    )
        seen += [(path, config) for config in own]


def _runs_of(meta: read.Meta) -> list[dict[str, Any]]:
    """The runs of an archive, of which only one that was merged has several."""
    if meta.origin is not None:
        runs: list[dict[str, Any]] = meta.origin["runs"]
        return runs
    run: dict[str, Any] = {"config": meta.config.to_json(), "births": meta.births, "first_uid": 0}
    if meta.calibrations:
        run["calibrations"] = [asdict(each) for each in meta.calibrations]
    return [run]


def _niches(paths: list[Path], metas: list[read.Meta]) -> Niches:
    """The niches of all archives: those of one seed can still differ, as libraries do."""
    first, *others = (read.read_niches(path, meta) for path, meta in zip(paths, metas, strict=True))
    for path, niches in zip(paths[1:], others, strict=True):
        if niches != first:
            raise NichechainError(f"{paths[0]} and {path} have different centroids, but must have the same")
    return first


def _same_search(first: dict[str, Any], second: dict[str, Any]) -> bool:
    """Whether two configurations differ in nothing but how far they go."""
    # What an earlier version stored lacks the values that came later, and has lists for tuples.
    ours, theirs = BuildConfig.from_json(first), BuildConfig.from_json(second)
    return replace(ours, evaluations=theirs.evaluations) == theirs


def _check_ancestry(path: Path, births: pa.Table) -> None:
    """Refuse numbers given twice and parents that are no earlier births: no search leaves them behind."""
    uid = births["uid"].fill_null(NONE).to_numpy()
    run = births["run"].fill_null(NONE).to_numpy()
    parent = births["parent_uid"].fill_null(NONE).to_numpy()
    if (uid != np.arange(uid.size)).any():
        raise ArchiveError(f"{path} does not number its births from 0, each once: verification says which")
    born = parent != NONE
    if (born & ((parent < 0) | (parent >= uid))).any() or (run[parent[born]] != run[born]).any():
        raise ArchiveError(f"{path} has births whose parents are no earlier births: verification says which")


def _renumbered(births: pa.Table, first_run: int, first_uid: int) -> pa.Table:
    """Births with the numbers of their runs, themselves and their parents moved on."""
    for name, by in (("run", first_run), ("uid", first_uid), ("parent_uid", first_uid)):
        kind = births.schema.field(name)
        moved = pc.add(births[name], pa.scalar(by, kind.type))
        births = births.set_column(births.schema.get_field_index(name), kind, moved)
    return births
