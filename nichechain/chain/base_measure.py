"""Where children land before we know whose they are: the base measure of a Dirichlet row.

Guesses that all niches share, mixed: (a) where children land anywhere, (b) as far from the parent as
children land anywhere, (c) anywhere alike; and beside them what births of neighbouring niches say. A
niche of few births borrows from them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.counts import TransitionCounts
from nichechain.chain.displacement import Displacement, GridDisplacement
from nichechain.chain.distance import DistanceDisplacement
from nichechain.chain.neighbours import NearRows
from nichechain.core.row_sampler import RowSampler
from nichechain.niches import GridNiches, Niches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class BaseMeasure:
    """Rows B_i, pooled over births: three components with their weights, and what neighbours say.

    B_i = near_i + (1 − Σ_j near_ij) (w_1 destination + w_2 displacement_i + w_3 / S).

    Parameters
    ----------
    niches : Niches
    destination : (S,) float64 array
        Share of births in each state.
    displacement : Displacement
        How far children land, among births inside of parents inside: on a grid in cells along each
        axis, elsewhere by distance.
    leaving : float
        Share of births outside, among births of parents inside.
    weights : (3,) float64 array
        Of destination, displacement and uniform.
    near : NearRows, optional
        The part of every row that neighbours speak for; by default none.
    """

    niches: Niches
    destination: Floats
    displacement: Displacement
    leaving: float
    weights: Floats
    near: NearRows | None = None

    @classmethod
    def pooled(cls, counts: TransitionCounts, weights: Floats) -> BaseMeasure:
        """The base measure in which each component is made of all births, with the given weights."""
        entries = counts.matrix.tocoo()
        parent, child = (axis.astype(np.int64) for axis in entries.coords)
        births = entries.data.astype(np.float64)
        return cls.of_births(counts.niches, parent, child, births, births, weights)

    @classmethod
    def of_births(
        cls,
        niches: Niches,
        parent: Ints,
        child: Ints,
        landing: Floats,
        moving: Floats,
        weights: Floats,
        near: NearRows | None = None,
    ) -> BaseMeasure:
        """The base measure of pairs of states, each of which stands for some births of either kind.

        Parameters
        ----------
        niches : Niches
        parent, child : (E,) int64 arrays
        landing, moving : (E,) float64 arrays
            Births of each pair that destination, and that displacement is made of.
        weights, near
            As in :class:`BaseMeasure`.
        """
        n = len(niches)
        # One imaginary birth, spread over all states, keeps every share positive.
        destination = np.bincount(child, landing, niches.states) + 1.0 / niches.states
        inside = (parent < n) & (child < n)
        apart = parent[inside], child[inside], moving[inside]
        displacement: Displacement
        if isinstance(niches, GridNiches):
            displacement = GridDisplacement.pooled(niches, *apart)
        else:
            displacement = DistanceDisplacement.pooled(niches, *apart)
        left = moving[(parent < n) & (child >= n)].sum()
        leaving = left / max(1.0, left + moving[inside].sum())
        return cls(niches, destination / destination.sum(), displacement, float(leaving), weights, near)

    def components(self, parent: Ints, child: Ints) -> Floats:
        """Probability of each pair under each component, (3, N).

        Parameters
        ----------
        parent, child : (N,) int64 arrays
        """
        return np.stack(
            [
                self.destination[child],
                self.displaced(parent, child),
                np.full(child.size, 1.0 / self.niches.states),
            ]
        )

    def probability(self, parent: Ints, child: Ints) -> Floats:
        """B_ij for each pair, (N,)."""
        mixed: Floats = self.weights @ self.components(parent, child)
        if self.near is not None and parent.size:
            mixed *= self.shared[parent]
            mixed += self.near.at(parent, child)
        return mixed

    def rows(self, parent: Ints) -> Floats:
        """Whole rows B_i, (N, S)."""
        n, states = len(self.niches), self.niches.states
        anywhere, displaced, uniform = self.weights
        mixed = np.empty((parent.size, states))
        mixed[:] = anywhere * self.destination + uniform / states
        inside = parent < n
        places = parent[inside]
        share = (displaced * (1.0 - self.leaving) / self.within[places])[:, None]
        moved = np.full((places.size, states), displaced * self.leaving)
        moved[:, :n] = share * self.displacement.rows(places)
        mixed[inside] += moved
        mixed[~inside] += displaced * self.destination
        if self.near is not None and parent.size:
            mixed *= self.shared[parent, None]
            mixed += self.near.matrix[parent].toarray()
        return mixed

    @cached_property
    def shared(self) -> Floats:
        """The part of every row that is left to the components, (S,)."""
        if self.near is None:
            return np.ones(self.niches.states)
        left: Floats = np.maximum(1.0 - self.near.mass, 0.0)
        return left

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
        if self.near is not None:
            told = np.flatnonzero(rng.random(flat.size) >= self.shared[flat])
            child[told] = self.near.sample(flat[told], rng)
        return child.reshape(parent.shape)

    def displaced(self, parent: Ints, child: Ints) -> Floats:
        """Probability of each pair under displacement, (N,): destination's where the parent is outside."""
        n = len(self.niches)
        # A parent outside has no cell to be displaced from; neither has a child outside.
        result = np.where(parent < n, np.where(child < n, 0.0, self.leaving), self.destination[child])
        inside = (parent < n) & (child < n)
        share = self.displacement.at(parent[inside], child[inside]) / self.within[parent[inside]]
        result[inside] = (1.0 - self.leaving) * share
        return result

    @cached_property
    def _destinations(self) -> RowSampler:
        return RowSampler(sparse.csr_array(self.destination[None, :]))

    @property
    def within(self) -> Floats:
        """Weight of all niches together as children of a parent in each niche, (n,)."""
        return self.displacement.within

    def _sample_displaced(self, parent: Ints, rng: np.random.Generator) -> Ints:
        n = len(self.niches)
        child = np.full(parent.size, n, np.int64)
        outsiders = parent >= n
        child[outsiders] = _draw(self._destinations, int(outsiders.sum()), rng)
        open_ = np.flatnonzero(~outsiders & (rng.random(parent.size) >= self.leaving))
        child[open_] = self.displacement.sample(parent[open_], rng)
        return child


def _draw(sampler: RowSampler, size: int, rng: np.random.Generator) -> Ints:
    return sampler.draw(np.zeros(size, np.int64), rng)
