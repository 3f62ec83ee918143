"""Where children land before we know whose they are: the base measure of a Dirichlet row.

Three guesses, mixed: (a) where children land anywhere, (b) as far from the parent as children
land anywhere, (c) anywhere alike. A niche of few births borrows from them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.signal import fftconvolve

from nichechain.alias import RowSampler
from nichechain.chain.counts import TransitionCounts
from nichechain.niches import GridNiches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class BaseMeasure:
    """Rows B_i, pooled over all births, as three components and their weights.

    Parameters
    ----------
    niches : GridNiches
    destination : (S,) float64 array
        Share of births in each state.
    displacement : float64 array of shape (2 k - 1, ...) for k cells along an axis
        Share of each displacement, in cells, among births inside of parents inside.
    leaving : float
        Share of births outside, among births of parents inside.
    weights : (3,) float64 array
        Of destination, displacement and uniform.
    """

    niches: GridNiches
    destination: Floats
    displacement: Floats
    leaving: float
    weights: Floats

    @classmethod
    def pooled(cls, counts: TransitionCounts, weights: Floats) -> BaseMeasure:
        """The base measure of these counts, with the given weights."""
        niches = counts.niches
        n = len(niches)
        entries = counts.matrix.tocoo()
        parent, child, count = entries.coords[0], entries.coords[1], entries.data
        # One imaginary birth, spread over all states, keeps every share positive.
        destination = np.bincount(child, count, niches.states) + 1.0 / niches.states
        inside = (parent < n) & (child < n)
        kernel = np.zeros(tuple(2 * k - 1 for k in niches.shape))
        np.add.at(kernel, _cells_apart(niches, parent[inside], child[inside]), count[inside])
        # Half a birth at no distance keeps the kernel usable from every niche.
        kernel[tuple(k - 1 for k in niches.shape)] += 0.5
        left = count[(parent < n) & (child >= n)].sum() if niches.states > n else 0
        leaving = left / max(1, left + count[inside].sum())
        return cls(niches, destination / destination.sum(), kernel / kernel.sum(), float(leaving), weights)

    def components(self, parent: Ints, child: Ints) -> Floats:
        """Probability of each pair under each component, (3, N).

        Parameters
        ----------
        parent, child : (N,) int64 arrays
        """
        return np.stack(
            [
                self.destination[child],
                self._displaced(parent, child),
                np.full(child.size, 1.0 / self.niches.states),
            ]
        )

    def probability(self, parent: Ints, child: Ints) -> Floats:
        """B_ij for each pair, (N,)."""
        mixed: Floats = self.weights @ self.components(parent, child)
        return mixed

    def rows(self, parent: Ints) -> Floats:
        """Whole rows B_i, (N, S)."""
        states = np.arange(self.niches.states)
        pairs = np.repeat(parent, states.size), np.tile(states, parent.size)
        return self.probability(*pairs).reshape(parent.size, states.size)

    def sample(self, parent: Ints, rng: np.random.Generator) -> Ints:
        """One state drawn from B_i for each parent state, any shape."""
        flat = parent.ravel()
        pooled, displaced_too = np.cumsum(self.weights)[:2]
        kind = rng.random(flat.size)
        child = _draw(self._destinations, flat.size, rng)
        uniform = kind >= displaced_too
        child[uniform] = rng.integers(self.niches.states, size=int(uniform.sum()))
        displaced = np.flatnonzero((kind >= pooled) & ~uniform)
        child[displaced] = self._sample_displaced(flat[displaced], rng)
        return child.reshape(parent.shape)

    def _displaced(self, parent: Ints, child: Ints) -> Floats:
        n = len(self.niches)
        # A parent outside has no cell to be displaced from; neither has a child outside.
        result = np.where(parent < n, np.where(child < n, 0.0, self.leaving), self.destination[child])
        inside = (parent < n) & (child < n)
        where = _cells_apart(self.niches, parent[inside], child[inside])
        share = self.displacement[where] / self.within[parent[inside]]
        result[inside] = (1.0 - self.leaving) * share
        return result

    @cached_property
    def _destinations(self) -> RowSampler:
        return RowSampler(sparse.csr_array(self.destination[None, :]))

    @cached_property
    def _displacements(self) -> RowSampler:
        return RowSampler(sparse.csr_array(self.displacement.reshape(1, -1)))

    @property
    def within(self) -> Floats:
        """Share of the kernel that stays in the grid, for a parent in each niche, (n,)."""
        # Correlation of the kernel with the grid's indicator.
        flipped = np.flip(self.displacement)
        stays = fftconvolve(flipped, np.ones(self.niches.shape), mode="valid")
        within: Floats = np.maximum(stays.ravel(), self.displacement[tuple(k - 1 for k in self.niches.shape)])
        return within

    def _sample_displaced(self, parent: Ints, rng: np.random.Generator) -> Ints:
        n = len(self.niches)
        shape = np.array(self.niches.shape)
        child = np.full(parent.size, n, np.int64)
        outsiders = parent >= n
        child[outsiders] = _draw(self._destinations, int(outsiders.sum()), rng)
        open_ = np.flatnonzero(~outsiders & (rng.random(parent.size) >= self.leaving))
        # Drawing again whatever lands off the grid conditions the kernel on staying in it.
        while open_.size:
            cells = np.stack(np.unravel_index(parent[open_], self.niches.shape), axis=1)
            moves = _draw(self._displacements, open_.size, rng)
            step = np.stack(np.unravel_index(moves, self.displacement.shape), axis=1) - (shape - 1)
            landed = cells + step
            stays = ((landed >= 0) & (landed < shape)).all(axis=1)
            child[open_[stays]] = np.ravel_multi_index(tuple(landed[stays].T), self.niches.shape)
            open_ = open_[~stays]
        return child


def _cells_apart(niches: GridNiches, parent: Ints, child: Ints) -> tuple[Ints, ...]:
    """Index into the displacement kernel for each pair of niches."""
    start = np.unravel_index(parent, niches.shape)
    end = np.unravel_index(child, niches.shape)
    return tuple((b - a + k - 1).astype(np.int64) for a, b, k in zip(start, end, niches.shape, strict=True))


def _draw(sampler: RowSampler, size: int, rng: np.random.Generator) -> Ints:
    return sampler.draw(np.zeros(size, np.int64), rng)
