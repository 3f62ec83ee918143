"""Elimination of states one by one, without a subtraction: right to the last digits of every entry.

A lineage wanders within a set of states until it leaves it. What is asked of it solves a system with
the matrix I − Q, where Q is T within the set. The usual elimination subtracts numbers that may be
nearly alike, and where lineages leave seldom it loses all digits. Here I − Q is never formed: it is
kept as what leads from state to state and what leads out, and a state is eliminated by passing
what leads into it on to where it leads. All numbers are sums, products and quotients of numbers that
are not negative, so every result is as exact as the probabilities that it is made of.

Notes
-----
Grassmann, Taksar and Heyman (1985), "Regenerative analysis and steady state distributions for Markov
chains"; why the error of each single entry is small, whatever the chain: O'Cinneide (1993),
"Entrywise perturbation theory and error analysis for Markov chains".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import solve_triangular

from nichechain.core.compiled import compiled
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# States eliminated together: their part of the matrix fits a processor's inner cache.
_BLOCK = 64
# Visits beyond this are scaled back before they overflow.
_LARGE = 1e250


@dataclass(frozen=True)
class Dense:
    """I − Q = L U of any Q: 8 m² bytes, 2/3 m³ operations.

    Parameters
    ----------
    factors : (m, m) float64 array
        U on and above the diagonal, L below it; L has ones on its diagonal.
    """

    factors: Floats

    @classmethod
    def of(cls, onward: Floats, leaving: Floats) -> Dense:
        """Eliminate all states, the first one first.

        Parameters
        ----------
        onward : (m, m) float64 array
            Probabilities from state to state; the diagonal is ignored. Overwritten.
        leaving : (m,) float64 array
            Probability of leaving the set from each state; all 0 where nothing leaves it.

        Raises
        ------
        NichechainError
            If a product of probabilities underflows to 0.
        """
        size, closed = leaving.size, not leaving.any()
        out = leaving.copy()
        np.fill_diagonal(onward, 0.0)
        for start in range(0, size, _BLOCK):
            end = min(start + _BLOCK, size)
            beyond = onward[start:end, end:].sum(axis=1) + out[start:end]
            if not _eliminate_block(onward, out, beyond, start, end, closed):
                raise _underflow()
            if end < size:
                below = onward[end:, start:end]
                onward[end:, end:] += below @ onward[start:end, end:]
                out[end:] += below @ out[start:end]
                later = np.arange(end, size)
                onward[later, later] = 0.0
        pivots = np.diagonal(onward).copy()
        factors = np.negative(onward, out=onward)
        np.fill_diagonal(factors, pivots)
        return cls(factors)

    def solve(self, right: Floats) -> Floats:
        """The x with (I − Q) x = b, for b (m,) or (m, c) that is not negative."""
        # Off their diagonals the factors are negative: whatever is subtracted here is added.
        half = solve_triangular(self.factors, right, lower=True, unit_diagonal=True, check_finite=False)
        return np.asarray(solve_triangular(self.factors, half, check_finite=False))

    def solve_transposed(self, right: Floats) -> Floats:
        """The x with x (I − Q) = b, for b (m,) that is not negative."""
        half = solve_triangular(self.factors, right, trans=1, check_finite=False)
        return np.asarray(
            solve_triangular(self.factors, half, trans=1, lower=True, unit_diagonal=True, check_finite=False)
        )

    def visits(self) -> Floats:
        """Stationary measure of a set that nothing leaves, (m,): the largest is 1."""
        return _of_largest(_visits(self.factors))


@dataclass(frozen=True)
class Banded:
    """The same for transitions between states that lie near one another in some order: 16 m w bytes.

    Parameters
    ----------
    band : (m, 2 w + 1) float64 array
        Entry (i, j) of the factors, in that order of the states, at ``band[i, j - i + w]``.
    order : (m,) int64 array
        The states in that order.
    """

    band: Floats
    order: Ints

    @classmethod
    def of(cls, onward: sparse.csr_array, leaving: Floats, order: Ints, width: int) -> Banded:
        """Eliminate all states, in the given order.

        Parameters
        ----------
        onward : (m, m) scipy.sparse.csr_array
            Probabilities from state to state.
        leaving : (m,) float64 array
            Probability of leaving the set from each state; all 0 where nothing leaves it.
        order : (m,) int64 array
            In which no transition goes further than ``width``.
        width : int

        Raises
        ------
        NichechainError
            If a product of probabilities underflows to 0.
        """
        place = np.empty_like(order)
        place[order] = np.arange(order.size)
        entries = onward.tocoo()
        row, column = place[entries.coords[0]], place[entries.coords[1]]
        band = np.zeros((order.size, 2 * width + 1))
        band[row, column - row + width] = entries.data
        band[:, width] = 0.0
        if not _eliminate_band(band, leaving[order], not leaving.any()):
            raise _underflow()
        return cls(band, order)

    def solve(self, right: Floats) -> Floats:
        """The x with (I − Q) x = b, for b (m,) that is not negative."""
        return self._back(_solve_band(self.band, right[self.order]))

    def solve_transposed(self, right: Floats) -> Floats:
        """The x with x (I − Q) = b, for b (m,) that is not negative."""
        return self._back(_solve_band_transposed(self.band, right[self.order]))

    def visits(self) -> Floats:
        """Stationary measure of a set that nothing leaves, (m,): the largest is 1."""
        return _of_largest(self._back(_visits_of_band(self.band)))

    def _back(self, ordered: Floats) -> Floats:
        found = np.empty_like(ordered)
        found[self.order] = ordered
        return found


def _underflow() -> NichechainError:
    return NichechainError(
        "products of this chain's probabilities are below 1e-308, too small for floating-point numbers"
    )


def _of_largest(visits: Floats) -> Floats:
    largest = visits.max()
    if not np.isfinite(largest):
        raise _underflow()
    shares: Floats = visits / largest
    return shares


@compiled
def _eliminate_block(onward: Any, out: Any, beyond: Any, start: Any, end: Any, closed: Any) -> Any:
    """Eliminate states of a block from its own rows and columns; whether all of them are ever left.

    ``beyond`` is the probability of getting from each of them past the block. Rows of later states
    get their factors, and what leads to later states is passed on within the block.
    """
    size = onward.shape[0]
    for k in range(start, end):
        pivot = beyond[k - start]
        for j in range(k + 1, end):
            pivot += onward[k, j]
        if not pivot > 0.0:
            if not (closed and k == size - 1):
                return False
            pivot = 1.0
        onward[k, k] = pivot
        for i in range(k + 1, end):
            factor = onward[i, k] / pivot
            onward[i, k] = factor
            if factor == 0.0:
                continue
            for j in range(k + 1, end):
                onward[i, j] += factor * onward[k, j]
            for j in range(end, size):
                onward[i, j] += factor * onward[k, j]
            beyond[i - start] += factor * beyond[k - start]
            out[i] += factor * out[k]
            onward[i, i] = 0.0
    for i in range(end, size):
        for k in range(start, end):
            factor = onward[i, k] / onward[k, k]
            onward[i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, end):
                    onward[i, j] += factor * onward[k, j]
    return True


@compiled
def _visits(factors: Any) -> Any:
    """Visits to each state relative to the last one, from the factors' lower part, scaled."""
    size = factors.shape[0]
    visits = np.zeros(size)
    visits[size - 1] = 1.0
    for i in range(size - 1, 0, -1):
        if visits[i] > _LARGE:
            visits /= visits[i]
        for k in range(i):
            visits[k] -= visits[i] * factors[i, k]
    return visits


