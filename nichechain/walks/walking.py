"""A walk from its start to its end, and where it may start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_floats, check_at_least, check_choice
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Domain
from nichechain.execution import Executor
from nichechain.niches import Niches
from nichechain.variation import Mutation
from nichechain.walks.advance import Walks, run_numbers
from nichechain.walks.config import WalkConfig, run_seed
from nichechain.walks.state import StepRecord, WalkState, record_table


@dataclass(frozen=True)
class WalkResult:
    """Walks of T steps.

    Parameters
    ----------
    state : WalkState
        After T + 1 calls of :meth:`Walks.advance`, the last of which measured state T.
    records : tuple of StepRecord
        One for each of the T + 1 states.
    births : pyarrow.Table
        Every evaluated genotype.
    """

    state: WalkState
    records: tuple[StepRecord, ...]
    births: pa.Table

    def series(self, measure: str) -> NDArray[np.float64]:
        """A measure of :class:`StepRecord` over the steps, (T + 1, R, ...).

        Raises
        ------
        NichechainError
            If it records no such thing.
        """
        known = [field.name for field in fields(StepRecord)]
        check_choice("measure", measure, known)
        return np.stack([getattr(record, measure) for record in self.records])

    def table(self) -> pa.Table:
        """All records as rows."""
        return record_table(self.records)


def walk(
    domain: Domain,
    mutate: Mutation,
    config: WalkConfig,
    *,
    runs: int | Sequence[int] = 50,
    steps: int = 50,
    niches: Niches | None = None,
    genotypes: ArrayLike | None = None,
    executor: Executor | None = None,
) -> WalkResult:
    """Walk, and measure every state.

    Parameters
    ----------
    domain, mutate, config, niches
        As in :class:`Walks`.
    runs, genotypes, executor
        As in :meth:`Walks.start`.
    steps : int
        T, not negative: T + 1 states, each measured by its offspring.

    Raises
    ------
    NichechainError
        As there, or if ``steps`` is negative.
    """
    check_at_least(0, steps=steps)
    walks = Walks(domain, mutate, config, niches)
    state, first = walks.start(runs, executor, genotypes)
    records, tables = [], [first]
    for _ in range(steps + 1):
        step = walks.advance(state, executor)
        state = step.state
        records.append(step.record)
        tables.append(step.births)
    return WalkResult(state, tuple(records), pa.concat_tables(tables))


def draw_starts(genotypes: ArrayLike, config: WalkConfig, runs: int | Sequence[int]) -> NDArray[np.float32]:
    """First states drawn from given genotypes, such as an archive's elites.

    Parameters
    ----------
    genotypes : (K, P) array
        Each is drawn with equal probability, and may be drawn again.
    config : WalkConfig
    runs : int or sequence of int
        How many, or their numbers within the configuration.

    Returns
    -------
    (R, P) float32 array, or (R, μ, P) for a multi-state walk

    Raises
    ------
    NichechainError
        If there is no genotype or no run.
    """
    among = as_floats("genotypes", genotypes).astype(np.float32)
    if among.ndim != 2 or not len(among):
        raise NichechainError(f"genotypes have shape {among.shape}, but must be (K, P) with K at least 1")
    shape = () if config.states is None else (config.states,)
    seeds = [run_seed(config.seed, number) for number in run_numbers(runs).tolist()]
    rows = [keyed(seed, Purpose.INITIAL).integers(len(among), size=shape) for seed in seeds]
    return among[np.stack(rows)]
