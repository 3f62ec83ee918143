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
    kinds, which = np.unique(np.stack([state, elite, child]), axis=1, return_inverse=True)
    number = np.bincount(which.ravel(), children, kinds.shape[1]).astype(np.int64)
    return np.vstack([kinds, number]).T


def elites_of(families: Ints) -> Ints:
    """Which elite each row is of, (F,): numbers from 0 in the order of states, and of elites in them."""
    if not len(families):
        return np.empty(0, np.int64)
    _, number = np.unique(families[:, :2], axis=0, return_inverse=True)
    return number.ravel().astype(np.int64)


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
