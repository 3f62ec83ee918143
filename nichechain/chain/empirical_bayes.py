"""Empirical Bayes: what the births themselves say of how much rows of T differ.

Children of one elite take after each other, so many children of few elites are not many independent
births. Two things are fitted before any row is: how many births are worth one independent birth, and
how far rows stray from the base measure, judged by how well a row foretells the children of an elite
that it has not seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import softmax

from nichechain.births.families import elites_of
from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.families import orphans_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# No component's weight goes below this, so that nothing is impossible.
_FLOOR = 0.005
_EVEN = np.array([0.5, 0.5 - _FLOOR, _FLOOR])


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
    pairs, matches = _siblings(counts)
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
    pairs, _ = _siblings(counts)
    effect: Floats = 1.0 + sibling_correlation(counts) * pairs / np.maximum(1, counts.births)
    return effect


def most_likely(
    counts: TransitionCounts, effect: Floats, strength: float | None = None
) -> tuple[float, Floats]:
    """Strength and mixture under which rows best foretell the children of elites they have not seen.

    Parameters
    ----------
    counts : TransitionCounts
    effect : (S,) float64 array
        Design effect of every row: its counts are divided by it.
    strength : float, optional
        Fixed where it is given.

    Returns
    -------
    strength : float
    weights : (3,) float64 array
        Of the components of :class:`BaseMeasure`.

    Notes
    -----
    Maximises Σ_e Σ_j c_ej log T_ij with T_ij = ((C_ij − c_ej)/e_i + s B_ij) / ((N_i − m_e)/e_i + s):
    every elite's children are foretold by the posterior mean of its niche's row without them, and
    B by all other rows' births. The marginal likelihood of the counts would take the likeness of
    siblings for a difference between niches, and find too small a strength.
    """
    left = _left_out(counts)
    if not left.parent.size:
        return strength or 1.0, _EVEN
    components = _without_own(counts, left.parent, left.child)
    count = np.asarray(counts.matrix[left.parent, left.child]).ravel()
    others = (count - left.children) / effect[left.parent]
    size = (counts.births[left.parent] - left.family) / effect[left.parent]

    def unpack(x: Floats) -> tuple[float, Floats]:
        weights = _FLOOR + (1.0 - 3.0 * _FLOOR) * softmax(np.append(x[1:], 0.0))
        s = strength if strength is not None else float(np.exp(np.clip(x[0], -7.0, 12.0)))
        return s, weights

    def loss(x: Floats) -> float:
        s, weights = unpack(x)
        foretold = (others + s * (weights @ components)) / (size + s)
        return -float((left.weight * np.log(foretold)).sum())

    best = minimize(loss, np.array([2.0, 2.0, 2.0]), method="Nelder-Mead", options={"maxiter": 400})
    return unpack(best.x)


@dataclass(frozen=True)
class _LeftOut:
    """Births and what their niche's row loses without their elite's children.

    Parameters
    ----------
    parent, child : (E,) int64 arrays
        States.
    children : (E,) int64 array
        The elite's children in the child's state.
    family : (E,) int64 array
        All its children.
    weight : (E,) int64 array
        Births that this speaks for.
    """

    parent: Ints
    child: Ints
    children: Ints
    family: Ints
    weight: Ints


def _left_out(counts: TransitionCounts) -> _LeftOut:
    """Every elite's children; births that do not say whose they are count as their own families."""
    parent, _, child, children = counts.families.T
    elite = elites_of(counts.families)
    family = np.bincount(elite, children).astype(np.int64)[elite]
    stray, landed, number = orphans_of(counts)
    alone = np.ones_like(number)
    return _LeftOut(
        np.concatenate([parent, stray]),
        np.concatenate([child, landed]),
        np.concatenate([children, alone]),
        np.concatenate([family, alone]),
        np.concatenate([children, number]),
    )


def _siblings(counts: TransitionCounts) -> tuple[Ints, Ints]:
    """Ordered pairs of children of one elite, and those of them in one niche, (S,) each."""
    states = counts.niches.states
    parent, _, _, children = counts.families.T
    elite = elites_of(counts.families)
    family = np.bincount(elite, children)
    owner = np.empty(family.size, np.int64)
    owner[elite] = parent
    pairs = np.bincount(owner, family * (family - 1), states)
    matches = np.bincount(parent, children * (children - 1), states)
    return pairs.astype(np.int64), matches.astype(np.int64)


def _without_own(counts: TransitionCounts, parent: Ints, child: Ints) -> Floats:
    """Components at each pair of the base that all other rows' births would give, (3, E)."""
    base = BaseMeasure.pooled(counts, _EVEN)
    destination, displaced, uniform = base.components(parent, child)
    n = len(counts.niches)
    count = np.asarray(counts.matrix[parent, child]).ravel().astype(np.float64)
    births = counts.births.astype(np.float64)
    every = births.sum() + 1.0
    destination = (destination * every - count) / (every - births[parent])
    # Of every row, the births that stayed in the grid and those that left it.
    kept = np.asarray(counts.matrix[:, :n].sum(axis=1), np.float64).ravel()
    kept[n:] = 0.0
    gone = births - kept
    gone[n:] = 0.0
    leaving = (gone.sum() - gone) / np.maximum(1.0, (gone + kept).sum() - gone - kept)
    inside = (parent < n) & (child < n)
    rows = parent[inside]
    share, whole = base.displacement.without_parent(
        counts, rows, child[inside], displaced[inside] / (1.0 - base.leaving)
    )
    displaced = np.where(parent < n, leaving[parent], destination)
    displaced[inside] = (1.0 - leaving[rows]) * share / whole
    # Where only the row itself ever did such a thing, the uniform share is all there is.
    return np.maximum([destination, displaced, uniform], 1e-12)
