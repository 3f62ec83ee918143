"""Births joined with themselves: a child, its parent, and where the parent's parent stood."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.births.joins import across_runs, parent_rows
from nichechain.births.table import NONE, check_columns

if TYPE_CHECKING:
    import pandas as pd

Ints = NDArray[np.int64]

_COLUMNS = ("run", "uid", "parent_uid", "depth", "parent_niche", "child_niche", "step")


@dataclass(frozen=True)
class Triples:
    """Grandparent, parent and child, for every child that has a parent and did not fail.

    Parameters
    ----------
    elite : (N,) int64 array
        Row of the parent in the arrays below: children of one parent share it.
    child : (N,) int64 array
        State of the child.
    niche : (E,) int64 array
        State of each parent.
    grandparent : (E,) int64 array
        State of the parent's own parent, ``NONE`` for an initial birth.
    depth : (E,) int64 array
        Generations from an initial birth to the parent.
    step : (E,) int64 array
        Step in which the parent was born.
    """

    elite: Ints
    child: Ints
    niche: Ints
    grandparent: Ints
    depth: Ints
    step: Ints

    @classmethod
    def from_births(cls, births: pd.DataFrame) -> Triples:
        """Join births with themselves.

        Parameters
        ----------
        births : DataFrame
            Columns of :mod:`nichechain.births.table`, the births of every parent among them. Rows may
            come in any order, and runs are kept apart.

        Raises
        ------
        NichechainError
            If a column is missing, or the birth of a parent is.
        """
        check_columns(births, *_COLUMNS)
        run, uid, parent, depth, parent_niche, child_niche, step = (
            births[name].fillna(NONE).to_numpy(np.int64) for name in _COLUMNS
        )
        row = parent_rows(run, uid, parent)
        (number,) = across_runs(run, parent)
        rows = np.flatnonzero((parent != NONE) & (child_niche != NONE))
        # Parents by their numbers, so that it does not matter how births are ordered.
        _, first, elite = np.unique(number[rows], return_index=True, return_inverse=True)
        own = row[rows][first]
        return cls(
            elite.astype(np.int64),
            child_niche[rows],
            child_niche[own],
            parent_niche[own],
            depth[own],
            step[own],
        )

    def __len__(self) -> int:
        return len(self.child)

    def of(self, kept: NDArray[np.bool_]) -> Triples:
        """The children of some of the parents, given as (E,) bools."""
        number = np.cumsum(kept) - 1
        rows = kept[self.elite]
        return Triples(
            number[self.elite[rows]],
            self.child[rows],
            self.niche[kept],
            self.grandparent[kept],
            self.depth[kept],
            self.step[kept],
        )

    @property
    def with_grandparent(self) -> Triples:
        """Without the children of initial births."""
        return self.of(self.grandparent != NONE)
