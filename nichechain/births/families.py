"""Births by family: the children of one elite, which take after each other.

A table of families has rows (state, elite, child, children), (F, 4) int64: so many children that an
elite of a state had in one child state. Numbers of elites matter only in that they differ.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


def tabulated(state: Ints, elite: Ints, child: Ints, children: Ints | None = None) -> Ints:
    """A table of families, sorted, (F, 4).

    Parameters
    ----------
    state, elite, child : (N,) int64 arrays
        Whose children they are, where the parent stood and where the child was born.
    children : (N,) int64 array, optional
        How many births each entry stands for; by default one.
    """
    order = np.lexsort((child, elite, state))
    columns = [axis[order] for axis in (state, elite, child)]
    first = np.flatnonzero(_differs(*columns))
    births = np.ones(order.size, np.int64) if children is None else children[order]
    number = np.add.reduceat(births, first) if first.size else first
    return np.stack([*(axis[first] for axis in columns), number], axis=1).astype(np.int64, copy=False)


def elites_of(families: Ints) -> Ints:
    """Which elite each row is of, (F,): numbers from 0 in the order of states, and of elites in them."""
    if not len(families):
        return np.empty(0, np.int64)
    owners = families[:, :2]
    step = np.diff(owners, axis=0)
    if ((step[:, 0] > 0) | ((step[:, 0] == 0) & (step[:, 1] >= 0))).all():
        # As tables of families are.
        return np.cumsum(_differs(*owners.T)).astype(np.int64) - 1
    _, number = np.unique(owners, axis=0, return_inverse=True)
    return number.ravel().astype(np.int64)


def _differs(*columns: Ints) -> NDArray[np.bool_]:
    """Whether each row of some columns is not the one before, (N,)."""
    new: NDArray[np.bool_] = np.arange(columns[0].size) == 0
    for column in columns:
        new[1:] |= column[1:] != column[:-1]
    return new


def folds_of(elite: Ints, folds: int, rng: np.random.Generator) -> Ints:
    """With which fold each row is held out, (F,): elites at random, each with all its children.

    Parameters
    ----------
    elite : (F,) int64 array
        As of :func:`elites_of`.
    folds : int
    rng : numpy.random.Generator
    """
    return rng.permutation(np.arange(elite.max(initial=-1) + 1) % folds)[elite]


def redrawn(families: Ints, elite: Ints, rng: np.random.Generator) -> Ints:
    """Families of as many elites in every state, drawn from its own with replacement, (F, 4).

    Parameters
    ----------
    families : (F, 4) int64 array
    elite : (F,) int64 array
        As of :func:`elites_of`.
    rng : numpy.random.Generator

    Returns
    -------
    (F, 4) int64 array
        The same rows, with as many children as the elite was drawn times: none, where it was not.
    """
    state = np.empty(elite.max(initial=-1) + 1, np.int64)
    state[elite] = families[:, 0]
    # Elites are numbered by state, so that those of one state have numbers in a row.
    first, end = np.searchsorted(state, state), np.searchsorted(state, state, side="right")
    drawn = first + rng.integers(end - first)
    again = families.copy()
    again[:, 3] *= np.bincount(drawn, minlength=state.size)[elite]
    return again
