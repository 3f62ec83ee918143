"""What births of neighbouring niches of a grid say of where a niche's children land."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.niches import GridNiches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Neighbours at most so many cells away speak, with the weight of a normal distribution half as wide: further
# away where that makes few neighbours of many.
_REACH, _FAR_REACH, _FAR_AXES = 2, 3, 2
# One imaginary birth that the pools speak for keeps a niche of silent neighbours from being told nothing.
_IMAGINARY = 1.0
_LANDING, _MOVING = 0, 1


class _Offset(NamedTuple):
    """Pairs that speak to the niche this far from their parent's.

    Parameters
    ----------
    shift : int
        How far, in flat ids.
    weight : float
    told : (E,) bool array
        Pairs that have a niche there, which hears where their children landed.
    moves : (E,) bool array
        Those whose children would be in the grid, too, or are outside: it hears how far they moved.
    """

    shift: int
    weight: float
    told: Flags
    moves: Flags

    def pairs(self, kind: int) -> Flags:
        """The pairs that this niche hears of in this kind."""
        return self.told if kind == _LANDING else self.moves


class Neighbours:
    """Births of neighbours, as those of a niche itself would be: landed alike, or moved alike.

    Parameters
    ----------
    niches : GridNiches
    parent, child : (E,) int64 arrays
        Pairs of states whose births speak, each once and sorted.
    place : (N,) int64 array
        Those of them that are spoken of, see :meth:`shares`.
    far : bool
        Whether neighbours three cells away speak on grids of up to two axes, instead of two.

    Notes
    -----
    A kernel estimate of a row from the rows around it (Nadaraya and Watson 1964), a row's own births
    left out. Two kinds: ``landing``, the children of neighbours where they landed; ``moving``, as far
    from the niche, and in the same direction, as they landed from the neighbour.
    """

    def __init__(self, niches: GridNiches, parent: Ints, child: Ints, place: Ints, *, far: bool) -> None:
        self.states, self.niches = niches.states, len(niches)
        self._shape = niches.shape
        self.parent, self.child = parent, child
        self.offsets = list(_offsets(niches, parent, child, far=far))
        self._pair = parent * self.states + child
        self._spoken_of = parent[place]
        # Of all that is said, what is said of pairs that are asked about.
        self._heard = [self._words_about(self._pair[place], kind) for kind in (_LANDING, _MOVING)]

    def words(self, kind: int, offset: _Offset) -> tuple[Ints, Ints]:
        """Pairs that speak, and the codes (row · S + column) of what they speak of."""
        source = np.flatnonzero(offset.pairs(kind))
        column = self.child[source]
        if kind == _MOVING:
            column = np.where(column < self.niches, column + offset.shift, column)
        return source, (self.parent[source] + offset.shift) * self.states + column

    def place(self, parent: Ints, child: Ints) -> Ints:
        """Which pair it is, (N,), or -1 where there is none, or no such niches."""
        if not self._pair.size:
            return np.full(parent.size, -1)
        code = parent * self.states + child
        place = np.minimum(np.searchsorted(self._pair, code), self._pair.size - 1)
        known = (self._pair[place] == code) & (child >= 0) & (child < self.states)
        return np.where(known, place, -1)

    def said(self, kind: int, births: Floats) -> Floats:
        """Births that each niche hears of through each offset, weighted, (K, S)."""
        told = np.zeros((len(self.offsets), self.states))
        speakers, first = self._speakers
        if not speakers.size:
            return told
        whole = np.add.reduceat(births, first)
        for row, offset in zip(told, self.offsets, strict=True):
            # Who has a niche there has it for all its children; which of them would be in the grid differs.
            heard = whole * offset.told[first]
            if kind == _MOVING:
                heard = np.add.reduceat(births * offset.moves, first)
            here = np.flatnonzero(heard)
            row[speakers[here] + offset.shift] = offset.weight * heard[here]
        return told

    def shares(self, landing: Floats, moving: Floats) -> Floats:
        """What births of neighbours say of the pairs asked about, (2, N), at most 1 in all of a row.

        Parameters
        ----------
        landing, moving : (E,) float64 arrays
            Births of each pair that are of this kind.
        """
        shares = np.empty((2, self._spoken_of.size))
        for kind, births in enumerate((landing, moving)):
            total = self.said(kind, births).sum(axis=0)
            shares[kind] = (self._heard[kind] @ births) / (total + _IMAGINARY)[self._spoken_of]
        return shares

    def rows(self, landing: Floats, moving: Floats, weights: Floats) -> NearRows:
        """The same for all pairs of states, times the weight of either kind.

        Parameters
        ----------
        landing, moving : (E,) float64 arrays
        weights : (2,) float64 array
        """
        return NearRows(self, np.stack([landing, moving]), weights)

    def heard(self, kind: int, births: Floats) -> sparse.csr_array:
        """Births (E,) that each niche hears of, weighted, by the state that they speak of, (S, S).

        Notes
        -----
        A sum over speakers of rows that neighbours have in common: columns are states where births landed,
        or displacements where they moved.
        """
        whole, starts = (self.states, self.states), self.starts
        if kind == _LANDING:
            return self._hears @ sparse.csr_array((births, self.child, starts), shape=whole)
        moves, column = np.unique(self._displacement(), return_inverse=True)
        moved = self._hears @ sparse.csr_array((births, column, starts), shape=(self.states, moves.size))
        row = np.repeat(np.arange(self.states), np.diff(moved.indptr))
        child = self._displaced(np.minimum(row, self.niches - 1), moves[moved.indices])
        there = child >= 0
        return sparse.csr_array((moved.data[there], (row[there], child[there])), shape=whole)

    @cached_property
    def _speakers(self) -> tuple[Ints, Ints]:
        """Parents of pairs, each once, and the first pair of each."""
        parent, first = np.unique(self.parent, return_index=True)
        return parent, first

    @cached_property
    def _hears(self) -> sparse.csr_array:
        """How much each niche hears of each that has births, (S, S)."""
        rows, weights = [], []
        speakers, first = self._speakers
        for offset in self.offsets:
            here = speakers[offset.told[first]]
            rows.append(np.stack([here + offset.shift, here]))
            weights.append(np.full(here.size, offset.weight))
        index = tuple(np.concatenate(rows, axis=1))
        return sparse.csr_array((np.concatenate(weights), index), shape=(self.states, self.states))

    @cached_property
    def moves(self) -> Flags:
        """Pairs that each offset hears of as moved, (K, E)."""
        return np.stack([offset.moves for offset in self.offsets])

    def _displacement(self) -> Ints:
        """How far, and in which direction, the child of each pair is from its parent, (E,); outside last."""
        cells = (np.minimum(state, self.niches - 1) for state in (self.parent, self.child))
        start, end = (np.stack(np.unravel_index(cell, self._shape)) for cell in cells)
        most = np.array(self._shape)[:, None] - 1
        wide = tuple(2 * size - 1 for size in self._shape)
        away = np.ravel_multi_index(tuple(end - start + most), wide)
        return np.where(self.child < self.niches, away, int(np.prod(wide)))

    def _displaced(self, niche: Ints, away: Ints) -> Ints:
        """The state so far from each niche, (M,), or -1 where that is beyond the grid."""
        wide = tuple(2 * size - 1 for size in self._shape)
        nowhere = away == int(np.prod(wide))
        start = np.stack(np.unravel_index(niche, self._shape))
        size = np.array(self._shape)[:, None]
        end = start + np.stack(np.unravel_index(np.where(nowhere, 0, away), wide)) - (size - 1)
        within = ((end >= 0) & (end < size)).all(axis=0)
        state = np.ravel_multi_index(tuple(np.clip(end, 0, size - 1)), self._shape)
        return np.where(nowhere, self.niches, np.where(within, state, -1))

    def _words_about(self, code: Ints, kind: int) -> sparse.csr_array:
        """How much a birth of each pair says of each of some pairs, given by their sorted codes, (N, E)."""
        targets, sources, weights = [], [], []
        for offset in self.offsets if code.size else []:
            source, said = self.words(kind, offset)
            place = np.minimum(np.searchsorted(code, said), code.size - 1)
            there = code[place] == said
            targets.append(place[there].astype(np.int32))
            sources.append(source[there].astype(np.int32))
            weights.append(np.full(targets[-1].size, offset.weight))
        if not targets:
            return sparse.csr_array((code.size, self._pair.size))
        index = np.concatenate(targets), np.concatenate(sources)
        return sparse.csr_array((np.concatenate(weights), index), shape=(code.size, self._pair.size))

    @cached_property
    def starts(self) -> Ints:
        """Where the pairs of each parent start, (S + 1,)."""
        return np.searchsorted(self.parent, np.arange(self.states + 1)).astype(np.int64)


@dataclass(frozen=True)
class NearRows:
    """The part of every row that neighbours speak for, which sums to less than 1.

    Parameters
    ----------
    neighbours : Neighbours
    births : (2, E) float64 array
        Births of each pair that are of either kind.
    weights : (2,) float64 array
    """

    neighbours: Neighbours
    births: Floats
    weights: Floats

    @cached_property
    def mass(self) -> Floats:
        """How much of each row it is, (S,)."""
        mass: Floats = self._through.sum(axis=(0, 1))
        return mass

    @cached_property
    def matrix(self) -> sparse.csr_array:
        """The whole of it, (S, S)."""
        landing, moving = (
            sparse.diags_array(share) @ self.neighbours.heard(kind, births)
            for kind, (share, births) in enumerate(zip(self._share, self.births, strict=True))
        )
        return (landing + moving).tocsr()

    def at(self, parent: Ints, child: Ints) -> Floats:
        """Some entries of it, (N,), without the others."""
        near = self.neighbours
        found = np.zeros(parent.size)
        for kind, offset in product((_LANDING, _MOVING), near.offsets):
            # Whose children would say it from there: a pair that speaks elsewhere is not told here.
            speaker = parent - offset.shift
            column = child
            if kind == _MOVING:
                moved = child - offset.shift
                column = np.where(child >= near.niches, child, np.where(moved < near.niches, moved, -1))
            pair = near.place(speaker, column)
            there = np.flatnonzero(pair >= 0)
            there = there[offset.pairs(kind)[pair[there]]]
            births = self.births[kind, pair[there]]
            found[there] += offset.weight * births * self._share[kind, parent[there]]
        return found

    def sample(self, rows: Ints, rng: np.random.Generator) -> Ints:
        """A column for each of some rows (N,) that it is a part of."""
        from nichechain.chain import neighbours_steps

        near = self.neighbours
        drawn = np.empty(rows.size, np.int64)
        neighbours_steps.draw(
            self._voices,
            np.array([offset.shift for offset in near.offsets]),
            near.moves,
            (near.starts, near.child, self._upto),
            near.niches,
            (rows, rng.random((rows.size, 2))),
            drawn,
        )
        return drawn

    @cached_property
    def _voices(self) -> Floats:
        """How much of each row comes through the first kinds and offsets, (S, 2 K)."""
        through = self._through.reshape(-1, self.neighbours.states)
        return np.ascontiguousarray(np.cumsum(through, axis=0).T)

    @cached_property
    def _upto(self) -> Floats:
        """Births of the first pairs, of either kind, (2, E + 1)."""
        return np.concatenate([np.zeros((2, 1)), np.cumsum(self.births, axis=1)], axis=1)

    @cached_property
    def _said(self) -> Floats:
        """Births that each row hears of by kind and offset, (2, K, S)."""
        return np.stack([self.neighbours.said(kind, births) for kind, births in enumerate(self.births)])

    @cached_property
    def _share(self) -> Floats:
        """The part of each row that a birth it hears of is, by kind, (2, S)."""
        share: Floats = self.weights[:, None] / (self._said.sum(axis=1) + _IMAGINARY)
        return share

    @cached_property
    def _through(self) -> Floats:
        """The part of each row that comes through each kind and offset, (2, K, S)."""
        through: Floats = self._said * self._share[:, None, :]
        return through


def neighbourhood(niches: GridNiches, *, far: bool) -> int:
    """How many neighbours a niche in the middle of a large grid has."""
    return len(_steps(niches, far=far))


def _steps(niches: GridNiches, *, far: bool) -> list[tuple[tuple[int, ...], float]]:
    """How far a neighbour is along each axis, and its weight."""
    axes = len(niches.shape)
    reach = _FAR_REACH if far and axes <= _FAR_AXES else _REACH
    steps = []
    for step in product(range(-reach, reach + 1), repeat=axes):
        square = sum(along * along for along in step)
        if 0 < square <= reach**2:
            steps.append((step, float(np.exp(-2.0 * square / reach**2))))
    return steps


def _offsets(niches: GridNiches, parent: Ints, child: Ints, *, far: bool) -> Iterator[_Offset]:
    n, shape = len(niches), niches.shape
    inside, outside = parent < n, child >= n
    start = np.unravel_index(np.minimum(parent, n - 1), shape)
    end = np.unravel_index(np.minimum(child, n - 1), shape)
    strides = [int(np.prod(shape[axis + 1 :])) for axis in range(len(shape))]
    for step, weight in _steps(niches, far=far):
        told, stays = inside.copy(), np.ones(child.size, bool)
        for cell, moved, along, size in zip(start, end, step, shape, strict=True):
            told &= (cell + along >= 0) & (cell + along < size)
            stays &= (moved + along >= 0) & (moved + along < size)
        shift = sum(along * stride for along, stride in zip(step, strides, strict=True))
        yield _Offset(shift, weight, told, told & (stays | outside))
