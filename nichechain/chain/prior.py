"""The prior of rows of T, fitted to births: a base measure, a strength, and what is not known of them.

Every birth is taken to come from one of several kinds: from where children land anywhere, from how
far they land anywhere, and on a grid from where, and how far, neighbours' children land. Which birth
is of which kind is shared out by expectation maximisation, so that no kind is made of births that
another explains. Made of all births each, the kinds would count the same births several times, and
the base would be more diffuse than anything that was seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma

from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.empirical_bayes import design_effect, strength_of
from nichechain.chain.neighbours import NearRows, Neighbours
from nichechain.niches import GridNiches, Niches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# The part of the base that is uniform, so that nothing is impossible.
_UNIFORM = 5e-4
# The pools are never given up: a niche that no neighbour speaks for has nothing else.
_LEAST = 0.01
_ROUNDS = 8
_STEPS = 10
_STRENGTHS = (0.1, 1e5)
_TINY = 1e-9


@dataclass(frozen=True)
class FittedPrior:
    """Rows of T are Dirichlet(s B_i): the fitted B and s, and draws of what they might be as well.

    Parameters
    ----------
    base : BaseMeasure
        B.
    strength : float
        s.
    log_strength_error : float
        Standard error of log s.
    design_effect : (S,) float64 array
        Births of each row that are worth one independent birth.
    kinds : _Kinds
        Which births are of which kind.
    attributed : (k, E) float64 array
        Independent births of each pair of states that are of each kind.
    weights : (k,) float64 array
        Of the kinds.
    """

    base: BaseMeasure
    strength: float
    log_strength_error: float
    design_effect: Floats
    kinds: _Kinds
    attributed: Floats
    weights: Floats

    def draw(self, rng: np.random.Generator) -> tuple[BaseMeasure, float]:
        """A base measure and a strength that the births allow as well.

        Notes
        -----
        The Bayesian bootstrap (Rubin 1981) of the births that each kind is made of, and a log-normal
        strength.
        """
        drawn = rng.standard_gamma(np.maximum(self.attributed, _TINY))
        # A kind without births stays as likely as it is.
        weights = self.weights * (drawn.sum(axis=1) + _TINY) / (self.attributed.sum(axis=1) + _TINY)
        strength = self.strength * float(np.exp(self.log_strength_error * rng.standard_normal()))
        return self.kinds.base(drawn, weights / weights.sum()), strength


def fit_prior(counts: TransitionCounts, strength: float | None = None) -> FittedPrior:
    """The base measure and the strength that births make likely.

    Parameters
    ----------
    counts : TransitionCounts
    strength : float, optional
        s, where it is not to be fitted.

    Notes
    -----
    Maximises the Dirichlet-multinomial likelihood of births, divided by their design effect, over the
    base measure. The expectation step is that of the hierarchical Dirichlet process (Teh et al. 2006):
    C births of a pair are expected to stand for s B (ψ(C + s B) − ψ(s B)) independent draws from B_i,
    which the kinds share in proportion to what each expects there. A row's own births have no say in
    what it is foretold by destination or neighbours. The strength is then that of
    :func:`nichechain.chain.empirical_bayes.strength_of`.
    """
    effect = design_effect(counts)
    entries = counts.matrix.tocoo()
    order = np.lexsort(entries.coords[::-1])
    parent, child = (axis[order].astype(np.int64) for axis in entries.coords)
    births = entries.data[order] / effect[parent]
    kinds = _Kinds(counts.niches, parent, child)
    attributed, weights, mixed = _attribute(kinds, births, counts.births / effect)
    base = kinds.base(attributed, weights)
    error = 0.0
    if strength is None:
        code = parent * counts.niches.states + child

        def others(parent: Ints, child: Ints) -> Floats:
            return mixed[np.searchsorted(code, parent * counts.niches.states + child)]

        strength, error = strength_of(counts, others)
    return FittedPrior(base, strength, error, effect, kinds, attributed, weights)


def _attribute(kinds: _Kinds, births: Floats, total: Floats) -> tuple[Floats, Floats, Floats]:
    """Independent births of each kind (k, E), weights of the kinds (k,), and B_ij of the pairs (E,)."""
    weights = np.full(kinds.number, 1.0 / kinds.number)
    attributed = weights[:, None] * births
    mixed = np.full(births.size, 1.0 / kinds.niches.states)
    total = total[total > 0]
    strength = 30.0
    for _ in range(_ROUNDS if births.size else 0):
        expected = kinds.expected(attributed)
        for _ in range(_STEPS):
            mixed = (1.0 - _UNIFORM) * (weights @ expected) + _UNIFORM / kinds.niches.states
            prior = strength * mixed
            drawn = prior * (digamma(births + prior) - digamma(prior))
            shares = weights[:, None] * expected / mixed
            weights = (shares * drawn).sum(axis=1)
            weights /= weights.sum()
            found = drawn.sum() / (digamma(total + strength) - digamma(strength)).sum()
            strength = float(np.clip(found, *_STRENGTHS))
        attributed = shares * drawn
    return attributed, weights, mixed


class _Kinds:
    """The kinds of births between pairs of states (E,): landing, moving, and neighbours' of both."""

    def __init__(self, niches: Niches, parent: Ints, child: Ints) -> None:
        self.niches = niches
        self._parent, self._child = parent, child
        self._outside = parent >= len(niches)
        self._neighbours = Neighbours(niches, parent, child) if isinstance(niches, GridNiches) else None
        self.number = 2 if self._neighbours is None else 4

    def expected(self, attributed: Floats) -> Floats:
        """What each kind expects of each pair, (k, E), when made of these births (k, E)."""
        landing, moving = self._pools(attributed)
        pooled = self._pooled(landing, moving, np.array([0.5, 0.5, 0.0]))
        components = pooled.components(self._parent, self._child)[:2]
        states = self.niches.states
        every = landing.sum() + 1.0
        row = np.bincount(self._parent, landing, states)
        components[0] = (components[0] * every - landing) / (every - row[self._parent])
        # Of what lies outside only destination speaks.
        components[1, self._outside] = 0.0
        if self._neighbours is None:
            return components
        return np.concatenate([components, self._neighbours.shares(attributed[2], attributed[3])])

    def base(self, attributed: Floats, weights: Floats) -> BaseMeasure:
        """The base measure made of these births (k, E), with the weights of the kinds (k,)."""
        pooled = weights[:2] + _TINY
        pools = np.append(pooled * max(1.0, _LEAST / pooled.sum()), _UNIFORM)
        near = None
        if self._neighbours is not None:
            near = self._neighbours.rows(attributed[2], attributed[3], (1.0 - _UNIFORM) * weights[2:])
        return self._pooled(*self._pools(attributed), pools / pools.sum(), near)

    def _pooled(
        self, landing: Floats, moving: Floats, weights: Floats, near: NearRows | None = None
    ) -> BaseMeasure:
        return BaseMeasure.of_births(self.niches, self._parent, self._child, landing, moving, weights, near)

    def _pools(self, attributed: Floats) -> tuple[Floats, Floats]:
        """Births that destination and displacement are made of: one outside is displaced from nowhere."""
        landing = np.where(self._outside, attributed.sum(axis=0), attributed[0])
        return landing, np.where(self._outside, 0.0, attributed[1])
