"""Births as they come from the device, in blocks of steps, and put together."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.births.acceptance import one_by_one
from nichechain.births.table import NONE, Offspring, make_table
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Evaluation

Ints = NDArray[np.int64]

_NOT_FINITE = "fitness or descriptor is not finite"


@dataclass(frozen=True)
class DeviceBlock:
    """Births of some steps: k steps of n births each.

    Parameters
    ----------
    parent : (k, n) int array
        Births that they come from, ``NONE`` for initial ones.
    cell : (k, n) int array
        Cells of the repertoire that they fall in.
    better : (k, n) bool array
        Who is fitter than the elite of its cell before the step.
    fitness : (k, n) array
    descriptor : (k, n, B) array
    """

    parent: NDArray[Any]
    cell: NDArray[Any]
    better: NDArray[Any]
    fitness: NDArray[Any]
    descriptor: NDArray[Any]

    @classmethod
    def copied(cls, arrays: Any) -> DeviceBlock:
        """Of arrays that a device may use again."""
        return cls(*(np.array(each) for each in arrays))

    def __getitem__(self, steps: slice) -> DeviceBlock:
        """Some of the steps."""
        return DeviceBlock(*(each[steps] for each in vars(self).values()))


@dataclass
class DeviceRun:
    """What has come of one run: its initial births, and blocks by their first step."""

    initial: DeviceBlock
    blocks: dict[int, DeviceBlock] = field(default_factory=dict)

    def table(self, last: DeviceBlock, steps: int, state_of: Any) -> pa.Table:
        """Births of the run up to some step, in order.

        Parameters
        ----------
        last : DeviceBlock
            Steps after the last whole block.
        steps : int
            After the initial one.
        state_of : callable
            States of the chain of cells (n,) and descriptors (n, B).

        Raises
        ------
        NichechainError
            If a block has not come.
        """
        found, done = [self.initial], 0
        while done < steps - len(last.parent):
            if done not in self.blocks:
                raise NichechainError(
                    f"births of step {done + 1} have not come from the device: an emitter state must be of "
                    "the run that its emitter has recorded last"
                )
            found.append(self.blocks[done])
            done += len(self.blocks[done].parent)
        found.append(last)
        per_step = [row for block in found for row in _steps(block)]
        parent = np.concatenate([row.parent for row in per_step]).astype(np.int64)
        cell = np.concatenate([row.cell for row in per_step]).astype(np.int64)
        descriptor = np.concatenate([row.descriptor for row in per_step])
        fitness = np.concatenate([row.fitness for row in per_step]).astype(np.float64)
        # A repertoire is written row after row, so that of equals the last stays.
        accepted = np.concatenate(
            [one_by_one(row.cell, row.fitness, row.better, ties=True) for row in per_step]
        )
        step = np.repeat(np.arange(len(per_step)), [len(row.parent) for row in per_step])
        fine = np.isfinite(fitness) & np.isfinite(descriptor).all(axis=1)
        state = np.full(len(parent), NONE)
        state[fine] = state_of(cell[fine], descriptor[fine])
        born = parent != NONE
        offspring = Offspring(
            np.empty((len(parent), 0), np.float32),
            np.arange(len(parent)),
            parent,
            np.where(born, state[parent], NONE),
            _depths(parent, step),
            np.zeros(len(parent), bool),
        )
        evaluation = Evaluation(
            np.where(fine[:, None], descriptor.astype(np.float64), np.nan),
            np.where(fine, fitness, np.nan),
            ~fine,
            tuple("" if good else _NOT_FINITE for good in fine),
        )
        table = make_table(offspring, evaluation, child_niche=state, accepted=accepted & fine, step=0)
        at = table.column_names.index("step")
        return table.set_column(at, table.field("step"), pa.array(step.astype(np.int32)))


def _steps(block: DeviceBlock) -> list[DeviceBlock]:
    return [DeviceBlock(*(each[k] for each in vars(block).values())) for k in range(len(block.parent))]


def _depths(parent: Ints, step: Ints) -> Ints:
    """Generations behind births (N,), whose parents are of earlier steps."""
    depth = np.zeros(len(parent), np.int64)
    for rows in np.split(np.arange(len(parent)), np.flatnonzero(np.diff(step)) + 1):
        born = rows[parent[rows] != NONE]
        depth[born] = depth[parent[born]] + 1
    return depth
