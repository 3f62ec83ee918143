"""Empirical Bayes: what the births themselves say of how much rows of T differ.

Children of one elite take after each other, so many children of few elites are not many independent
births. Two things are fitted before any row is: how many births are worth one independent birth, and
how far rows stray from the base measure, judged by how well a row foretells the children of an elite
that it has not seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from nichechain.births.families import elites_of
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.families import orphans_of
from nichechain.core.arrays import entries_at

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LOG_STRENGTHS = (-7.0, 9.0)
_MOST_ERROR = 1.0


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


def strength_of(counts: TransitionCounts, base: Callable[[Ints, Ints], Floats]) -> tuple[float, float]:
    """The strength under which rows best foretell the children of elites they have not seen.

    Parameters
    ----------
    counts : TransitionCounts
    base : callable
        B_ij of pairs (N,) of parent and child, as all other rows' births give it.

    Returns
    -------
    strength : float
    error : float
        Standard error of its logarithm.

    Notes
    -----
    Maximises Σ_e Σ_j c_ej log T_ij with T_ij = ((C_ij − c_ej)/e_i + s B_ij) / ((N_i − m_e)/e_i + s):
    every elite's children are foretold by the posterior mean of its niche's row without them. e_i is
    the design effect of the births that are left, which the elite's own family has no part in. The
    marginal likelihood of the counts would take the likeness of siblings for a difference between
    niches, and find too small a strength. The error is that of estimating equations, summed over
    elites (Huber 1967), as an elite's children are not independent.
    """
    left = _left_out(counts)
    if not left.parent.size:
        return 1.0, 0.0
    probability = base(left.parent, left.child)
    pairs, _ = _siblings(counts)
    own = left.family * (left.family - 1)
    size = counts.births[left.parent] - left.family
    effect = 1.0 + sibling_correlation(counts) * (pairs[left.parent] - own) / np.maximum(1, size)
    count = entries_at(counts.matrix, left.parent, left.child)
    others, size = (count - left.children) / effect, size / effect

    def foretold(log_strength: float) -> Floats:
        s = float(np.exp(log_strength))
        logs: Floats = left.weight * np.log((others + s * probability) / (size + s))
        return logs

    best = minimize_scalar(lambda x: -foretold(x).sum(), bounds=_LOG_STRENGTHS, method="bounded").x
    step = 0.05
    below, here, above = (foretold(best + shift) for shift in (-step, 0.0, step))
    bend = -(above - 2.0 * here + below).sum() / step**2
    slopes = np.bincount(left.elite, (above - below) / (2.0 * step))
    # Where s is so large that rows are all base, the likelihood is flat and its size makes no difference.
    error = _MOST_ERROR if bend <= 0 else min(_MOST_ERROR, float(np.sqrt((slopes**2).sum()) / bend))
    return float(np.exp(best)), error


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
    elite : (E,) int64 array
        A number of the elite.
    """

    parent: Ints
    child: Ints
    children: Ints
    family: Ints
    weight: Ints
    elite: Ints


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
        np.concatenate([elite, elite.max(initial=-1) + 1 + np.arange(number.size)]).astype(np.int64),
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
