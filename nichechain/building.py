"""From a configuration to an archive folder, resumable at any instant."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa

from nichechain import domains, store, variation
from nichechain.config import BuildConfig
from nichechain.domains.base import Domain
from nichechain.errors import ArchiveError
from nichechain.execution import Executor
from nichechain.illumination import MapElites
from nichechain.niches import GridNiches

CHECKPOINT_SECONDS = 30.0


@dataclass(frozen=True)
class Progress:
    """How far a build is.

    Parameters
    ----------
    births : int
        Evaluated so far, those of the batch under way among them.
    filled : int
        Niches with an elite.
    outside, failed : int
        Births out of bounds, and births whose evaluation failed.
    """

    births: int
    filled: int
    outside: int
    failed: int


def build(
    config: BuildConfig,
    folder: str | Path,
    executor: Executor,
    *,
    domain: Domain | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> None:
    """Fill an archive folder, going on from what it holds.

    Commits every half minute, at the end, and when interrupted. What it leaves behind depends on
    the configuration alone: not on interruptions, nor on the executor.

    Parameters
    ----------
    config : BuildConfig
        If the folder holds an archive, its configuration; only ``evaluations`` may be larger.
    folder : path
    executor : Executor
    domain : Domain, optional
        By default the one that the configuration names.
    on_progress : callable, optional

    Raises
    ------
    ArchiveError
        If the folder holds an archive of another configuration or larger budget, is damaged, or
        is being written.
    NichechainError
        If the domain is unknown or no initial birth can be a parent.
    """
    folder = Path(folder)
    niches = GridNiches(config.shape, config.bounds, config.outside)
    domain = domain or domains.make(config.domain, seed=config.domain_seed)
    mutate = variation.make(config.mutation, config.scale)
    with store.writing(folder):
        state = None
        outside = failed = 0
        if store.is_archive(folder):
            meta = store.read_meta(folder)
            if meta.origin is not None:
                raise ArchiveError(f"{folder} was {meta.origin['kind']}, so no build can go on with it")
            _check_continues(meta.config, config, meta.births, folder)
            state = store.read_state(folder, meta)
            rows = store.read_births(folder, meta)
            outside = _count(rows, len(niches))
            failed = rows["failed"].length() - rows["failed"].null_count
        search = MapElites(domain, niches, mutate, config, state)
        writer = store.Writer(folder, config, store.DomainFacts.of(domain))

        under_way = 0

        def tell(done: int = 0) -> None:
            nonlocal under_way
            under_way += done
            if on_progress is not None:
                on_progress(Progress(search.births + under_way, search.filled, outside, failed))

        last_commit = time.monotonic()
        tell()
        try:
            while search.births < config.evaluations:
                rows = search.advance(executor, config.evaluations - search.births, tell)
                under_way = 0
                writer.append(rows)
                outside += _count(rows, len(niches))
                failed += rows["failed"].length() - rows["failed"].null_count
                tell()
                if time.monotonic() - last_commit > CHECKPOINT_SECONDS:
                    writer.commit(search.state)
                    last_commit = time.monotonic()
        finally:
            # An interrupt between two halves of a step leaves nothing to commit; the last commit
            # is at most half a minute old.
            if search.settled and search.births == writer.births > 0:
                writer.commit(search.state)


def _count(rows: pa.Table, state: int) -> int:
    return int(np.count_nonzero(rows["child_niche"].to_numpy() == state))


def _check_continues(old: BuildConfig, new: BuildConfig, births: int, folder: Path) -> None:
    if new.evaluations < births:
        raise ArchiveError(f"{folder} has {births} births already, more than the {new.evaluations} asked for")
    if replace(old, evaluations=new.evaluations) != new:
        names = [k for k, v in old.to_json().items() if v != new.to_json()[k] and k != "evaluations"]
        changes = ", ".join(f"{k} = {getattr(old, k)}" for k in names)
        raise ArchiveError(f"{folder} was begun with {changes}: go on with that, or build elsewhere")
