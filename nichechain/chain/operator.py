"""T without its S² numbers: what births say one by one, and a base measure that all rows share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.displacement import Displacement

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Columns transformed together: their spectra are four times as large as they are themselves.
_COLUMNS = 32


@dataclass(frozen=True)
class PooledTransition:
    """Rows of T as a sum of parts: sparse, of low rank, and one weight for each displacement.

    T_ij is ``kept[i, j] + (shares @ pools)[i, j] + spread[i] * K_ij``, the last where j is a niche and
    K is that of a :class:`Displacement`. It multiplies from either side; products with K on a grid
    are made with fast Fourier transforms, exact to rounding.

    Parameters
    ----------
    kept : (m, S) scipy.sparse.csr_array
    shares : (m, r) float64 array
    pools : (r, S) float64 array
    spread : (m,) float64 array
        0 for the outside state, which nothing is displaced from.
    cell : (m,) int64 array
        Niche that each row is displaced from.
    displacement : Displacement, optional
        Needed where ``spread`` is not all 0.
    """

    kept: sparse.csr_array
    shares: Floats
    pools: Floats
    spread: Floats
    cell: Ints
    displacement: Displacement | None

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
        if base.near is not None:
            kept = (kept + sparse.diags_array(prior) @ base.near.matrix).tocsr()
            prior = prior * base.shared
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
        return cls(kept, share[:, None], pool[None, :], nowhere, cell, None)

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
        if self.displacement is not None and self.spread.any():
            n = len(self.displacement.within)
            columns, result = other.reshape(len(other), -1), product.reshape(len(product), -1)
            for block in _blocks(columns.shape[1]):
                near = self.displacement.to_parents(columns[:n, block].T)
                result[:, block] += self.spread[:, None] * near.T[self.cell]
        return product

    def __rmatmul__(self, other: Floats | sparse.csr_array) -> Floats:
        """Product of an (m,) or (c, m) array, or of a sparse (c, m) array, with this."""
        left = other if isinstance(other, np.ndarray) else other.toarray()
        product: Floats = left @ self.kept + (left @ self.shares) @ self.pools
        if self.displacement is not None and self.spread.any():
            n = len(self.displacement.within)
            rows, result = left.reshape(-1, left.shape[-1]), product.reshape(-1, product.shape[-1])
            for block in _blocks(len(rows)):
                # Several rows may start from one niche, so that they have to be added up.
                weight = np.zeros((len(rows[block]), n))
                np.add.at(weight.T, self.cell, (rows[block] * self.spread).T)
                result[block, :n] += self.displacement.to_children(weight)
        return product

    def toarray(self) -> Floats:
        """The matrix, dense: 8 m S bytes."""
        whole: Floats = self.kept.toarray()
        whole += self.shares @ self.pools
        for row in np.flatnonzero(self.spread):
            assert self.displacement is not None
            near = self.displacement.rows(self.cell[[row]])[0]
            whole[row, : near.size] += self.spread[row] * near
        return whole


def _blocks(size: int) -> list[slice]:
    return [slice(start, start + _COLUMNS) for start in range(0, size, _COLUMNS)]
