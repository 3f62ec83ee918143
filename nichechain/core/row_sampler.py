"""Draws from the rows of a transition matrix in constant time, however many entries a row has."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class RowSampler:
    """Draws columns of a row-stochastic matrix.

    Parameters
    ----------
    matrix : (m, S) array or scipy.sparse.csr_array
        Rows of non-negative weights; those to be drawn from have some.

    Notes
    -----
    Walker's alias method (1977) with Vose's construction (1991): every entry of a row becomes a
    cell of equal probability that it shares with at most one other entry.
    """

    def __init__(self, matrix: Floats | sparse.csr_array) -> None:
        matrix = sparse.csr_array(matrix, copy=True)
        matrix.sum_duplicates()
        matrix.eliminate_zeros()
        self._start = matrix.indptr.astype(np.int64)
        self._column = matrix.indices.astype(np.int64)
        self._keep, self._other = _tables(self._start, self._column, matrix.data.astype(np.float64))

    def draw(self, rows: Ints, rng: np.random.Generator) -> Ints:
        """One column for each of some rows, (N,)."""
        drawn = np.empty(rows.size, np.int64)
        _draw(self._start, self._column, self._keep, self._other, rows, rng.random(rows.size), drawn)
        return drawn

    def walk(self, here: Ints, steps: int, rng: np.random.Generator) -> Iterator[Ints]:
        """States of walks, (N,) each: those they begin in, then the next, until there are ``steps``."""
        yield here
        for _ in range(steps - 1):
            here = self.draw(here, rng)
            yield here


@numba.njit(nogil=True, cache=True)
def _tables(start: Any, column: Any, weight: Any) -> Any:
    """For each cell the share that is its own entry's, and whose the rest is."""
    keep = np.ones(column.size)
    other = column.copy()
    small, large = np.empty(column.size, np.int64), np.empty(column.size, np.int64)
    for row in range(start.size - 1):
        begin, end = start[row], start[row + 1]
        total = weight[begin:end].sum()
        few = many = 0
        for cell in range(begin, end):
            keep[cell] = weight[cell] / total * (end - begin)
            if keep[cell] < 1.0:
                small[few] = cell
                few += 1
            else:
                large[many] = cell
                many += 1
        while few > 0 and many > 0:
            few -= 1
            poor, rich = small[few], large[many - 1]
            other[poor] = column[rich]
            keep[rich] -= 1.0 - keep[poor]
            if keep[rich] < 1.0:
                many -= 1
                small[few] = rich
                few += 1
        # What rounding left over is whole.
        for k in range(few):
            keep[small[k]] = 1.0
        for k in range(many):
            keep[large[k]] = 1.0
    return keep, other


@numba.njit(nogil=True, cache=True)
def _draw(start: Any, column: Any, keep: Any, other: Any, rows: Any, uniform: Any, drawn: Any) -> None:
    for k in range(rows.size):
        begin = start[rows[k]]
        size = start[rows[k] + 1] - begin
        place = uniform[k] * size
        # A uniform number just below 1 could round up to the size itself.
        cell = min(np.int64(place), size - 1)
        at = begin + cell
        drawn[k] = column[at] if place - cell < keep[at] else other[at]
