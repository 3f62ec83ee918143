"""Draws from the rows of a transition matrix in constant time, however many entries a row has."""

from __future__ import annotations

from collections.abc import Iterator

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
        from nichechain.core import alias_tables

        matrix = sparse.csr_array(matrix, copy=True)
        matrix.sum_duplicates()
        matrix.eliminate_zeros()
        self._start = matrix.indptr.astype(np.int64)
        self._column = matrix.indices.astype(np.int64)
        weights = matrix.data.astype(np.float64)
        self._keep, self._other = alias_tables.tables(self._start, self._column, weights)

    def draw(self, rows: Ints, rng: np.random.Generator) -> Ints:
        """One column for each of some rows, (N,)."""
        from nichechain.core import alias_tables

        drawn = np.empty(rows.size, np.int64)
        tables = self._start, self._column, self._keep, self._other
        alias_tables.draw(*tables, rows, rng.random(rows.size), drawn)
        return drawn

    def walk(self, here: Ints, steps: int, rng: np.random.Generator) -> Iterator[Ints]:
        """States of walks, (N,) each: those they begin in, then the next, until there are ``steps``."""
        yield here
        for _ in range(steps - 1):
            here = self.draw(here, rng)
            yield here
