"""T while births come in: counts are added to, what is pooled over rows is fitted seldom."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.births.table import NONE
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.operator import PooledTransition
from nichechain.chain.prior import fit_prior
from nichechain.niches import Niches
from nichechain.search.selection import Told

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_GROWTH = 4.0
"""The prior of rows is fitted again whenever there are so many times the births that it was fitted to.

Fits then cost no more in all than four thirds of the last one. Fitting it up to sixteen times as often made
no difference to what was filled."""
_DIGITS = 3
"""Significant digits of the strength: libraries of other machines differ in the last ones of a sum, which the
search for its best value would magnify."""


@dataclass
class OnlineChain:
    """The posterior mean of T by empirical Bayes, as a matrix to multiply with.

    Rows are those of :class:`nichechain.chain.posterior.DirichletPosterior`, (C/e + s B) / (N/e + s),
    with all births in C and N; base measure B, strength s and design effect e are of the last fit.

    Parameters
    ----------
    niches : Niches
    """

    niches: Niches
    fits: int = 0
    """How often the prior has been fitted."""
    _births: list[tuple[Ints, Ints, Ints]] = field(default_factory=list)
    _waiting: list[tuple[Ints, Ints]] = field(default_factory=list)
    _number: int = 0
    _fitted: int = 0

    def __post_init__(self) -> None:
        states = self.niches.states
        self._counts = sparse.csr_array((states, states), dtype=np.float64)
        self._total = np.zeros(states)

    @property
    def births(self) -> int:
        """Births with a parent so far."""
        return self._number

    def tell(self, births: Told) -> None:
        """Add births."""
        moved = (births.parent_niche != NONE) & (births.child_niche != NONE)
        parent, child = births.parent_niche[moved], births.child_niche[moved]
        self._births.append((parent, child, births.parent_uid[moved]))
        self._waiting.append((parent, child))
        self._number += parent.size

    @property
    def due(self) -> bool:
        """Whether there are so many births that the prior is to be fitted again."""
        return not self._fitted or self._number >= _GROWTH * self._fitted

    def settle(self) -> bool:
        """Take in all births so far; true where the prior was fitted again.

        There must be births.
        """
        if self._waiting:
            parent, child = (np.concatenate(part) for part in zip(*self._waiting, strict=True))
            shape = self._counts.shape
            self._counts = self._counts + sparse.coo_array(
                (np.ones(parent.size), (parent, child)), shape=shape
            )
            self._total += np.bincount(parent, minlength=shape[0])
            self._waiting.clear()
        due = self.due
        if due:
            self._fit()
        return due

    def _fit(self) -> None:
        parent, child, elite = (np.concatenate(part) for part in zip(*self._births, strict=True))
        prior = fit_prior(TransitionCounts.from_births(parent, child, self.niches, elite=elite))
        states = self.niches.states
        nothing = sparse.csr_array((states, states))
        self._base = PooledTransition.of(nothing, np.ones(states), prior.base)
        self.base = prior.base
        self.strength = float(f"{prior.strength:.{_DIGITS}g}")
        self.design_effect = prior.design_effect
        self._fitted = self._number
        self.fits += 1

    @property
    def total(self) -> Floats:
        """Births behind each row, those that the base is worth among them, (S,)."""
        whole: Floats = self._total / self.design_effect + self.strength
        return whole

    def __matmul__(self, values: Floats) -> Floats:
        """T x for an (S,) or (S, c) array."""
        column = (slice(None),) + (None,) * (values.ndim - 1)
        seen = (self._counts @ values) / self.design_effect[column]
        product: Floats = (seen + self.strength * (self._base @ values)) / self.total[column]
        if self.niches.outside == "absorb":
            product[-1] = values[-1]
        # Transforms round to either side of 0.
        return np.maximum(product, 0.0)

    def backwards(self, values: Floats) -> Floats:
        """Tᵀ x for an (S, c) array."""
        if self.niches.outside == "absorb":
            stays = values[-1].copy()
            values = values.copy()
            values[-1] = 0.0
        shares = values / self.total[:, None]
        product: Floats = self._counts.T @ (shares / self.design_effect[:, None])
        product += self.strength * (shares.T @ self._base).T
        if self.niches.outside == "absorb":
            product[-1] += stays
        return product

    def staying(self) -> Floats:
        """T_ii of states in which no child of a parent there has landed, (S,), as the base has it."""
        states = np.arange(self.niches.states)
        whole: Floats = self.strength * self.base.probability(states, states) / self.total
        return whole
