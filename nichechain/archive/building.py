"""From a configuration to an archive folder, resumable at any instant."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.archive import read, write
from nichechain.archive.archive import Archive
from nichechain.archive.filling import BuildProgress, Filling, count
from nichechain.archive.notebook import bar_in_notebook
from nichechain.births.table import NONE
from nichechain.core.errors import ArchiveError
from nichechain.core.files import as_path, writing
from nichechain.domains.base import Domain
from nichechain.execution import Executor
from nichechain.search import savings
from nichechain.search.bounds import FirstLook
from nichechain.search.config import MOST_FAILED, BuildConfig
from nichechain.search.failures import Failures, check_first_batch
from nichechain.search.making import check_niches, make_domain, make_mutation, make_niches
from nichechain.search.map_elites import MapElites
from nichechain.search.selection import Told, retrace
from nichechain.steering import make_contests, make_selection


def build(
    config: BuildConfig,
    folder: str | Path,
    executor: Executor,
    *,
    domain: Domain | None = None,
    on_progress: Callable[[BuildProgress], None] | None = None,
    max_failed: float = MOST_FAILED,
) -> Archive:
    """Fill an archive folder, going on from what it holds.

    Commits every half minute, or less often if that would take more than a hundredth of the time,
    at the end, and when interrupted. What it leaves behind depends on the configuration alone: not
    on interruptions, nor on the executor.

    A birth whose evaluation raises, or that no worker outlives, is recorded as failed with its
    reason, and the build goes on.

    Parameters
    ----------
    config : BuildConfig
        If the folder holds an archive, its configuration; only ``evaluations`` may be larger.
    folder : path
    executor : Executor
    domain : Domain, optional
        By default the one that the configuration names.
    on_progress : callable, optional
        Told how far it is; by default a notebook shows a bar.
    max_failed : float
        Share of births that may fail, from 0 to 1, once there are a hundred.

    Returns
    -------
    Archive
        What the folder then holds.

    Raises
    ------
    ArchiveError
        If the folder holds an archive of another configuration or larger budget, is damaged, or
        is being written, or cannot be written to. The last commit is then whole.
    NichechainError
        If the domain is unknown, all first births fail, no initial birth can be a parent, or more
        births fail than may; what there is by then is committed.
    """
    failures = Failures(max_failed)
    folder = as_path("folder", folder)
    given = domain
    domain = domain or make_domain(config)
    domain, mutate = make_mutation(config, domain)
    # Before there is a folder, so that bad input leaves nothing behind.
    check_niches(config)
    with writing(folder):
        state = None
        outside = 0
        if read.is_archive(folder):
            meta = read.read_meta(folder)
            check_resumable(meta, config, folder)
            niches = read.read_niches(folder, meta)
            state = read.read_state(folder, meta)
            selection, contests = make_selection(config, niches), make_contests(config, niches)
            told = config.selection != "uniform" or contests is not None
            rows = read.read_births(folder, meta, None if told else ["child_niche", "failed"])
            if told:
                retrace(selection, Told.of(rows))
            if contests is not None:
                retrace(contests, Told.of(rows))
                if not contests.agree(state):
                    raise ArchiveError(
                        f"{folder} is damaged: its elites or contenders are not those of its births"
                    )
            outside = count(rows, len(niches))
            failures.count(rows)
            del rows
        else:
            niches = make_niches(config)
            selection, contests = make_selection(config, niches), make_contests(config, niches)
        search = MapElites(domain, niches, mutate, config, state, selection, contests=contests)
        search.savings = savings.read(folder) if state is not None else search.savings
        writer = write.Writer(folder, config, read.DomainFacts.of(domain), niches=niches)

        first_look = FirstLook(len(niches), search.births)

        def look(rows: pa.Table) -> None:
            if len(rows) == search.births:
                check_first_batch(rows, domain, config.seed)
            note = first_look.tell(*_landed(rows), last=search.births >= config.evaluations)
            if note is not None:
                # Of whoever called build(), with Filling between.
                warnings.warn(note, stacklevel=4)

        with bar_in_notebook(config.evaluations) as bar:
            tell = on_progress or bar
            filling = Filling(folder, search, writer, failures, outside, len(niches), tell)
            filling.go(config.evaluations, executor, look)
    return Archive(folder, given)


def _landed(rows: pa.Table) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Behavior and state of some births; NaN, and -1, where they failed."""
    axes = [name for name in rows.column_names if name.startswith("behavior_")]
    behavior = np.stack([rows[name].fill_null(np.nan).to_numpy() for name in axes], axis=1)
    return behavior, rows["child_niche"].fill_null(NONE).to_numpy()


def check_resumable(meta: read.Meta, new: BuildConfig, folder: Path) -> None:
    """Refuse to go on with an archive that no build made, or one of another configuration.

    Raises
    ------
    ArchiveError
        If it was merged, imported or calibrated, or was begun with another configuration or has more births.
    """
    if meta.origin is not None:
        raise ArchiveError(f"{folder} was {meta.origin['kind']}, so no build can go on with it")
    if meta.calibrations:
        raise ArchiveError(
            f"{folder} has {meta.births - meta.built} births of a calibration, so no build can go on "
            "with it: build as far as you want, then calibrate"
        )
    old, births = meta.config, meta.births
    if new.evaluations < births:
        raise ArchiveError(f"{folder} has {births} births already, more than the {new.evaluations} asked for")
    if replace(old, evaluations=new.evaluations) != new:
        names = [k for k, v in old.to_json().items() if v != new.to_json()[k] and k != "evaluations"]
        changes = ", ".join(f"{k} = {getattr(old, k)}" for k in names)
        raise ArchiveError(f"{folder} was begun with {changes}: go on with that, or build elsewhere")
