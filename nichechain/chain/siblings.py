"""How much children of one elite take after each other, and so how many births are worth one.

A broken policy stays broken: many children of few elites are not many independent births.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nichechain.births.families import elites_of
from nichechain.chain.counts import TransitionCounts

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def sibling_correlation(counts: TransitionCounts) -> float:
    """How much children of one elite take after each other, beyond sharing a niche.

    Returns
    -------
    float
        Between 0 (they are independent draws from their niche's row) and 1 (all alike); 0 where
        no elite had two children or no niche two elites.

    Notes
    -----
    The share of sibling pairs in one niche, above that of pairs of cousins (children of two elites
    of the same niche), as a part of what it could be: the intraclass correlation of Fleiss and
    Cuzick (1979), pooled over rows by their sibling pairs.
    """
    births = counts.births
    pairs, matches = _siblings(counts.families, counts.niches.states)
    alike = np.asarray(counts.matrix.multiply(counts.matrix).sum(axis=1)).ravel() - births - matches
    cousins = births * (births - 1) - pairs
    rows = (cousins > 0) & (pairs > 0)
    if not rows.any():
        return 0.0
    weight = pairs[rows] / pairs[rows].sum()
    of_siblings = float((weight * matches[rows] / pairs[rows]).sum())
    of_cousins = float((weight * alike[rows] / cousins[rows]).sum())
    if of_cousins >= 1.0:
        return 0.0
    return float(np.clip((of_siblings - of_cousins) / (1.0 - of_cousins), 0.0, 1.0))


def design_effect(counts: TransitionCounts) -> Floats:
    """How many births of each row are worth one independent birth, (S,), at least 1.

    Notes
    -----
    1 + (m − 1) ρ for elites of m children each; Kish (1965), with the birth-weighted mean of m
    where elites have different numbers of children, and ρ of :func:`sibling_correlation`.
    """
    return effect_of(counts.families, counts.births, sibling_correlation(counts))


def effect_of(families: Ints, births: Ints, correlation: float) -> Floats:
    """The same for some families whose likeness is known, (S,).

    Parameters
    ----------
    families : (F, 4) int64 array
    births : (S,) int64 array
        Of each row, theirs and those that do not say whose they are.
    correlation : float
        ρ.
    """
    pairs, _ = _siblings(families, births.size)
    effect: Floats = 1.0 + correlation * pairs / np.maximum(1, births)
    return effect


def _siblings(families: Ints, states: int) -> tuple[Ints, Ints]:
    """Ordered pairs of children of one elite, and those of them in one niche, (S,) each."""
    parent, _, _, children = families.T
    elite = elites_of(families)
    family = np.bincount(elite, children)
    owner = np.empty(family.size, np.int64)
    owner[elite] = parent
    pairs = np.bincount(owner, family * (family - 1), states)
    matches = np.bincount(parent, children * (children - 1), states)
    return pairs.astype(np.int64), matches.astype(np.int64)
