"""The births of a recorded search, numbered as they come."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain import births
from nichechain.births.table import NONE, Offspring
from nichechain.domains.base import Evaluation

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_NOT_FINITE = "objective or measures are not finite"


class Ledger:
    """Births in the order in which they were added, with what their children need to know of them.

    Parameters
    ----------
    axes : int
        Measures of the search.
    """

    def __init__(self, axes: int) -> None:
        self._axes = axes
        self._niche: list[int] = []
        self._depth: list[int] = []
        self._tables: list[pa.Table] = []

    def __len__(self) -> int:
        """Number of births."""
        return len(self._niche)

    def table(self) -> pa.Table:
        """The births so far."""
        return pa.concat_tables([births.schema(self._axes).empty_table(), *self._tables])

    def depths(self, uid: Ints) -> Ints:
        """Generations behind some births (K,), of which each must be one that is here."""
        return np.array(self._depth, np.int64)[uid]

    def add(
        self,
        parents: Ints,
        measures: Floats,
        objective: Floats,
        fine: Bools,
        state: Ints,
        accepted: Bools,
        step: int,
    ) -> None:
        """Enter births, each an array of length n.

        Parameters
        ----------
        parents : (n,) int64 array
            Births that they come from, ``NONE`` for initial ones.
        measures : (n, B) float64 array
        objective : (n,) float64 array
            NaN where the search has none.
        fine : (n,) bool array
            Which did not fail.
        state : (n,) int64 array
            ``NONE`` where the birth failed.
        accepted : (n,) bool array
        step : int
        """
        size = len(parents)
        uid = np.arange(len(self), len(self) + size)
        known = parents != NONE
        parent_niche, depth = np.full(size, NONE), np.zeros(size, np.int64)
        parent_niche[known] = [self._niche[parent] for parent in parents[known].tolist()]
        depth[known] = [self._depth[parent] + 1 for parent in parents[known].tolist()]
        self._niche += state.tolist()
        self._depth += depth.tolist()
        none = np.zeros(size, bool)
        offspring = Offspring(np.empty((size, 0), np.float32), uid, parents, parent_niche, depth, none)
        evaluation = Evaluation(
            np.where(fine[:, None], measures, np.nan),
            np.where(fine, objective, np.nan),
            ~fine,
            tuple("" if good else _NOT_FINITE for good in fine),
        )
        self._tables.append(
            births.make_table(offspring, evaluation, child_niche=state, accepted=accepted, step=step)
        )