@compiled
def _eliminate_band(band: Any, leaving: Any, closed: Any) -> Any:
    """Factorise a band in place; whether all states are ever left."""
    size, width = band.shape[0], band.shape[1] // 2
    for k in range(size):
        ahead = min(width, size - 1 - k)
        pivot = leaving[k]
        for step in range(1, ahead + 1):
            pivot += band[k, width + step]
        if not pivot > 0.0:
            if not (closed and k == size - 1):
                return False
            pivot = 1.0
        band[k, width] = pivot
        for down in range(1, ahead + 1):
            factor = band[k + down, width - down] / pivot
            band[k + down, width - down] = factor
            if factor == 0.0:
                continue
            for step in range(1, ahead + 1):
                band[k + down, width - down + step] += factor * band[k, width + step]
            leaving[k + down] += factor * leaving[k]
            band[k + down, width] = 0.0
    return True


@compiled
def _solve_band(band: Any, right: Any) -> Any:
    size, width = band.shape[0], band.shape[1] // 2
    found = right.copy()
    for i in range(size):
        for back in range(1, min(width, i) + 1):
            found[i] += band[i, width - back] * found[i - back]
    for k in range(size - 1, -1, -1):
        for step in range(1, min(width, size - 1 - k) + 1):
            found[k] += band[k, width + step] * found[k + step]
        found[k] /= band[k, width]
    return found


@compiled
def _solve_band_transposed(band: Any, right: Any) -> Any:
    size, width = band.shape[0], band.shape[1] // 2
    found = right.copy()
    for k in range(size):
        found[k] /= band[k, width]
        for step in range(1, min(width, size - 1 - k) + 1):
            found[k + step] += band[k, width + step] * found[k]
    for i in range(size - 1, -1, -1):
        for back in range(1, min(width, i) + 1):
            found[i - back] += band[i, width - back] * found[i]
    return found


@compiled
def _visits_of_band(band: Any) -> Any:
    """Visits to each state relative to the last one, scaled."""
    size, width = band.shape[0], band.shape[1] // 2
    visits = np.zeros(size)
    visits[size - 1] = 1.0
    for i in range(size - 1, 0, -1):
        if visits[i] > _LARGE:
            visits /= visits[i]
        for back in range(1, min(width, i) + 1):
            visits[i - back] += band[i, width - back] * visits[i]
    return visits
