"""How many children of parents in niche i were born in niche j."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.births.families import tabulated
from nichechain.births.table import NONE
from nichechain.core.checks import as_floats, as_whole
from nichechain.core.errors import NichechainError
from nichechain.niches import Niches

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
    niches : Niches
    visits : (S,) int64 array
        Births in each state, initial ones included.
    families : (F, 4) int64 array
        Rows (state, elite, child state, children): whose children they are, as far as births say.
        Numbers of elites matter only in that they differ.
    """

    matrix: sparse.csr_array
    niches: Niches
    visits: Ints
    families: Ints = field(default_factory=lambda: np.empty((0, 4), np.int64))

    @classmethod
    def from_births(
        cls, parent: ArrayLike, child: ArrayLike, niches: Niches, *, elite: ArrayLike | None = None
    ) -> TransitionCounts:
        """Counts of births.

        Parameters
        ----------
        parent, child : (N,) ints
            States of the parent and of the child, -1 for null: a birth without a parent is only
            a visit, and one without a niche failed and is left out.
        niches : Niches
            The niches that the numbers belong to.
        elite : (N,) ints, optional
            Number of the parent, which tells siblings from cousins; -1 where it is not known.

        Raises
        ------
        NichechainError
            If the lengths differ or a state does not exist.
        """
        i, j = as_whole("parent", parent), as_whole("child", child)
        _check_pairs(i, j, niches, lowest=NONE)
        moved = (i != NONE) & (j != NONE)
        counts = cls.from_pairs(i[moved], j[moved], niches)
        counts = replace(counts, visits=np.bincount(j[j != NONE], minlength=niches.states))
        if elite is None:
            return counts
        uid = as_whole("elite", elite)
        if uid.shape != i.shape:
            raise NichechainError(f"elites have shape {uid.shape} and parents {i.shape}, but must be alike")
        # Children whose parents are not known are not siblings for that.
        own = moved & (uid != NONE)
        return replace(counts, families=tabulated(i[own], uid[own], j[own]))

    @classmethod
    def from_pairs(
        cls, parent: ArrayLike, child: ArrayLike, niches: Niches, n: ArrayLike | None = None
    ) -> TransitionCounts:
        """Counts of pairs of states.

        Parameters
        ----------
        parent, child : (N,) ints
            States of parents and of their children.
        niches : Niches
            The niches that the numbers belong to.
        n : (N,) ints, optional
            How many births each pair stands for; by default one.

        Raises
        ------
        NichechainError
            If the lengths differ, a state does not exist or a number is negative.
        """
        i, j = as_whole("parent", parent), as_whole("child", child)
        _check_pairs(i, j, niches, lowest=0)
        size = np.ones(i.size, np.int64) if n is None else _multiplicities(n, i.shape)
        shape = (niches.states, niches.states)
        matrix = sparse.coo_array((size, (i, j)), shape=shape).tocsr()
        # A pair that stands for no birth is no transition.
        matrix.eliminate_zeros()
        visits = np.zeros(niches.states, np.int64)
        np.add.at(visits, j, size)
        return cls(matrix, niches, visits)

    def __add__(self, other: TransitionCounts) -> TransitionCounts:
        """Pooled counts.

        Raises
        ------
        NichechainError
            If the niches differ.
        """
        if self.niches != other.niches:
            raise NichechainError(f"niches differ: {self.niches} and {other.niches}")
        later = other.families.copy()
        if len(self.families):
            # Elites of two runs may bear the same number.
            later[:, 1] += self.families[:, 1].max() + 1 - later[:, 1].min(initial=0)
        return TransitionCounts(
            (self.matrix + other.matrix).tocsr(),
            self.niches,
            self.visits + other.visits,
            np.concatenate([self.families, later]),
        )

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


def _multiplicities(n: ArrayLike, shape: tuple[int, ...]) -> Ints:
    given = as_floats("n", n)
    if given.shape != shape:
        raise NichechainError(f"n has shape {given.shape}, but must have {shape}, one number for each pair")
    if not (np.isfinite(given).all() and (given >= 0).all() and (given == np.floor(given)).all()):
        raise NichechainError("n has numbers that are negative or no whole numbers, but counts births")
    return given.astype(np.int64)


def _check_pairs(parent: Ints, child: Ints, niches: Niches, *, lowest: int) -> None:
    if parent.shape != child.shape or parent.ndim != 1:
        raise NichechainError(
            f"parents have shape {parent.shape} and children {child.shape}, but must be alike"
        )
    for states in (parent, child):
        odd = states[(states < lowest) | (states >= niches.states)]
        if odd.size:
            raise NichechainError(f"state is {odd[0]}, but states run from 0 to {niches.states - 1}")
