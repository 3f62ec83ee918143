"""How many children of parents in niche i were born in niche j."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.births import NONE
from nichechain.errors import NichechainError
from nichechain.niches import GridNiches

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class TransitionCounts:
    """Births from niche to niche; counts of several runs add.

    Every evaluated child counts, accepted or not. States keep the numbers of
    the grid: none is dropped or renumbered.

    Parameters
    ----------
    matrix : (S, S) scipy.sparse.csr_array of int64
        ``matrix[i, j]`` children in state j of parents in state i.
    niches : GridNiches
    visits : (S,) int64 array
        Births in each state, initial ones included.
    """

    matrix: sparse.csr_array
    niches: GridNiches
    visits: Ints

    @classmethod
    def from_births(cls, parent: ArrayLike, child: ArrayLike, niches: GridNiches) -> TransitionCounts:
        """Counts of births.

        Parameters
        ----------
        parent, child : (N,) ints
            States of the parent and of the child, -1 for null: a birth without a parent is only
            a visit, and one without a niche failed and is left out.
        niches : GridNiches
            The niches that the numbers belong to.
        """
        i, j = np.asarray(parent, np.int64), np.asarray(child, np.int64)
        moved = (i != NONE) & (j != NONE)
        counts = cls.from_pairs(i[moved], j[moved], niches)
        return cls(counts.matrix, niches, np.bincount(j[j != NONE], minlength=niches.states))

    @classmethod
    def from_pairs(cls, parent: ArrayLike, child: ArrayLike, niches: GridNiches) -> TransitionCounts:
        """Counts of pairs of states, of parents (N,) and of their children (N,).

        Raises
        ------
        NichechainError
            If the lengths differ or a state does not exist.
        """
        i, j = np.asarray(parent, np.int64), np.asarray(child, np.int64)
        if i.shape != j.shape or i.ndim != 1:
            raise NichechainError(f"parents have shape {i.shape} and children {j.shape}, but must be alike")
        for states in (i, j):
            if states.size and (states.min() < 0 or states.max() >= niches.states):
                odd = states[(states < 0) | (states >= niches.states)][0]
                raise NichechainError(f"state is {odd}, but states run from 0 to {niches.states - 1}")
        shape = (niches.states, niches.states)
        matrix = sparse.coo_array((np.ones(i.size, np.int64), (i, j)), shape=shape).tocsr()
        return cls(matrix, niches, np.bincount(j, minlength=niches.states))

    def __add__(self, other: TransitionCounts) -> TransitionCounts:
        """Pooled counts.

        Raises
        ------
        NichechainError
            If the niches differ.
        """
        if self.niches != other.niches:
            raise NichechainError(f"niches differ: {self.niches} and {other.niches}")
        return TransitionCounts((self.matrix + other.matrix).tocsr(), self.niches, self.visits + other.visits)

    @property
    def births(self) -> Ints:
        """Children of parents in each state, (S,): what is known of each row of T."""
        return np.asarray(self.matrix.sum(axis=1), np.int64).ravel()

    @property
    def never_filled(self) -> int:
        """Niches in which nobody was born."""
        return int(np.count_nonzero(self.visits[: len(self.niches)] == 0))

    @property
    def never_parent(self) -> int:
        """Niches in which somebody was born, none of whom became a parent."""
        n = len(self.niches)
        return int(np.count_nonzero((self.visits[:n] > 0) & (self.births[:n] == 0)))

    @property
    def rows_observed(self) -> int:
        """Niches with at least one parent: rows of T that births speak of."""
        return int(np.count_nonzero(self.births[: len(self.niches)]))

    @property
    def births_outside(self) -> int:
        """Births out of bounds."""
        return int(self.visits[len(self.niches) :].sum())
