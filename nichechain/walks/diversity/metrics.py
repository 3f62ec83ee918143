"""Diversity metrics from distances: to nearest neighbours, to the parent, to all ancestors.

Points are behaviors, B numbers each; R walks are scored at once. A NaN point is one that failed
or is not there: it is nobody's neighbour, and its own score is NaN. A score depends on its own
walk alone, to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.arrays import (
    checked_own,
    checked_points,
    ordered_sum,
    pair_blocks,
    pool_of,
    present,
    squared_distances,
)
from nichechain.core.checks import as_floats, as_whole, check_at_least
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Below this, one partial sort of all distances is quicker than a tree per walk (benchmarks/walks.py).
_TREE_FROM_QUERIES = 64


@dataclass(frozen=True)
class Surroundings:
    """What the behaviors of R walks are scored against.

    Parameters
    ----------
    siblings : (R, N, B) array
        S: the population of the step.
    archive : (R, M, B) array
        X: behaviors remembered from earlier steps.
    age : (R, M) int64 array
        Steps since each of them was born; siblings have age 0.
    path : (R, μ, L, B) array
        Behaviors of the lineage of each of a walk's μ states, from the start of the walk to the
        state itself.
    span : (B,) array
        Extent of behavior space along each axis.
    litters : (R, Q, m) int64 array, optional
        Where the own offspring of each of the scored landed, ``births.NONE`` where one failed; there if
        the metric asks for a litter.
    niches : int
        States below it are niches.
    """

    siblings: Floats
    archive: Floats
    age: Ints
    path: Floats
    span: Floats
    litters: Ints | None = None
    niches: int = 0


class Metric(Protocol):
    """A diversity metric G."""

    @property
    def remembers(self) -> bool:
        """Whether it looks at the novelty archive."""
        ...

    @property
    def litter(self) -> int:
        """How many offspring of each of the scored it asks for, 0 for none."""
        ...

    def __call__(self, query: Floats, lineage: Ints, itself: Ints, around: Surroundings) -> Floats:
        """Score behaviors.

        Parameters
        ----------
        query : (R, Q, B) array
        lineage : (Q,) int64 array
            Which of the walk's states each of them descends from.
        itself : (Q,) int64 array
            Which of the siblings each of them is, -1 if none.
        around : Surroundings

        Returns
        -------
        (R, Q) array
            Larger is more diverse; NaN for a NaN behavior.
        """
        ...


class OfBehaviors:
    """A metric that behaviors are enough for."""

    @property
    def litter(self) -> int:
        """It asks for no offspring."""
        return 0


@dataclass(frozen=True)
class KNearest(OfBehaviors):
    """Sum of the distances to the k nearest in S ∪ X, as in novelty search (Eq. 17).

    Parameters
    ----------
    k : int
        Neighbours, at least 1; all there are if there are fewer.
    archive : bool
        Whether X belongs to the neighbours, or only S.
    include_itself : bool
        Whether a behavior is its own nearest neighbour, at distance 0. The paper's equation does
        not exclude it, novelty search does.

    Raises
    ------
    NichechainError
        If k is below 1.
    """

    k: int = 15
    archive: bool = True
    include_itself: bool = False

    def __post_init__(self) -> None:
        check_at_least(1, k=self.k)

    @property
    def remembers(self) -> bool:
        """Whether it looks at the novelty archive."""
        return self.archive

    def __call__(self, query: Floats, lineage: Ints, itself: Ints, around: Surroundings) -> Floats:  # noqa: ARG002
        """Score behaviors (R, Q, B)."""
        pool = pool_of(around.siblings, around.archive) if self.archive else around.siblings
        return knn_distance(query, pool, self.k, itself=None if self.include_itself else itself)


@dataclass(frozen=True)
class ParentDistance(OfBehaviors):
    """Distance to the parent (Eq. 18); a state counts as its own unmutated child."""

    @property
    def remembers(self) -> bool:
        """It does not look at the novelty archive."""
        return False

    def __call__(self, query: Floats, lineage: Ints, itself: Ints, around: Surroundings) -> Floats:  # noqa: ARG002
        """Score behaviors (R, Q, B)."""
        return parent_distance(query, around.path[:, lineage, -1])


@dataclass(frozen=True)
class AncestorDistance(OfBehaviors):
    """Sum of the distances to all ancestors from the start of the walk (Eq. 19).

    The sum runs over the states of the walk, so an ancestor that stayed for several steps counts
    once for each.
    """

    @property
    def remembers(self) -> bool:
        """It does not look at the novelty archive."""
        return False

    def __call__(self, query: Floats, lineage: Ints, itself: Ints, around: Surroundings) -> Floats:  # noqa: ARG002
        """Score behaviors (R, Q, B)."""
        return ancestor_distance(query, around.path, lineage)


def knn_distance(query: ArrayLike, pool: ArrayLike, k: int, *, itself: ArrayLike | None = None) -> Floats:
    """Sum of the distances to the k nearest points of a pool.

    Parameters
    ----------
    query : (R, Q, B) array
    pool : (R, M, B) array
    k : int
        At least 1; the sum runs over fewer where fewer exist, and is 0 where none does.
    itself : (Q,) int array, optional
        Which point of the pool each query is, -1 if none: that one is no neighbour. By default
        none is.

    Returns
    -------
    (R, Q) array

    Raises
    ------
    NichechainError
        If k is below 1.

    Notes
    -----
    Source: Eq. 17 of the paper, after Lehman and Stanley (2011). Large populations are searched
    with one k-d tree per walk.
    """
    check_at_least(1, k=k)
    points, others = checked_points(query, pool)
    walks, queries, _ = points.shape
    own = checked_own(itself, points, others)
    score = np.empty((walks, queries))
    if queries >= _TREE_FROM_QUERIES:
        for walk in range(walks):
            score[walk] = _by_tree(points[walk], others[walk], k, own)
    else:
        for block in pair_blocks(walks, queries, others.shape[1]):
            score[block] = _by_sorting(points[block], others[block[0]], k, own[block[1]])
    score[~present(points)] = np.nan
    return score


def parent_distance(query: ArrayLike, parent: ArrayLike) -> Floats:
    """Distances between behaviors (R, Q, B) and their parents' (R, Q, B), as (R, Q)."""
    points, before = as_floats("query", query), as_floats("parent", parent)
    if not points.ndim or points.shape != before.shape:
        raise NichechainError(
            f"query and parent have shapes {points.shape} and {before.shape}, but must be alike, (R, Q, B)"
        )
    difference = points - before
    return np.sqrt(ordered_sum(difference * difference))


