"""Measures of a behavior landscape: sensitivity, evolvability, dissimila ("Definitions and metrics").

The functions take behaviors and give numbers. A sample S of the offspring of one genotype is an
(n, B) array; leading axes stand for several genotypes measured at once. Offspring with NaN failed
and are left out. |·| is the Euclidean norm, in units of behavior.

Where mutation is unbounded, every genotype is a neighbour of every other: a maximum over a sample
is then a lower bound that grows with the sample, and only measures of the same sample size compare.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.births.table import NONE
from nichechain.core.arrays import ordered_sum, present
from nichechain.core.checks import as_floats, as_whole, check_at_least, check_numbers
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]

EPSILON = 1e-12
"""The ε of the protected division, in units of behavior."""


def local_sensitivity(parent: ArrayLike, offspring: ArrayLike) -> Floats:
    """Largest distance from a parent to its offspring, LS (Eq. 2).

    Parameters
    ----------
    parent : (..., B) array
    offspring : (..., n, B) array

    Returns
    -------
    (...) array
        NaN where all offspring failed.
    """
    largest: Floats = np.fmax.reduce(_to_parent(parent, offspring), axis=-1, initial=np.nan)
    return largest


def expected_local_sensitivity(parent: ArrayLike, offspring: ArrayLike) -> Floats:
    """Mean distance from a parent to its offspring, LS* (Eq. 4).

    Parameters
    ----------
    parent : (..., B) array
    offspring : (..., n, B) array

    Returns
    -------
    (...) array
        NaN where all offspring failed.
    """
    return _mean(_to_parent(parent, offspring))


def global_sensitivity(parents: ArrayLike, offspring: ArrayLike) -> float:
    """Largest local sensitivity of a set of genotypes, GS (Eq. 5).

    Parameters
    ----------
    parents : (G, B) array
        The set stands for all genotypes, of which nobody can take the maximum.
    offspring : (G, n, B) array

    Returns
    -------
    float
        NaN where everything failed.
    """
    return float(np.fmax.reduce(local_sensitivity(parents, offspring), initial=np.nan))


def expected_global_sensitivity(parents: ArrayLike, offspring: ArrayLike) -> float:
    """Mean expected local sensitivity of a set of genotypes, GS*.

    Parameters
    ----------
    parents : (G, B) array
    offspring : (G, n, B) array

    Returns
    -------
    float
        NaN where everything failed.
    """
    return float(_mean(expected_local_sensitivity(parents, offspring)))


def evolvability(offspring: ArrayLike) -> Floats:
    """Diameter of the offspring: the largest distance between two of them, η (Eq. 6).

    Parameters
    ----------
    offspring : (..., n, B) array

    Returns
    -------
    (...) array
        At most twice the local sensitivity, up to rounding; 0 for a single one, NaN where all failed.
    """
    points = _sample(offspring)
    widest = np.fmax.reduce(_pairwise(points), axis=-1, initial=0.0)
    return np.where(present(points).any(axis=-1), widest, np.nan)[()]


def expected_evolvability(offspring: ArrayLike) -> Floats:
    """Mean distance between two of the offspring, η* (Eq. 8).

    Parameters
    ----------
    offspring : (..., n, B) array

    Returns
    -------
    (...) array
        NaN where fewer than two did not fail.

    Notes
    -----
    The mean runs over pairs of distinct offspring, not of distinct behaviors; the paper's
    card(S − 1) reads card(S) − 1.
    """
    return _mean(_pairwise(_sample(offspring)))


def population_evolvability(population: ArrayLike) -> Floats:
    """Mean distance between two members of generation i + 1, ρ* of generation i (Eq. 10).

    Parameters
    ----------
    population : (..., n, B) array

    Returns
    -------
    (...) array
        NaN where fewer than two did not fail.
    """
    return expected_evolvability(population)


def one_hot_evolvability(niche: ArrayLike, niches: int) -> Floats:
    """Share d/n of all niches that the offspring occupy (Eq. 9).

    Parameters
    ----------
    niche : (..., n) int array
        State of each of the offspring, ``births.NONE`` where it failed. States from ``niches`` on
        are no niches: the outside state does not count.
    niches : int
        Number of niches.

    Returns
    -------
    (...) array
        It grows with the sample: report the size beside it.
    """
    state = as_whole("niche", niche)
    check_at_least(1, niches=niches)
    if not state.ndim:
        raise NichechainError("niche has shape (), but must be (..., n), one state per offspring")
    ordered = np.sort(np.where((state != NONE) & (state < niches), state, NONE), axis=-1)
    new = ordered != NONE
    new[..., 1:] &= ordered[..., 1:] != ordered[..., :-1]
    return np.asarray(new.sum(axis=-1) / niches, np.float64)[()]


def dissimila_ratio(evolvability: ArrayLike, sensitivity: ArrayLike, epsilon: float = EPSILON) -> Floats:
    """Evolvability over local sensitivity: r of η and LS, r* of η* and LS* (Eq. 11 and 12).

    Parameters
    ----------
    evolvability, sensitivity : (...) arrays
        Of the same samples.
    epsilon : float
        Added to the sensitivity, positive.

    Returns
    -------
    (...) array
        Between 0 and 2, up to rounding.

    Raises
    ------
    NichechainError
        If ``epsilon`` is not positive.
    """
    check_numbers(epsilon=epsilon)
    if not epsilon > 0:
        raise NichechainError(f"epsilon is {epsilon}, but must be positive")
    reached, spread = as_floats("evolvability", evolvability), as_floats("sensitivity", sensitivity)
    if reached.shape != spread.shape:
        raise NichechainError(
            f"evolvability and sensitivity have shapes {reached.shape} and {spread.shape}, but must be alike"
        )
    return reached / (spread + epsilon)


def hull_volume(behaviors: ArrayLike) -> float:
    """Hypervolume of the convex hull of some behaviors: an area for two axes.

    It stands in for a count of niches where behavior space is unbounded.

    Parameters
    ----------
    behaviors : (n, B) array

    Returns
    -------
    float
        In units of behavior to the power of B. 0 where the points span fewer than B dimensions,
        NaN where all failed.
    """
    given = as_floats("behaviors", behaviors)
    if given.ndim != 2 or not given.shape[1] or np.isinf(given).any():
        raise NichechainError(
            f"behaviors have shape {given.shape} or infinite values, but must be (n, B) and finite or NaN"
        )
    points = given[present(given)]
    if not len(points):
        return np.nan
    axes = points.shape[1]
    if axes == 1:
        return float(np.ptp(points))
    with np.errstate(over="ignore", invalid="ignore"):
        centered = points - points.mean(axis=0)
    if not np.isfinite(centered).all():
        raise NichechainError(f"behaviors have the value {np.abs(points).max():g}, which is too large to add")
    _, extent, direction = np.linalg.svd(centered, full_matrices=False)
    flat = np.finfo(np.float64).eps * max(points.shape) * np.abs(points).max()
    if len(points) <= axes or extent[-1] <= flat:
        return 0.0
    from scipy.spatial import ConvexHull

    # Stretched to a ball, a thin cloud is nothing special to Qhull.
    return float(ConvexHull(centered @ direction.T / extent).volume * np.prod(extent))


def _sample(offspring: ArrayLike) -> Floats:
    points = as_floats("offspring", offspring)
    if points.ndim < 2 or not points.shape[-1]:
        raise NichechainError(f"offspring has shape {points.shape}, but must be (..., n, B)")
    return points


def _to_parent(parent: ArrayLike, offspring: ArrayLike) -> Floats:
    """Distances (..., n) between parents and offspring."""
    root, born = as_floats("parent", parent), _sample(offspring)
    if root.shape != (*born.shape[:-2], born.shape[-1]):
        raise NichechainError(
            f"parent and offspring have shapes {root.shape} and {born.shape}, "
            "but must be (..., B) and (..., n, B)"
        )
    return _norm(born - root[..., None, :])


def _pairwise(points: Floats) -> Floats:
    """Distances (..., n(n-1)/2) between points (..., n, B)."""
    first, second = np.triu_indices(points.shape[-2], 1)
    return _norm(points[..., first, :] - points[..., second, :])


def _norm(difference: Floats) -> Floats:
    """Lengths (...) of vectors (..., B)."""
    # hypot neither overflows nor underflows where a square would, which the laws rest on.
    length: Floats = np.abs(difference[..., 0])
    for axis in range(1, difference.shape[-1]):
        length = np.hypot(length, difference[..., axis])
    return length


def _mean(values: Floats) -> Floats:
    """Mean along the last axis of what is not NaN; NaN of nothing."""
    known = ~np.isnan(values)
    total = ordered_sum(np.where(known, values, 0.0))
    with np.errstate(invalid="ignore"):
        return np.asarray(total / known.sum(axis=-1))[()]
