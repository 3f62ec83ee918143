"""From a configuration to an archive folder, resumable at any instant."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.archive import read, write
from nichechain.births.table import NONE
from nichechain.core.errors import ArchiveError
from nichechain.core.files import writing
from nichechain.domains.base import Domain
from nichechain.execution import Executor
from nichechain.search import savings
from nichechain.search.bounds import FirstLook
from nichechain.search.config import MOST_FAILED, BuildConfig
from nichechain.search.failures import Failures, check_first_batch
from nichechain.search.making import make_domain, make_mutation, make_niches
from nichechain.search.map_elites import MapElites
from nichechain.search.parents import CuriosityScores

CHECKPOINT_SECONDS = 30.0
_COMMIT_SHARE = 0.01


@dataclass(frozen=True)
class BuildProgress:
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
    on_progress: Callable[[BuildProgress], None] | None = None,
    max_failed: float = MOST_FAILED,
) -> None:
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
    max_failed : float
        Share of births that may fail, from 0 to 1, once there are a hundred.

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
    folder = Path(folder)
    domain = domain or make_domain(config)
    domain, mutate = make_mutation(config, domain)
    with writing(folder):
        state = scores = None
        outside = 0
        if read.is_archive(folder):
            meta = read.read_meta(folder)
            if meta.origin is not None:
                raise ArchiveError(f"{folder} was {meta.origin['kind']}, so no build can go on with it")
            _check_continues(meta.config, config, meta.births, folder)
            niches = read.read_niches(folder, meta)
            state = read.read_state(folder, meta)
            curious = config.selection == "curiosity"
            rows = read.read_births(folder, meta, None if curious else ["child_niche", "failed"])
            if curious:
                scores = CuriosityScores.of_births(rows)
            outside = _count(rows, len(niches))
            failures.count(rows)
            del rows
        else:
            niches = make_niches(config)
        search = MapElites(domain, niches, mutate, config, state, scores)
        search.savings = savings.read(folder) if state is not None else search.savings
        writer = write.Writer(folder, config, read.DomainFacts.of(domain), niches=niches)

        first_look = FirstLook(len(niches), search.births)
        under_way = 0

        def tell(done: int = 0) -> None:
            nonlocal under_way
            under_way += done
            if on_progress is not None:
                on_progress(BuildProgress(search.births + under_way, search.filled, outside, failures.failed))

        def commit() -> None:
            writer.commit(search.state)
            # Of no consequence where it cannot be written.
            with suppress(OSError):
                savings.write(folder, search.savings)

        last_commit = time.monotonic()
        pause = CHECKPOINT_SECONDS
        tell()
        try:
            while search.births < config.evaluations:
                failures.check(
                    f"{folder} keeps them, and a build with a larger max_failed goes on from there"
                )
                first = search.births == 0
                rows = search.advance(executor, config.evaluations - search.births, tell)
                under_way = 0
                if first:
                    check_first_batch(rows, domain, config.seed)
                writer.append(rows)
                outside += _count(rows, len(niches))
                failures.count(rows)
                note = first_look.tell(*_landed(rows), last=search.births >= config.evaluations)
                if note is not None:
                    warnings.warn(note, stacklevel=2)
                tell()
                if time.monotonic() - last_commit > pause:
                    began = time.monotonic()
                    commit()
                    last_commit = time.monotonic()
                    # Many large genotypes take a while to write.
                    pause = max(CHECKPOINT_SECONDS, (last_commit - began) / _COMMIT_SHARE)
        finally:
            # An interrupt between two halves of a step leaves nothing to commit; the last commit
            # is at most half a minute old.
            if search.settled and search.births == writer.births > 0:
                commit()


def _landed(rows: pa.Table) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Behavior and state of some births; NaN, and -1, where they failed."""
    axes = [name for name in rows.column_names if name.startswith("behavior_")]
    behavior = np.stack([rows[name].fill_null(np.nan).to_numpy() for name in axes], axis=1)
    return behavior, rows["child_niche"].fill_null(NONE).to_numpy()


def _count(rows: pa.Table, state: int) -> int:
    return int(np.count_nonzero(rows["child_niche"].to_numpy() == state))


def _check_continues(old: BuildConfig, new: BuildConfig, births: int, folder: Path) -> None:
    if new.evaluations < births:
        raise ArchiveError(f"{folder} has {births} births already, more than the {new.evaluations} asked for")
    if replace(old, evaluations=new.evaluations) != new:
        names = [k for k, v in old.to_json().items() if v != new.to_json()[k] and k != "evaluations"]
        changes = ", ".join(f"{k} = {getattr(old, k)}" for k in names)
        raise ArchiveError(f"{folder} was begun with {changes}: go on with that, or build elsewhere")
