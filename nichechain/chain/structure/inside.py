"""Lineages inside a set of states until they leave it: what questions about passage come down to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import reverse_cuthill_mckee
from scipy.sparse.linalg import LinearOperator, bicgstab, gmres

from nichechain.chain.operator import PooledTransition
from nichechain.chain.structure.elimination import Banded, Dense
from nichechain.chain.structure.transitions import Rows
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Up to here elimination takes a second or two, and every entry is right.
_SMALL = 2_000
# What elimination takes on where iterations fail: 320 MB, or 800 MB of a band, and minutes at most.
_DENSE_STATES = 6_000
_BAND_CELLS = 100_000_000
_BAND_WORK = 100_000_000_000
# A band that is eliminated in less time than iterations are likely to take.
_LITTLE_WORK = 1_000_000_000
# What is proven of an iterated solution; it is usually better by far.
_TOLERANCE = 1e-6
_ROUNDS = 4
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Inside:
    """A set of m states, and what leads within it and out of it.

    Parameters
    ----------
    onward : (m, m) scipy.sparse.csr_array or PooledTransition
        Probabilities from one state of the set to another. A csr_array has no diagonal; parts are
        those of the whole T, see ``states``.
    leaving : (m,) float64 array
        Probability of leaving the set in one generation, from each state.
    states : (m,) int64 array
        Numbers of the states in the whole chain.

    Notes
    -----
    Up to 2,000 states, and for any number whose transitions form a narrow band, states are
    eliminated one by one and every entry is right to nearly all digits
    (:mod:`nichechain.chain.structure.elimination`). Beyond that BiCGSTAB (van der Vorst 1992) and then
    restarted GMRES iterate on (I − Q) x = b, and a solution counts only if it is proven: (I − Q) has
    an inverse without negative entries, so |b − (I − Q) x| ≤ ε b proves that no entry is off by more
    than the share ε of it; where b has zeros, the largest residual times the longest mean time inside
    bounds every error. Where that is not within 1e-6, states are eliminated after all as long as
    that fits in memory.
    """

    onward: Rows
    leaving: Floats
    states: Ints

    @classmethod
    def of(cls, rows: Rows, states: Ints) -> Inside:
        """The set of some states of T (S, S)."""
        elsewhere = np.ones(rows.shape[0])
        elsewhere[states] = 0.0
        if isinstance(rows, PooledTransition):
            # Fourier transforms leave rounding below zero.
            return cls(rows, np.maximum((rows @ elsewhere)[states], 0.0), states)
        some = rows[states] if states.size else sparse.csr_array((0, rows.shape[1]))
        inner = sparse.coo_array(some[:, states]) if states.size else sparse.coo_array((0, 0))
        apart = inner.coords[0] != inner.coords[1]
        index = inner.coords[0][apart], inner.coords[1][apart]
        onward = sparse.csr_array((inner.data[apart], index), shape=inner.shape)
        return cls(onward, some @ elsewhere, states)

    @property
    def size(self) -> int:
        """M."""
        return self.states.size

    @cached_property
    def rate(self) -> Floats:
        """Probability of getting from each state to any other place, (m,)."""
        if isinstance(self.onward, PooledTransition):
            return np.ones(self.size)
        rate: Floats = np.asarray(self.onward.sum(axis=1)).ravel() + self.leaving
        return rate

    def solve(self, right: Floats) -> Floats:
        """The x with (I − Q) x = b.

        Parameters
        ----------
        right : (m,) float64 array
            b, not negative.

        Raises
        ------
        NichechainError
            If no method comes close enough.
        """
        return self._solved(right, transposed=False)

    def solve_transposed(self, right: Floats) -> Floats:
        """The x with x (I − Q) = b, b (m,) not negative; errors as those of :meth:`solve`."""
        return self._solved(right, transposed=True)

    def visits(self) -> Floats | None:
        """Stationary measure where nothing leaves the set; None where elimination takes too long."""
        return None if self.at_once is None else self.at_once.visits()

    @cached_property
    def times(self) -> Floats:
        """Mean number of generations until a lineage leaves, (m,)."""
        return self.solve(np.ones(self.size))

    @cached_property
    def eliminated(self) -> Dense | Banded | None:
        """Factors of I − Q; None where they would not fit."""
        if isinstance(self.onward, PooledTransition):
            return None
        order, width = self._band
        band_work = self.size * max(1, width) ** 2
        if self.size <= _DENSE_STATES and not band_work < self.size**3 // 4:
            return Dense.of(self.onward.toarray(), self.leaving)
        if self.size * (2 * width + 1) <= _BAND_CELLS and band_work <= _BAND_WORK:
            return Banded.of(self.onward, self.leaving, order, width)
        return None

    @cached_property
    def at_once(self) -> Dense | Banded | None:
        """Factors where they take little time."""
        if isinstance(self.onward, PooledTransition):
            return None
        if self.size <= _SMALL or self.size * self._band[1] ** 2 <= _LITTLE_WORK:
            return self.eliminated
        return None

    @cached_property
    def _band(self) -> tuple[Ints, int]:
        """An order of the states, and how far transitions then go at most."""
        assert isinstance(self.onward, sparse.csr_array)
        order = reverse_cuthill_mckee(sparse.csr_matrix(self.onward), symmetric_mode=False).astype(np.int64)
        place = np.empty_like(order)
        place[order] = np.arange(order.size)
        row, column = self.onward.tocoo().coords
        return order, int(np.abs(place[row] - place[column]).max(initial=0))

    def _solved(self, right: Floats, *, transposed: bool) -> Floats:
        if not right.any():
            return np.zeros(self.size)
        factors = self.at_once
        if factors is None:
            found = self._iterated(right, transposed=transposed)
            if found is not None:
                return found
            factors = self.eliminated
        if factors is None:
            raise NichechainError(
                f"passage between {self.size} states cannot be solved: iterations do not converge "
                "and elimination of states would not fit in memory"
            )
        solution = factors.solve_transposed(right) if transposed else factors.solve(right)
        if not np.isfinite(solution).all():
            raise NichechainError(
                "from some states it takes more than 1e308 generations to get out, "
                "which is beyond floating-point numbers"
            )
        return solution

    def _iterated(self, right: Floats, *, transposed: bool) -> Floats | None:
        """A solution that is proven to be close, or None."""
        whole = LinearOperator(
            (self.size, self.size), lambda x: self._apply(x.ravel(), transposed=transposed), dtype=np.float64
        )
        # Steps of lineages that stay are left out: the system of the next different state.
        scaled = LinearOperator(whole.shape, lambda x: x.ravel() / self.rate, dtype=np.float64)
        for iterate in (_bicgstab, _gmres):
            found = np.zeros(self.size)
            left = right
            for _ in range(_ROUNDS):
                found = found + iterate(whole, scaled, left)
                left = right - self._apply(found, transposed=transposed)
                if not np.isfinite(left).all():
                    break
                if self._proven(found, np.abs(left), right, transposed=transposed):
                    return np.maximum(found, 0.0)
                if self._rounding(found, right).max() > right.max():
                    # So large a solution can never be proven.
                    return None
        return None

    def _proven(self, found: Floats, residual: Floats, right: Floats, *, transposed: bool) -> bool:
        doubt = residual + self._rounding(found, right)
        if (doubt <= _TOLERANCE * right).all():
            return True
        if doubt.max() > _TOLERANCE * right.max():
            return False
        if not transposed and (right == right[0]).all():
            # These are the times themselves.
            return False
        try:
            times = self.times
        except NichechainError:
            return False
        error = float(doubt @ times if transposed else doubt.max() * times.max())
        scale = float(np.abs(found).sum() if transposed else np.abs(found).max())
        return error <= _TOLERANCE * scale

    def _rounding(self, found: Floats, right: Floats) -> Floats:
        """What rounding leaves in a residual, at most."""
        rounding: Floats = 8.0 * _EPS * (2.0 * self.rate * np.abs(found) + right)
        return rounding

    def _apply(self, values: Floats, *, transposed: bool) -> Floats:
        """(I − Q) x, or x (I − Q)."""
        if isinstance(self.onward, PooledTransition):
            everywhere = np.zeros(self.onward.shape[0])
            everywhere[self.states] = values
            moved = everywhere @ self.onward if transposed else self.onward @ everywhere
            return values - moved[self.states]
        product: Floats = self.rate * values - (values @ self.onward if transposed else self.onward @ values)
        return product


def _bicgstab(matrix: LinearOperator, scaled: LinearOperator, right: Floats) -> Floats:
    solution: Floats = bicgstab(matrix, right, rtol=1e-11, maxiter=2_000, M=scaled)[0]
    return solution


def _gmres(matrix: LinearOperator, scaled: LinearOperator, right: Floats) -> Floats:
    solution: Floats = gmres(matrix, right, rtol=1e-11, restart=100, maxiter=5, M=scaled)[0]
    return solution
