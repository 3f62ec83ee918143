"""T without its S² numbers: what births say one by one, and a base measure that all rows share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft, sparse

from nichechain.chain.base_measure import BaseMeasure

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Columns transformed together: their spectra are four times as large as they are themselves.
_COLUMNS = 32


@dataclass(frozen=True)
class PooledTransition:
    """Rows of T as a sum of parts: sparse, of low rank, and a stencil over the grid.

    T_ij is ``kept[i, j] + (shares @ pools)[i, j] + spread[i] * kernel[displacement from i to j]``,
    the last where j is a niche. It multiplies from either side; products with the stencil are
    made with fast Fourier transforms, exact to rounding.

    Parameters
    ----------
    kept : (m, S) scipy.sparse.csr_array
    shares : (m, r) float64 array
    pools : (r, S) float64 array
    spread : (m,) float64 array
        0 for the outside state, which nothing is displaced from.
    cell : (m,) int64 array
        Niche that each row is displaced from.
    kernel : float64 array of shape (2 k - 1, ...) for k cells along an axis
    """

    kept: sparse.csr_array
    shares: Floats
    pools: Floats
    spread: Floats
    cell: Ints
    kernel: Floats

    # Arrays leave products with this to its own method.
    __array_ufunc__ = None

    @classmethod
    def of(cls, kept: sparse.csr_array, prior: Floats, base: BaseMeasure) -> PooledTransition:
        """The map ``kept[i, j] + prior[i] * B_ij``.

        Parameters
        ----------
        kept : (S, S) scipy.sparse.csr_array
        prior : (S,) float64 array
        base : BaseMeasure
            B.
        """
        states, n = base.niches.states, len(base.niches)
        anywhere, displaced, uniform = base.weights
        outside = np.arange(states) >= n
        shares = np.stack(
            [
                # A parent outside is displaced from no cell: its children land as any do.
                prior * np.where(outside, anywhere + displaced, anywhere),
                prior * uniform,
                prior * np.where(outside, 0.0, displaced * base.leaving),
            ],
            axis=1,
        )
        pools = np.stack([base.destination, np.full(states, 1.0 / states), outside.astype(np.float64)])
        spread = np.zeros(states)
        spread[:n] = prior[:n] * displaced * (1.0 - base.leaving) / base.within
        return cls(kept, shares, pools, spread, np.where(outside, 0, np.arange(states)), base.displacement)

    @classmethod
    def shared(cls, kept: sparse.csr_array, share: Floats, pool: Floats) -> PooledTransition:
        """The map ``kept[i, j] + share[i] * pool[j]``, of an (S, S) array and two (S,) arrays."""
        nowhere = np.zeros(share.size)
        cell = np.zeros(share.size, np.int64)
        return cls(kept, share[:, None], pool[None, :], nowhere, cell, np.ones(1))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.spread.size, self.pools.shape[1]

    def __getitem__(self, rows: Ints | Sequence[int]) -> PooledTransition:
        """Some of the rows, in the same form."""
        index = np.asarray(rows)
        return replace(
            self,
            kept=self.kept[index],
            shares=self.shares[index],
            spread=self.spread[index],
            cell=self.cell[index],
        )

    def __matmul__(self, other: Floats) -> Floats:
        """Product with an (S,) or (S, c) array."""
        product: Floats = self.kept @ other + self.shares @ (self.pools @ other)
        if self.spread.any():
            columns, result = other.reshape(len(other), -1), product.reshape(len(product), -1)
            for block in _blocks(columns.shape[1]):
                near = self._stencil(columns[: self._niches, block].T, self._spectrum)
                result[:, block] += self.spread[:, None] * near.T[self.cell]
        return product

    def __rmatmul__(self, other: Floats | sparse.csr_array) -> Floats:
        """Product of an (m,) or (c, m) array, or of a sparse (c, m) array, with this."""
        left = other if isinstance(other, np.ndarray) else other.toarray()
        product: Floats = left @ self.kept + (left @ self.shares) @ self.pools
        if self.spread.any():
            rows, result = left.reshape(-1, left.shape[-1]), product.reshape(-1, product.shape[-1])
            for block in _blocks(len(rows)):
                # Several rows may start from one niche, so that they have to be added up.
                weight = np.zeros((len(rows[block]), self._niches))
                np.add.at(weight.T, self.cell, (rows[block] * self.spread).T)
                result[block, : self._niches] += self._stencil(weight, self._spectrum.conj())
        return product

    def toarray(self) -> Floats:
        """The matrix, dense: 8 m S bytes."""
        whole: Floats = self.kept.toarray()
        whole += self.shares @ self.pools
        for row in np.flatnonzero(self.spread):
            start = np.unravel_index(self.cell[row], self._grid)
            seen = tuple(slice(k - 1 - i, 2 * k - 1 - i) for i, k in zip(start, self._grid, strict=True))
            whole[row, : self._niches] += self.spread[row] * self.kernel[seen].ravel()
        return whole

    @property
    def _grid(self) -> tuple[int, ...]:
        return tuple((side + 1) // 2 for side in self.kernel.shape)

    @property
    def _niches(self) -> int:
        return int(np.prod(self._grid))

    @property
    def _padded(self) -> list[int]:
        # No displacement within the grid wraps around a torus of this size onto another cell.
        return [fft.next_fast_len(side, real=True) for side in self.kernel.shape]

    @cached_property
    def _spectrum(self) -> NDArray[np.complex128]:
        """Transform of the kernel as a correlation takes it: backwards, no displacement first."""
        torus = np.zeros(self._padded)
        torus[tuple(slice(side) for side in self.kernel.shape)] = np.flip(self.kernel)
        torus = np.roll(torus, [1 - k for k in self._grid], axis=tuple(range(torus.ndim)))
        transformed: NDArray[np.complex128] = fft.rfftn(torus)
        return transformed

    def _stencil(self, values: Floats, spectrum: NDArray[np.complex128]) -> Floats:
        """Each row of values (c, n) correlated or convolved with the kernel, on the grid."""
        axes = tuple(range(1, len(self._grid) + 1))
        moved = fft.rfftn(values.reshape(-1, *self._grid), self._padded, axes=axes)
        moved *= spectrum
        whole = fft.irfftn(moved, self._padded, axes=axes, overwrite_x=True)
        within: Floats = whole[(slice(None), *(slice(k) for k in self._grid))]
        return within.reshape(len(values), -1)


def _blocks(size: int) -> list[slice]:
    return [slice(start, start + _COLUMNS) for start in range(0, size, _COLUMNS)]
