"""How far children land, where niches are no grid: by the distance between their centres."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from nichechain.niches import Niches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Numbers of a block of pairs of niches.
_BLOCK = 2_000_000
# Niches up to which K is kept whole, 8 n² bytes of it.
_WHOLE = 3_000


@dataclass(frozen=True)
class DistanceDisplacement:
    """For any niches: the rate at which births land in a niche so far away.

    Distances between centres are counted in widths of a niche, rounded, and those of different
    niches as at least one width; shell b of a niche is all that is b widths away. The weight of a
    pair is c_b / E_b: births over all shells b of all parents, over how many niches the shells of
    their parents have, each parent counted as often as it had a child. That a parent near the edge
    has fewer neighbours is thus accounted for.

    Parameters
    ----------
    niches : Niches
    width : float
        Side of a cube with the volume of an average niche, in units of behavior.
    shells : (n, b) int64 array
        How many niches each shell has.
    births : (b,) float64 array
        c_b, with half a birth at no distance.
    exposure : (b,) float64 array
        E_b, likewise.
    """

    niches: Niches
    width: float
    shells: Ints
    births: Floats
    exposure: Floats

    @classmethod
    def pooled(cls, niches: Niches, parent: Ints, child: Ints, count: Ints | Floats) -> DistanceDisplacement:
        """Distances of births from niche to niche."""
        n = len(niches)
        width, shells = _shells(niches)
        number = shells.shape[1]
        births = np.bincount(_shell(niches, parent, child, width), count, number).astype(np.float64)
        exposure = np.bincount(parent, count, n).astype(np.float64) @ shells
        # Half a birth at no distance keeps K usable from every niche.
        births[0] += 0.5
        exposure[0] += 0.5
        return cls(niches, width, shells, births, exposure)

    @cached_property
    def rate(self) -> Floats:
        """c_b / E_b, (b,)."""
        return self.births / np.where(self.exposure > 0, self.exposure, 1.0)

    @cached_property
    def within(self) -> Floats:
        """Σ_j K_ij for every niche, (n,)."""
        within: Floats = self.shells @ self.rate
        return within

    def at(self, parent: Ints, child: Ints) -> Floats:
        """K_ij of some pairs of niches, (N,)."""
        found: Floats = self.rate[_shell(self.niches, parent, child, self.width)]
        return found

    def rows(self, parent: Ints) -> Floats:
        """K_ij of some parents and all children, (N, n)."""
        return self._made(parent) if self._whole is None else self._whole[parent]

    def to_parents(self, values: Floats) -> Floats:
        """Σ_j K_ij x_j for each row x of values (c, n); K is symmetric."""
        moved = np.empty_like(values)
        for rows in _blocks(len(self.niches)):
            moved[:, rows] = values @ self.rows(rows).T
        return moved

    def to_children(self, values: Floats) -> Floats:
        """Σ_i x_i K_ij, the same as K is symmetric."""
        return self.to_parents(values)

    def sample(self, parent: Ints, rng: np.random.Generator) -> Ints:
        """A niche in bounds for a child of each parent (N,), which are niches."""
        child = np.empty(parent.size, np.int64)
        chance = rng.random(parent.size)
        order = np.argsort(parent, kind="stable")
        starts = np.searchsorted(parent[order], np.arange(len(self.niches) + 1))
        for rows in _blocks(len(self.niches)):
            here = order[starts[rows[0]] : starts[rows[-1] + 1]]
            if not here.size:
                continue
            own, which = np.unique(parent[here], return_inverse=True)
            upto = np.cumsum(self.rows(own), axis=1)
            # One sorted sequence of all rows: a search in it is a search in the parent's row.
            upto = upto / upto[:, -1:] + np.arange(own.size)[:, None]
            found = np.searchsorted(upto.ravel(), chance[here] + which, side="right")
            child[here] = np.minimum(found - which * upto.shape[1], self._last[own][which])
        return child

    def own(self, parent: Ints, child: Ints) -> tuple[Floats, Floats]:
        """What one birth of each pair counts for, in births, (N,) each."""
        shell = _shell(self.niches, parent, child, self.width)
        # It adds 1 / E_b to weights that are multiplied by all births to be in births.
        pair = self.births.sum() / np.where(self.exposure[shell] > 0, self.exposure[shell], 1.0)
        return pair, pair * self.shells[parent, shell]

    @cached_property
    def _whole(self) -> Floats | None:
        n = len(self.niches)
        return self._made(np.arange(n)) if n <= _WHOLE else None

    @cached_property
    def _last(self) -> Ints:
        """The last niche that a child of each parent can be in, (n,)."""
        n = len(self.niches)
        last = np.empty(n, np.int64)
        for rows in _blocks(n):
            last[rows] = n - 1 - np.argmax(self.rows(rows)[:, ::-1] > 0, axis=1)
        return last

    def _made(self, niches: Ints) -> Floats:
        made: Floats = self.rate[_away(self.niches.centers, niches, np.arange(len(self.niches)), self.width)]
        return made


@lru_cache(maxsize=2)
def _shells(niches: Niches) -> tuple[float, Ints]:
    """Width of a niche, and how many niches each shell of each has, (n, b).

    Kept, as a base measure is made some dozens of times for one estimate, and pairs of niches are many.
    """
    n, axes = niches.centers.shape
    spans = niches.upper - niches.lower
    width = float(np.prod((spans / n ** (1.0 / axes)) ** (1.0 / axes)))
    number = 2 + int(np.linalg.norm(spans) / width + 0.5)
    shells = np.zeros((n, number), np.int64)
    for rows in _blocks(n):
        away = _away(niches.centers, rows, np.arange(n), width)
        flat = away + number * np.arange(len(away))[:, None]
        shells[rows] = np.bincount(flat.ravel(), minlength=number * len(away)).reshape(-1, number)
    shells.flags.writeable = False
    return width, shells


def _shell(niches: Niches, parent: Ints, child: Ints, width: float) -> Ints:
    """In which shell of the parent a child is, for each pair (N,)."""
    centers = niches.centers
    squares = np.zeros(parent.size)
    for axis in centers.T:
        squares += (axis[child] - axis[parent]) ** 2
    return _counted(np.sqrt(squares), width, parent == child)


def _away(centers: Floats, rows: Ints, columns: Ints, width: float) -> Ints:
    """The same for all pairs of rows and columns, (r, c)."""
    # Axis by axis, so that no array has all axes of all pairs, and every pair is rounded as it is alone.
    squares = np.zeros((rows.size, columns.size))
    for axis in centers.T:
        squares += (axis[columns][None, :] - axis[rows][:, None]) ** 2
    return _counted(np.sqrt(squares), width, rows[:, None] == columns[None, :])


def _counted(distance: Floats, width: float, same: NDArray[np.bool_]) -> Ints:
    counted: Ints = np.where(same, 0, np.maximum(1, (distance / width + 0.5).astype(np.int64)))
    return counted


def _blocks(n: int) -> Iterator[Ints]:
    """Rows of n niches, a block of pairs at a time."""
    step = max(1, _BLOCK // n)
    for start in range(0, n, step):
        yield np.arange(start, min(start + step, n))