def ancestor_distance(query: ArrayLike, path: ArrayLike, lineage: ArrayLike) -> Floats:
    """Sum of the distances to a lineage.

    Parameters
    ----------
    query : (R, Q, B) array
    path : (R, μ, L, B) array
        Behaviors of μ lineages, none of them NaN.
    lineage : (Q,) int array
        Which of the μ is the query's own.

    Returns
    -------
    (R, Q) array

    Notes
    -----
    Source: Eq. 19 of the paper.
    """
    points, ancestors = as_floats("query", query), as_floats("path", path)
    if points.ndim != 3 or ancestors.ndim != 4 or points.shape[::2] != ancestors.shape[::3]:
        raise NichechainError(
            f"query and path have shapes {points.shape} and {ancestors.shape}, "
            "but must be (R, Q, B) and (R, μ, L, B)"
        )
    own = as_whole("lineage", lineage)
    if own.shape != points.shape[1:2] or ((own < 0) | (own >= ancestors.shape[1])).any():
        raise NichechainError(
            f"lineage is {own.tolist()}, but must be one number per query, from 0 to {ancestors.shape[1] - 1}"
        )
    score = np.empty(points.shape[:2])
    for state in range(ancestors.shape[1]):
        mine = np.flatnonzero(own == state)
        distance = np.sqrt(squared_distances(points[:, mine], ancestors[:, state]))
        score[:, mine] = ordered_sum(distance)
    return score


def _by_sorting(points: Floats, others: Floats, k: int, own: Ints) -> Floats:
    squared = squared_distances(points, others)
    squared[np.isnan(squared)] = np.inf
    known = np.flatnonzero(own >= 0)
    squared[:, known, own[known]] = np.inf
    if squared.shape[2] > k:
        squared = np.partition(squared, k - 1, axis=2)[:, :, :k]
    # Sorted, so that the sum does not depend on the order that the partition happens to leave.
    nearest = np.sort(squared, axis=2)
    nearest[np.isinf(nearest)] = 0.0
    return ordered_sum(np.sqrt(nearest))


def _by_tree(points: Floats, others: Floats, k: int, own: Ints) -> Floats:
    from scipy.spatial import cKDTree

    there = present(others)
    score = np.full(len(points), np.nan)
    finite = np.flatnonzero(present(points))
    if not there.any():
        score[finite] = 0.0
        return score
    distance, _ = cKDTree(others[there]).query(points[finite], k=np.arange(1, k + 2))
    distance[np.isinf(distance)] = 0.0
    # Its nearest neighbour is itself, or a point at the same distance of 0.
    left_out = own[finite] >= 0
    score[finite] = ordered_sum(np.where(left_out[:, None], distance[:, 1:], distance[:, :-1]))
    return score
