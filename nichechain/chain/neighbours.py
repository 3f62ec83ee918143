"""What births of neighbouring niches of a grid say of where a niche's children land."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.niches import GridNiches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Neighbours at most so many cells away speak, with the weight of a standard normal at their distance.
_REACH = 2
# One imaginary birth that the pools speak for keeps a niche of silent neighbours from being told nothing.
_IMAGINARY = 1.0


class Neighbours:
    """Births of neighbours, as those of a niche itself would be: landed alike, or moved alike.

    Parameters
    ----------
    niches : GridNiches
    parent, child : (E,) int64 arrays
        Pairs of states, each once and sorted.

    Notes
    -----
    A kernel estimate of a row from the rows around it (Nadaraya and Watson 1964), a row's own births
    left out. Two kinds: ``landing``, the children of neighbours where they landed; ``moving``, as far
    from the niche, and in the same direction, as they landed from the neighbour.
    """

    def __init__(self, niches: GridNiches, parent: Ints, child: Ints) -> None:
        self._states = niches.states
        pair = parent * niches.states + child
        parts = list(_told(niches, parent, child))
        self._birth, self._row, landed, moved, self._weight = (
            np.concatenate([part[k] for part in parts]) for k in range(5)
        )
        self._column = landed, moved
        self._pair = tuple(_found(pair, self._row * niches.states + column) for column in (landed, moved))
        self._inside = tuple(column >= 0 for column in self._column)

    def shares(self, landing: Floats, moving: Floats) -> Floats:
        """What neighbours' births of either kind say of each pair, (2, E), at most 1 in all of a row.

        Parameters
        ----------
        landing, moving : (E,) float64 arrays
            Births of each pair that are of this kind.
        """
        said = np.zeros((2, landing.size))
        for kind, births in enumerate((landing, moving)):
            told = self._share(kind, births)
            seen = self._pair[kind] >= 0
            said[kind] = np.bincount(self._pair[kind][seen], told[seen], births.size)
        return said

    def rows(self, landing: Floats, moving: Floats, weights: Floats) -> sparse.csr_array:
        """The same for all pairs of states, times the weight of either kind, (S, S)."""
        parts = []
        for kind, births in enumerate((landing, moving)):
            parts.append(weights[kind] * self._share(kind, births)[self._inside[kind]])
        entry, column, start = self._entries
        data = np.bincount(entry, np.concatenate(parts), column.size)
        return sparse.csr_array((data, column, start), shape=(self._states, self._states))

    @cached_property
    def _entries(self) -> tuple[Ints, Ints, Ints]:
        """Where in a sparse matrix the words of either kind add up; its columns, and starts of rows."""
        said = [
            self._row[kept] * self._states + column[kept]
            for kept, column in zip(self._inside, self._column, strict=True)
        ]
        code, entry = np.unique(np.concatenate(said), return_inverse=True)
        start = np.searchsorted(code, np.arange(self._states + 1) * self._states)
        return entry, code % self._states, start

    def _share(self, kind: int, births: Floats) -> Floats:
        told = self._weight * births[self._birth] * self._inside[kind]
        total = np.bincount(self._row, told, self._states)
        share: Floats = told / (total + _IMAGINARY)[self._row]
        return share


def _told(niches: GridNiches, parent: Ints, child: Ints) -> Iterator[tuple[Ints, Ints, Ints, Ints, Floats]]:
    """Pair, the niche it speaks to, where its child landed and that niche's would have (or -1), weight."""
    n, shape = len(niches), np.array(niches.shape)
    inside = np.flatnonzero(parent < n)
    start = np.stack(np.unravel_index(parent[inside], niches.shape), axis=1)
    end = np.stack(np.unravel_index(np.minimum(child[inside], n - 1), niches.shape), axis=1)
    outside = child[inside] >= n
    for offset in product(*[range(-_REACH, _REACH + 1)] * shape.size):
        square = sum(step * step for step in offset)
        if not 0 < square <= _REACH**2:
            continue
        cell, moved = start + offset, end + offset
        told = ((cell >= 0) & (cell < shape)).all(axis=1)
        stays = ((moved >= 0) & (moved < shape)).all(axis=1)
        there = np.ravel_multi_index(tuple(np.clip(moved, 0, shape - 1).T), niches.shape)
        there = np.where(outside, n, np.where(stays, there, -1)).astype(np.int64)
        to = np.ravel_multi_index(tuple(cell[told].T), niches.shape).astype(np.int64)
        weight = np.full(to.size, np.exp(-0.5 * square))
        yield inside[told], to, child[inside][told], there[told], weight


def _found(sorted_: Ints, wanted: Ints) -> Ints:
    """Where each wanted number stands among sorted ones, -1 where it does not."""
    if not sorted_.size:
        return np.full(wanted.size, -1, np.int64)
    place = np.minimum(np.searchsorted(sorted_, wanted), sorted_.size - 1)
    return np.where(sorted_[place] == wanted, place, -1).astype(np.int64)
