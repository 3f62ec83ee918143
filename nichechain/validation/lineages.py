"""Births joined with themselves: a child, its parent, and where the parent's parent stood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError

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
        missing = [name for name in _COLUMNS if name not in births.columns]
        if missing:
            raise NichechainError(f"births have no column {missing[0]}, which lineages are joined by")
        run, uid, parent, depth, parent_niche, child_niche, step = (
            births[name].fillna(NONE).to_numpy(np.int64) for name in _COLUMNS
        )
        # One number for a birth of all runs.
        span = 1 + max(uid.max(initial=0), parent.max(initial=0))
        birth = run * span + uid
        order = np.argsort(birth)
        rows = np.flatnonzero((parent != NONE) & (child_niche != NONE))
        wanted = run[rows] * span + parent[rows]
        parents, elite = np.unique(wanted, return_inverse=True)
        at = np.minimum(np.searchsorted(birth, parents, sorter=order), max(0, birth.size - 1))
        own = order[at] if birth.size else at
        lost = np.flatnonzero(birth[own] != parents)
        if lost.size:
            raise NichechainError(
                f"birth {parents[lost[0]] % span} is the parent of another, but is not among the births"
            )
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
