"""Sums and distances whose bits depend on a row's own numbers, not on the shape around it.

NumPy adds in an order that depends on the length and layout of an array. Rows that are padded to
a common length, or scored together with the rows of other walks, would then differ in the last
bit from rows scored alone. Adding from left to right, with a padding of zeros at the end, does not.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_floats, as_whole
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# A block of pairwise values this large (16 MiB) still fits a processor's outer cache.
_BLOCK = 2**21


def ordered_sum(values: Floats) -> Floats:
    """Sum along the last axis, from left to right; 0 where it is empty."""
    if values.shape[-1] == 0:
        return np.zeros(values.shape[:-1])
    total: Floats = np.add.accumulate(values, axis=-1)[..., -1]
    return total


def present(points: Floats) -> NDArray[np.bool_]:
    """Which of the points (..., B) have no NaN."""
    return np.asarray(~np.isnan(points).any(axis=-1))


def squared_distances(first: Floats, second: Floats) -> Floats:
    """Squared Euclidean distances between points (R, Q, B) and (R, M, B), as (R, Q, M)."""
    total: Floats = np.zeros((first.shape[0], first.shape[1], second.shape[1]))
    for axis in range(first.shape[2]):
        difference = first[:, :, None, axis] - second[:, None, :, axis]
        total += difference * difference
    return total


def pair_blocks(walks: int, queries: int, others: int) -> Iterator[tuple[slice, slice]]:
    """Slices of walks and of queries that bound the memory of all pairs (walks, queries, others)."""
    rows = max(1, min(queries, _BLOCK // max(1, others)))
    depth = max(1, _BLOCK // max(1, rows * others)) if rows == queries else 1
    for walk in range(0, walks, depth):
        for query in range(0, queries, rows):
            yield slice(walk, min(walk + depth, walks)), slice(query, min(query + rows, queries))


def pool_of(siblings: Floats, archive: Floats) -> Floats:
    """S ∪ X: siblings (R, N, B), then the archive (R, M, B)."""
    return np.concatenate([siblings, archive], axis=1)


def checked_points(query: ArrayLike, pool: ArrayLike) -> tuple[Floats, Floats]:
    """Behaviors to score (R, Q, B), and the pool (R, M, B) that they are scored against.

    Raises
    ------
    NichechainError
        If the shapes do not fit together.
    """
    points, others = as_floats("query", query), as_floats("pool", pool)
    if points.ndim != 3 or others.ndim != 3 or points.shape[::2] != others.shape[::2]:
        raise NichechainError(
            f"query and pool have shapes {points.shape} and {others.shape}, "
            "but must be (R, Q, B) and (R, M, B)"
        )
    return points, others


def checked_own(itself: ArrayLike | None, points: Floats, others: Floats) -> Ints:
    """Which point of the pool each query is, (Q,), -1 if none.

    Raises
    ------
    NichechainError
        If that is not one number per query, or no point of the pool.
    """
    queries, size = points.shape[1], others.shape[1]
    own = np.full(queries, -1) if itself is None else as_whole("itself", itself)
    if own.shape != (queries,) or ((own < -1) | (own >= size)).any():
        raise NichechainError(
            f"itself is {own.tolist()}, but must be {queries} numbers from -1 to {size - 1}, one per query"
        )
    return own


def entries_at(matrix: Any, rows: Ints, columns: Ints) -> Floats:
    """Entries of a matrix, dense or sparse, at some pairs, (N,); none of no pairs."""
    if not rows.size:
        # SciPy's answer to empty indices is a sparse matrix.
        return np.zeros(0)
    found: Floats = np.asarray(matrix[rows, columns], np.float64).ravel()
    return found
