"""Which births each kind of guess is made of, so that none is made of births that another explains."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma

from nichechain.chain.kinds import Kinds

Floats = NDArray[np.float64]

# The weight that all states alike have at least, so that nothing is impossible.
_LEAST_UNIFORM = 5e-4
_ROUNDS = 6
_STEPS = 6
_STRENGTH = 30.0
_STRENGTHS = (0.1, 1e5)


def attributed(kinds: Kinds, births: Floats, total: Floats, weights: Floats | None = None) -> Floats:
    """Share births out among the kinds that explain them.

    Parameters
    ----------
    kinds : Kinds
    births : (E,) float64 array
        Independent births of each pair.
    total : (S,) float64 array
        Of each row.
    weights : (k,) float64 array, optional
        Of the kinds; by default what makes the births most likely.

    Returns
    -------
    (p, E) float64 array
        Independent births of each pair that each pool has.

    Notes
    -----
    Expectation maximisation of the Dirichlet-multinomial likelihood. Its expectation step is that of the
    hierarchical Dirichlet process (Teh et al. 2006): C births of a pair are expected to stand for
    s B (ψ(C + s B) − ψ(s B)) independent draws from B_i, which the kinds share in proportion to what each
    expects there. Were every kind made of all births, the same births would count several times, and the
    base would be more diffuse than anything that was seen.
    """
    fixed = weights is not None
    if weights is None:
        weights = floored(np.full(kinds.number, 1.0 / kinds.number))
    pools = kinds.pooled(weights[:, None] * births)
    total = total[total > 0]
    strength = _STRENGTH
    for _ in range(_ROUNDS if births.any() else 0):
        expected = kinds.expected(pools)
        for _ in range(_STEPS):
            # Not BLAS, whose threads wait for each other where processors are busy.
            mixed = np.einsum("k,ke->e", weights, expected)
            prior = strength * mixed
            drawn = prior * (digamma(births + prior) - digamma(prior))
            share, before = drawn / mixed, weights
            if not fixed:
                weights = floored(weights * np.einsum("ke,e->k", expected, share))
            found = drawn.sum() / (digamma(total + strength) - digamma(strength)).sum()
            strength = float(np.clip(found, *_STRENGTHS))
        pools = kinds.pooled(before[:, None] * expected * share)
    return pools


def floored(weights: Floats) -> Floats:
    """Weights (k,) that add up to 1, the last of them not too small."""
    weights = weights / weights.sum()
    uniform = max(float(weights[-1]), _LEAST_UNIFORM)
    scale = (1.0 - uniform) / max(1.0 - float(weights[-1]), _LEAST_UNIFORM)
    return np.append(weights[:-1] * scale, uniform)
