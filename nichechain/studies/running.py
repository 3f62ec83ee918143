"""Run a study into a folder: checkpoints after every step, and goes on to the same bits.

What the folder holds depends neither on interruptions nor on workers, and more runs can be added later.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.core.errors import ArchiveError
from nichechain.core.files import ARCHIVE_MARK, as_path, keep_apart, writing
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Domain
from nichechain.execution import Executor
from nichechain.niches import GridNiches
from nichechain.studies.checkpoint import (
    Walked,
    read_checkpoint,
    remove_checkpoint,
    under_way,
    write_checkpoint,
)
from nichechain.studies.conditions import Condition
from nichechain.studies.folder import (
    Block,
    blocks_named,
    finished_blocks,
    read_study,
    remove_leftovers,
    write_block,
    write_study,
)
from nichechain.studies.initialisation import initialise
from nichechain.studies.stored import check_continues, is_study
from nichechain.studies.study import Study
from nichechain.walks import Walks, run_seed

BLOCK = 10
"""Runs that advance together; results do not depend on it."""

# A step of a fast domain takes milliseconds, far less than making it durable.
_CHECKPOINT_SECONDS = 1.0


def run(
    study: Study,
    folder: str | Path,
    executor: Executor,
    *,
    domain: Domain | None = None,
    on_progress: Callable[[int], None] | None = None,
) -> None:
    """Walk all that is still to walk of a study.

    Parameters
    ----------
    study : Study
        If the folder holds a study, that one; only ``runs`` may be larger.
    folder : path
    executor : Executor
    domain : Domain, optional
        By default the one that the study names.
    on_progress : callable, optional
        Told how many of ``study.evaluations`` are made so far.

    Raises
    ------
    ArchiveError
        If the folder holds another study or an archive, is damaged, or is being written.
    NichechainError
        If the domain is unknown or a start fails to evaluate.
    """
    folder = as_path("folder", folder)
    domain = domain or study.make_domain()
    with writing(folder):
        keep_apart(folder, ARCHIVE_MARK)
        if is_study(folder):
            _check_extends(read_study(folder), study, folder)
        write_study(folder, study, domain.unit)
        finished = finished_blocks(folder, study)
        done = sum(block.evaluations(study.steps) for block in finished)
        _tell(on_progress, done)
        for block in _blocks_to_walk(folder, study, finished):
            _walk(block, study, domain, folder, executor, lambda n, d=done: _tell(on_progress, d + n))  # type: ignore[misc]
            done += block.evaluations(study.steps)
        remove_checkpoint(folder)
        remove_leftovers(folder)


def _check_extends(old: Study, new: Study, folder: Path) -> None:
    check_continues(old, new, folder)
    shared = [condition.label for condition in new.conditions if condition.archive_scope == "configuration"]
    if new.runs > old.runs and shared:
        raise ArchiveError(
            f"{folder} holds a study of {old.runs} runs, and no run can be added to condition {shared[0]}, "
            "whose runs share a novelty archive"
        )


def _blocks_to_walk(folder: Path, study: Study, finished: list[Block]) -> list[Block]:
    """In an order in which every condition has about as many runs at any time; one under way goes first."""
    begun = under_way(folder)
    made = []
    for place, condition in enumerate(study.conditions):
        walked = {run for block in finished if block.condition == condition for run in block.runs}
        for block in blocks_named([] if begun is None else [begun], condition):
            if block.last < study.runs and walked.isdisjoint(block.runs):
                made.append((-1, place, block))
                walked.update(block.runs)
        together = study.runs if condition.archive_scope == "configuration" else BLOCK
        first = 0
        for run in range(study.runs):
            # Runs in a row: a block's name says which it has.
            if run in walked:
                first = run + 1
            elif run - first + 1 == together or run + 1 == study.runs or run + 1 in walked:
                made.append((first, place, Block(condition, first, run)))
                first = run + 1
    return [block for _, _, block in sorted(made, key=lambda entry: entry[:2])]


def _walk(
    block: Block,
    study: Study,
    domain: Domain,
    folder: Path,
    executor: Executor,
    tell: Callable[[int], None],
) -> None:
    config = block.condition.walk_config(study.seed)
    niches = GridNiches(study.shape, study.bounds)
    walks = Walks(domain, block.condition.mutate(), config, niches)
    at = read_checkpoint(folder, block)
    if at is None:
        starts = start_genotypes(study, block.condition, domain, block.runs)
        state, first = walks.start(block.runs, executor, starts)
        at = Walked(state, (), (first,))
    made = at.made
    tell(made)

    def on_done(more: int) -> None:
        nonlocal made
        made += more
        tell(made)

    saved = time.monotonic()
    try:
        while at.state.step <= study.steps:
            step = walks.advance(at.state, executor, on_done)
            at = Walked(step.state, (*at.records, step.record.table()), (*at.births, step.births))
            made = at.made
            if time.monotonic() - saved >= _CHECKPOINT_SECONDS:
                write_checkpoint(folder, block, at)
                saved = time.monotonic()
    except KeyboardInterrupt:
        write_checkpoint(folder, block, at)
        raise
    write_block(folder, block, births=pa.concat_tables(at.births), records=pa.concat_tables(at.records))


def start_genotypes(study: Study, condition: Condition, domain: Domain, runs: range) -> NDArray[np.float32]:
    """First genotypes of a condition's runs, the same for all conditions of a paired study.

    Returns
    -------
    (R, P) float32 array, or (R, μ, P) for multi-state walks
    """
    seed = study.seed if study.paired else condition.walk_config(study.seed).seed
    rows = [
        initialise(
            domain,
            condition.initialisation,
            condition.width,
            seed=keyed(run_seed(seed, number), Purpose.INITIAL),
        )
        for number in runs
    ]
    return np.concatenate(rows) if condition.states is None else np.stack(rows)


def _tell(on_progress: Callable[[int], None] | None, made: int) -> None:
    if on_progress is not None:
        on_progress(made)
