"""Where children land, and how far, by one cell less sharply: few births leave gaps where some will fall."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.displacement import GridDisplacement
from nichechain.niches import GridNiches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def _normal(reach: int) -> Floats:
    """A normal distribution one cell wide, so many cells to either side."""
    weights = np.exp(-0.5 * np.arange(-reach, reach + 1) ** 2)
    normal: Floats = weights / weights.sum()
    return normal


_REACH = 3
_WEIGHTS = _normal(_REACH)
# One by one pairs are spread no further than over the cells around.
_NEXT = _normal(1)
_TINY = 1e-300

CENTRE = float(_WEIGHTS[_REACH])
"""Share of a cell that stays there, for each axis."""


def smoothed_states(niches: GridNiches, share: Floats) -> Floats:
    """A share of each state (S,), that of each niche spread over those around it; it stays in the grid."""
    smooth = share.copy()
    inside = share[: len(niches)].reshape(niches.shape)
    smooth[: len(niches)] = _smoothed(inside, "symmetric").ravel()
    return smooth


def smoothed_displacement(displacement: GridDisplacement) -> GridDisplacement:
    """Displacements, each spread over those around it; to stay is none, and stays as likely as it is."""
    here = tuple(k - 1 for k in displacement.niches.shape)
    moves = displacement.kernel.copy()
    moves[here] = 0.0
    kernel = _smoothed(moves, "constant")
    kernel[here] = 0.0
    kernel *= (1.0 - displacement.stay) / max(kernel.sum(), _TINY)
    kernel[here] = displacement.stay
    return replace(displacement, kernel=kernel / kernel.sum())


@dataclass(frozen=True)
class SpreadPairs:
    """Pairs of states, and those whose child is a cell away from theirs.

    Parameters
    ----------
    parent, child : (E',) int64 arrays
        All of them, each once and sorted.
    place : (E,) int64 array
        Which of them are the pairs themselves.
    matrix : (E', E) scipy.sparse.csr_array
        How much of a birth of each pair goes to each of all.
    """

    parent: Ints
    child: Ints
    place: Ints
    matrix: sparse.csr_array

    @classmethod
    def of(cls, niches: GridNiches, parent: Ints, child: Ints) -> SpreadPairs:
        """The cells around every child that is in the grid, at its edge the child's own.

        Parameters
        ----------
        niches : GridNiches
        parent, child : (E,) int64 arrays
            Pairs, each once and sorted.
        """
        n, shape = len(niches), np.array(niches.shape)[:, None]
        cell = np.stack(np.unravel_index(np.minimum(child, n - 1), niches.shape))
        codes, weights = [], []
        for step in product((-1, 0, 1), repeat=len(niches.shape)):
            there = np.clip(cell + np.array(step)[:, None], 0, shape - 1)
            landed = np.where(child < n, np.ravel_multi_index(tuple(there), niches.shape), child)
            codes.append(parent * niches.states + landed)
            weights.append(np.full(parent.size, np.prod(_NEXT[np.array(step) + 1])))
        code, entry = np.unique(np.concatenate(codes), return_inverse=True)
        index = entry, np.tile(np.arange(parent.size), len(codes))
        matrix = sparse.csr_array((np.concatenate(weights), index), shape=(code.size, parent.size))
        place = np.searchsorted(code, parent * niches.states + child)
        return cls(*np.divmod(code, niches.states), place, matrix)

    def sharp(self, births: Floats) -> Floats:
        """Births (E,) where they fell, (E',)."""
        found = np.zeros(self.parent.size)
        found[self.place] = births
        return found

    def smooth(self, births: Floats) -> Floats:
        """Births (E,) spread over the cells around them, (E',)."""
        found: Floats = self.matrix @ births
        return found


def spread_size(niches: GridNiches) -> int:
    """Over how many cells a child is spread at most."""
    return int(_NEXT.size ** len(niches.shape))


def _smoothed(values: Floats, edge: Literal["symmetric", "constant"]) -> Floats:
    """Values spread along every axis; beyond the edge are the same mirrored, or zeros."""
    for axis, size in enumerate(values.shape):
        margin = [(0, 0)] * values.ndim
        margin[axis] = (_REACH, _REACH)
        wide = np.moveaxis(np.pad(values, margin, mode=edge), axis, 0)
        smooth = sum(weight * wide[step : step + size] for step, weight in enumerate(_WEIGHTS))
        values = np.moveaxis(np.asarray(smooth), 0, axis)
    return values
