"""How far children land from their parents, pooled over all niches: one weight for each pair."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.core.row_sampler import RowSampler
from nichechain.niches import GridNiches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Children drawn anew that landed nowhere known; those that are left then are drawn from whole rows.
_PATIENCE = 100


class Displacement(Protocol):
    """Weights K_ij ≥ 0 of pairs of niches, K_ii > 0, that depend on their places alone.

    Given that a child of niche i stays in bounds, it is in niche j with probability
    K_ij / Σ_j K_ij. K is never kept as n × n numbers where there are many niches.
    """

    @property
    def within(self) -> Floats:
        """Σ_j K_ij for every niche, (n,)."""
        ...

    def at(self, parent: Ints, child: Ints) -> Floats:
        """K_ij of some pairs of niches, (N,)."""
        ...

    def rows(self, parent: Ints) -> Floats:
        """K_ij of some parents and all children, (N, n)."""
        ...

    def to_parents(self, values: Floats) -> Floats:
        """Σ_j K_ij x_j for each row x of values (c, n)."""
        ...

    def to_children(self, values: Floats) -> Floats:
        """Σ_i x_i K_ij for each row x of values (c, n)."""
        ...

    def sample(self, parent: Ints, rng: np.random.Generator) -> Ints:
        """A niche in bounds for a child of each parent (N,), which are niches."""
        ...

    def own(self, parent: Ints, child: Ints) -> tuple[Floats, Floats]:
        """What one birth of each pair counts for, in births, (N,) each.

        First in the weight of its pair; then in the weights of all children of its parent. Both
        are 1 where no other niche is displaced from the parent in the same way.
        """
        ...


@dataclass(frozen=True)
class GridDisplacement:
    """On a grid: the share of births with each displacement, in cells, to where anybody was born.

    Parameters
    ----------
    niches : GridNiches
    kernel : float64 array of shape (2 k - 1, ...) for k cells along an axis
        Share of each displacement among births inside of parents inside.
    known : (n,) bool array
        Niches that children are displaced to. To others only a child that stays is.
    """

    niches: GridNiches
    kernel: Floats
    known: Flags

    @classmethod
    def pooled(cls, niches: GridNiches, parent: Ints, child: Ints, count: Ints | Floats) -> GridDisplacement:
        """Displacements of births from niche to niche."""
        kernel = np.zeros(tuple(2 * k - 1 for k in niches.shape))
        np.add.at(kernel, _cells_apart(niches, parent, child), count)
        # Half a birth at no distance keeps the kernel usable from every niche.
        kernel[tuple(k - 1 for k in niches.shape)] += 0.5
        some = np.asarray(count) > 0
        known = np.zeros(len(niches), bool)
        known[parent[some]] = known[child[some]] = True
        return cls(niches, kernel / kernel.sum(), known)

    @property
    def stay(self) -> float:
        """Share of births at no distance."""
        return float(self.kernel[tuple(k - 1 for k in self.niches.shape)])

    @cached_property
    def within(self) -> Floats:
        """Share of the kernel that stays in the grid, for a parent in each niche, (n,)."""
        stays = self.to_parents(np.ones((1, len(self.niches))))[0]
        # What stays where it is is left by rounding, too.
        within: Floats = np.maximum(stays, self.stay)
        return within

    def at(self, parent: Ints, child: Ints) -> Floats:
        """K_ij of some pairs of niches, (N,)."""
        there = self.known[child] | (child == parent)
        found: Floats = np.where(there, self.kernel[_cells_apart(self.niches, parent, child)], 0.0)
        return found

    def rows(self, parent: Ints) -> Floats:
        """K_ij of some parents and all children, (N, n)."""
        shape = self.niches.shape
        # The grid as it lies around a parent is a window of the kernel.
        windows = np.lib.stride_tricks.sliding_window_view(self.kernel, shape)
        start = np.unravel_index(parent, shape)
        seen = tuple(k - 1 - i for i, k in zip(start, shape, strict=True))
        found: Floats = windows[seen].reshape(parent.size, len(self.niches)) * self.known
        found[np.arange(parent.size), parent] = self.stay
        return found

    def to_parents(self, values: Floats) -> Floats:
        """Σ_j K_ij x_j for each row x of values (c, n)."""
        moved: Floats = self._moved(values * self.known, self._spectrum) + self._staying * values
        return moved

    def to_children(self, values: Floats) -> Floats:
        """Σ_i x_i K_ij for each row x of values (c, n)."""
        moved: Floats = self._moved(values, self._spectrum.conj()) * self.known + self._staying * values
        return moved

    @cached_property
    def _staying(self) -> Floats:
        """What is left to those who stay where nobody was born, (n,)."""
        staying: Floats = np.where(self.known, 0.0, self.stay)
        return staying

    def sample(self, parent: Ints, rng: np.random.Generator) -> Ints:
        """A niche in bounds for a child of each parent (N,), which are niches."""
        from nichechain.chain import displacement_steps

        child = np.empty(parent.size, np.int64)
        shape = np.array(self.niches.shape)
        open_ = np.arange(parent.size)
        # Drawing again whatever lands off the grid conditions the kernel on staying in it.
        for _ in range(_PATIENCE):
            if not open_.size:
                break
            moves = self._moves.draw(np.zeros(open_.size, np.int64), rng)
            landed = displacement_steps.landed(parent[open_], moves, shape)
            stays = (landed >= 0) & (self.known[landed] | (landed == parent[open_]))
            child[open_[stays]] = landed[stays]
            open_ = open_[~stays]
        if open_.size:
            far, which = np.unique(parent[open_], return_inverse=True)
            child[open_] = RowSampler(sparse.csr_array(self.rows(far))).draw(which, rng)
        return child

    def own(self, parent: Ints, child: Ints) -> tuple[Floats, Floats]:  # noqa: ARG002
        """Ones: of all niches, one alone is displaced from the parent like this."""
        return np.ones(parent.size), np.ones(parent.size)

    @cached_property
    def _moves(self) -> RowSampler:
        return RowSampler(sparse.csr_array(self.kernel.reshape(1, -1)))

    @property
    def _padded(self) -> list[int]:
        # No displacement within the grid wraps around a torus of this size onto another cell.
        return [_fast(side) for side in self.kernel.shape]

    @cached_property
    def _spectrum(self) -> NDArray[np.complex128]:
        """Transform of the kernel as a correlation takes it: backwards, no displacement first."""
        torus = np.zeros(self._padded)
        torus[tuple(slice(side) for side in self.kernel.shape)] = np.flip(self.kernel)
        torus = np.roll(torus, [1 - k for k in self.niches.shape], axis=tuple(range(torus.ndim)))
        transformed: NDArray[np.complex128] = np.fft.rfftn(torus)
        return transformed

    def _moved(self, values: Floats, spectrum: NDArray[np.complex128]) -> Floats:
        """Each row of values (c, n) correlated or convolved with the kernel, on the grid."""
        shape = self.niches.shape
        axes = tuple(range(1, len(shape) + 1))
        moved = np.fft.rfftn(values.reshape(-1, *shape), self._padded, axes=axes)
        moved *= spectrum
        whole = np.fft.irfftn(moved, self._padded, axes=axes)
        within: Floats = whole[(slice(None), *(slice(k) for k in shape))]
        return within.reshape(len(values), -1)


def _fast(side: int) -> int:
    """The least length from this one on that has no prime factor above 5, which transforms take quickly."""
    rest = side
    for prime in (2, 3, 5):
        while rest % prime == 0:
            rest //= prime
    return side if rest == 1 else _fast(side + 1)


def _cells_apart(niches: GridNiches, parent: Ints, child: Ints) -> tuple[Ints, ...]:
    """Index into the displacement kernel for each pair of niches."""
    start = np.unravel_index(parent, niches.shape)
    end = np.unravel_index(child, niches.shape)
    return tuple((b - a + k - 1).astype(np.int64) for a, b, k in zip(start, end, niches.shape, strict=True))
