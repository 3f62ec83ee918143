"""Births of neighbouring niches as guesses: as they fell, and smoothed where they are few."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.neighbours import NearRows, Neighbours, neighbourhood
from nichechain.chain.smoothing import SpreadPairs, spread_size
from nichechain.niches import GridNiches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Words that are kept at most: of many births, close neighbours say enough, as they fell.
_MOST_WORDS = 10_000_000
_TINY = 1e-9


class NearBirths:
    """What neighbours' births say of pairs of states (E,), landed alike or moved alike.

    Parameters
    ----------
    niches : GridNiches
    parent, child : (E,) int64 arrays
        Pairs, each once and sorted.
    """

    def __init__(self, niches: GridNiches, parent: Ints, child: Ints) -> None:
        words = parent.size * spread_size(niches) * neighbourhood(niches, far=True)
        self._spread = SpreadPairs.of(niches, parent, child) if words <= _MOST_WORDS else None
        if self._spread is None:
            self._neighbours = Neighbours(niches, parent, child, np.arange(parent.size), far=False)
        else:
            pairs = self._spread.parent, self._spread.child, self._spread.place
            self._neighbours = Neighbours(niches, *pairs, far=True)

    def expected(self, landing: Floats, moving: Floats) -> list[Floats]:
        """What is said of each pair when births of each pair (E,) landed, and moved, alike: four of (E,).

        That of landing, as it fell and smoothed, then that of moving.
        """
        sharp = blunt = self._neighbours.shares(self._sharp(landing), self._sharp(moving))
        if self._spread is not None:
            blunt = self._neighbours.shares(self._spread.smooth(landing), self._spread.smooth(moving))
        return [sharp[0], blunt[0], sharp[1], blunt[1]]

    def rows(self, landing: Floats, moving: Floats, weights: Floats) -> NearRows:
        """The same for all pairs of states, times the weights (4,) of the four."""
        sharp, blunt = weights.reshape(2, 2).T
        parts = []
        for births, share in zip((landing, moving), blunt / np.maximum(sharp + blunt, _TINY), strict=True):
            mixed = self._sharp(births)
            if self._spread is not None:
                mixed = (1.0 - share) * mixed + share * self._spread.smooth(births)
            parts.append(mixed)
        return self._neighbours.rows(parts[0], parts[1], sharp + blunt)

    def _sharp(self, births: Floats) -> Floats:
        return births if self._spread is None else self._spread.sharp(births)
