"""Kinds of guesses of where a child lands, made of births of other niches, and mixed to a base measure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.displacement import GridDisplacement
from nichechain.chain.near_births import NearBirths
from nichechain.chain.neighbours import NearRows
from nichechain.chain.smoothing import CENTRE, smoothed_displacement, smoothed_states
from nichechain.niches import GridNiches, Niches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# The pools are never given up: a niche that no neighbour speaks for has nothing else.
_LEAST = 0.01
_TINY = 1e-9
_NOWHERE = np.zeros(3)

# Which births a kind of guess is made of.
_LANDING, _MOVING, _NEAR_LANDING, _NEAR_MOVING = range(4)


class Kinds:
    """Guesses of the child states of some pairs of states (E,).

    On a grid: where children land anywhere, how far they land, where the children of neighbouring niches
    land, and how far, each as they fell and smoothed. On other niches: where children land, and how far.
    And anywhere alike, the last.

    Parameters
    ----------
    niches : Niches
    parent, child : (E,) int64 arrays
        Pairs of states, each once and sorted.

    Attributes
    ----------
    pool : (k,) int64 array
        The births that each kind is made of, which some share; one more than there are for none.
    """

    def __init__(self, niches: Niches, parent: Ints, child: Ints) -> None:
        self.niches = niches
        self._parent, self._child = parent, child
        self._outside = parent >= len(niches)
        self._near: NearBirths | None = None
        pool = [_LANDING, _MOVING, 2]
        if isinstance(niches, GridNiches):
            self._near = NearBirths(niches, parent, child)
            pool = [pool for pool in (_LANDING, _MOVING, _NEAR_LANDING, _NEAR_MOVING) for _ in range(2)] + [4]
        self.pool = np.array(pool)

    @property
    def number(self) -> int:
        """How many there are, k."""
        return int(self.pool.size)

    @property
    def pools(self) -> int:
        """How many pools of births they are made of, p."""
        return int(self.pool[-1])

    def pooled(self, births: Floats) -> Floats:
        """Births of each pool (p, E), of those of each kind (k, E)."""
        whole = np.zeros((self.pools, births.shape[1]))
        for pool, of_kind in zip(self.pool[:-1], births, strict=False):
            whole[pool] += of_kind
        # A parent outside has no cell to be displaced from: its births are where children land.
        whole[:, self._outside] = 0.0
        whole[_LANDING, self._outside] = births[:, self._outside].sum(axis=0)
        return whole

    def expected(self, pools: Floats) -> Floats:
        """What each kind expects of each pair, (k, E), when made of these births (p, E).

        Notes
        -----
        A row's own births have no say in what it is foretold by destination or neighbours. Of smoothed
        destinations, those of the same pair are left out.
        """
        guessed = self._base(pools, _NOWHERE)
        states, landing = self.niches.states, pools[_LANDING]
        every, own = landing.sum() + 1.0, np.bincount(self._parent, landing, states)[self._parent]
        fell = (guessed.destination[self._child] * every - landing) / (every - own)
        moved = self._moved(guessed)
        anywhere = np.full(self._child.size, 1.0 / states)
        if self._near is None:
            return np.stack([fell, moved, anywhere])
        assert isinstance(self.niches, GridNiches)
        smooth = smoothed_states(self.niches, guessed.destination)[self._child] * every
        kept = CENTRE ** len(self.niches.shape)
        smooth = np.maximum(smooth - kept * landing, _TINY) / (every - kept * own)
        moved_smoothly = self._moved(replace(guessed, displacement=_smoothed(guessed)))
        near = self._near.expected(pools[_NEAR_LANDING], pools[_NEAR_MOVING])
        return np.stack([fell, smooth, moved, moved_smoothly, *near, anywhere])

    def base(self, pools: Floats, weights: Floats) -> BaseMeasure:
        """The base measure made of these births (p, E), with the weights of the kinds (k,)."""
        of_pool = np.bincount(self.pool, weights, self.pools + 1)
        mixed = of_pool[:2] + _TINY
        shares = np.append(mixed * max(1.0, _LEAST / mixed.sum()), weights[-1])
        near = None
        if self._near is not None:
            near = self._near.rows(pools[_NEAR_LANDING], pools[_NEAR_MOVING], weights[4:8])
        base = self._base(pools, shares / shares.sum(), near)
        if self._near is None:
            return base
        assert isinstance(self.niches, GridNiches)
        assert isinstance(base.displacement, GridDisplacement)
        smooth_landing, smooth_moving = weights[[1, 3]] / mixed
        kernel = (1.0 - smooth_moving) * base.displacement.kernel + smooth_moving * _smoothed(base).kernel
        destination = (1.0 - smooth_landing) * base.destination
        destination += smooth_landing * smoothed_states(self.niches, base.destination)
        return replace(base, destination=destination, displacement=replace(base.displacement, kernel=kernel))

    def _base(self, pools: Floats, weights: Floats, near: NearRows | None = None) -> BaseMeasure:
        landing, moving = pools[_LANDING], pools[_MOVING]
        pairs = self._parent, self._child
        base = BaseMeasure.of_births(self.niches, *pairs, landing, moving, weights, near)
        if not isinstance(base.displacement, GridDisplacement):
            return base
        # Births of all kinds show where anybody can be.
        n, born = len(self.niches), pools.sum(axis=0) > 0
        known = np.zeros(n, bool)
        for states in pairs:
            known[states[born & (states < n)]] = True
        return replace(base, displacement=replace(base.displacement, known=known))

    def _moved(self, base: BaseMeasure) -> Floats:
        """What displacement expects of each pair: of what lies outside only destination speaks."""
        return np.where(self._outside, 0.0, base.displaced(self._parent, self._child))


def _smoothed(base: BaseMeasure) -> GridDisplacement:
    assert isinstance(base.displacement, GridDisplacement)
    return smoothed_displacement(base.displacement)
