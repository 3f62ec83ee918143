"""The Gaussian kernel density metric: far from where the walk has been, and most from where it was lately."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

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
from nichechain.core.checks import as_floats, check_choice, check_positive, check_share
from nichechain.core.errors import NichechainError
from nichechain.walks.diversity.metrics import OfBehaviors, Surroundings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mode = Literal["factor", "length", "matrix"]

# Standard deviation, in parts of the span of behavior space, that a bandwidth has at least:
# most offspring may end at one point, and their covariance is then singular.
_RIDGE = 1e-6


@dataclass(frozen=True)
class KernelDensity(OfBehaviors):
    """Minus the density of others at a behavior, discounted by their age (Eq. 20).

    Parameters
    ----------
    bandwidth : float or (B, B) nested tuple
        The paper's "smoothing parameter", which it does not explain further.
    mode : {"factor", "length", "matrix"}
        ``factor``: H = bandwidth² · covariance of S ∪ X, SciPy's ``bw_method``, one H per step and
        walk. ``length``: H = bandwidth² · I, the bandwidth being a length in units of behavior.
        ``matrix``: H is the bandwidth.
    decay : float
        g of the discount γ = g^age, above 0 and at most 1. The paper's experiments have γ = 1.
    archive : bool
        Whether X belongs to the others, or only S.

    Raises
    ------
    NichechainError
        If a value is out of range or the matrix is not symmetric positive definite.
    """

    bandwidth: float | tuple[tuple[float, ...], ...] = 0.5
    mode: Mode = "factor"
    decay: float = 1.0
    archive: bool = True

    def __post_init__(self) -> None:
        check_choice("mode", self.mode, get_args(Mode))
        check_share(decay=self.decay)
        if self.mode == "matrix":
            _check_matrix(as_floats("bandwidth matrix", self.bandwidth))
            return
        check_positive(bandwidth=self.bandwidth)

    @property
    def remembers(self) -> bool:
        """Whether it looks at the novelty archive."""
        return self.archive

    def __call__(self, query: Floats, lineage: Ints, itself: Ints, around: Surroundings) -> Floats:  # noqa: ARG002
        """Score behaviors (R, Q, B)."""
        walks, siblings, axes = around.siblings.shape
        pool, age = around.siblings, np.zeros((walks, siblings), np.int64)
        if self.archive:
            pool, age = pool_of(pool, around.archive), np.concatenate([age, around.age], axis=1)
        if self.mode == "factor":
            kernel = _proportional(pool, float(self.bandwidth), around.span)  # type: ignore[arg-type]
        elif self.mode == "length":
            kernel = _kernel(np.eye(axes) * float(self.bandwidth) ** 2, axes)  # type: ignore[arg-type]
        else:
            kernel = _kernel(np.asarray(self.bandwidth, np.float64), axes)
        discount = np.power(self.decay, age, dtype=np.float64)
        return -_density(query, pool, kernel, discount, itself)


@dataclass(frozen=True)
class _Kernel:
    """Gaussian kernels of several walks, or one for all.

    Parameters
    ----------
    whiten : (R or 1, B, B) array
        W with W·Wᵀ = H⁻¹: x·W has the identity as its bandwidth.
    peak : (R or 1,) array
        Value at 0.
    """

    whiten: Floats
    peak: Floats


def kernel_density(
    query: ArrayLike,
    pool: ArrayLike,
    matrix: ArrayLike,
    *,
    weight: ArrayLike | None = None,
    itself: ArrayLike | None = None,
) -> Floats:
    """Gaussian kernel density of a pool at some points.

    Parameters
    ----------
    query : (R, Q, B) array
    pool : (R, M, B) array
    matrix : (B, B) or (R, B, B) array
        Bandwidth matrix H, symmetric positive definite.
    weight : (R, M) array, optional
        Factor γ on the kernel of each point of the pool; by default 1.
    itself : (Q,) int array, optional
        Which point of the pool each query is, -1 if none: that one is left out.

    Returns
    -------
    (R, Q) array
        Sum of the weighted kernels over the number of points, per unit of behavior to the power
        of B; 0 where there is no point.

    Raises
    ------
    NichechainError
        If H is not symmetric positive definite or does not fit the behaviors.

    Notes
    -----
    Source: Eq. 20 and 21 of the paper, without the minus sign.
    """
    points, others = checked_points(query, pool)
    kernel = _kernel(as_floats("bandwidth matrix", matrix), points.shape[2])
    factor = np.ones(others.shape[:2]) if weight is None else as_floats("weight", weight)
    if factor.shape != others.shape[:2]:
        raise NichechainError(f"weight has shape {factor.shape}, but must be {others.shape[:2]}, as the pool")
    own = checked_own(itself, points, others)
    return _density(points, others, kernel, factor, own)


def _density(query: Floats, pool: Floats, kernel: _Kernel, weight: Floats, itself: Ints) -> Floats:
    walks, queries, _ = query.shape
    there = present(pool)
    weight = np.where(there, weight, 0.0)
    points = _times(query, kernel.whiten)
    others = _times(np.where(there[:, :, None], pool, 0.0), kernel.whiten)
    density = np.empty((walks, queries))
    for walk, rows in pair_blocks(walks, queries, pool.shape[1]):
        near = np.exp(-0.5 * squared_distances(points[walk, rows], others[walk])) * weight[walk, None, :]
        number = np.repeat(there[walk].sum(axis=1)[:, None], near.shape[1], axis=1)
        known = np.flatnonzero(itself[rows] >= 0)
        own = itself[rows][known]
        near[:, known, own] = 0.0
        number[:, known] -= there[walk][:, own]
        density[walk, rows] = ordered_sum(near) / np.maximum(number, 1)
    density *= kernel.peak[:, None]
    density[~present(query)] = np.nan
    return density


def _proportional(pool: Floats, factor: float, span: Floats) -> _Kernel:
    """Kernels with H = factor² · covariance + diag((1e-6 · span)²), one for each pool (R, M, B).

    The covariance of fewer than two points counts as 0.
    """
    there = present(pool)
    count = there.sum(axis=1)
    # In parts of the span, so that the ridge weighs alike on axes of different units.
    scaled = np.where(there[:, :, None], pool / span, 0.0)
    mean = _over_points(scaled) / np.maximum(count, 1)[:, None]
    deviation = np.where(there[:, :, None], scaled - mean[:, None, :], 0.0)
    axes = pool.shape[2]
    products = deviation[:, :, :, None] * deviation[:, :, None, :]
    covariance = _over_points(products.reshape(*there.shape, -1)).reshape(-1, axes, axes)
    covariance /= np.maximum(count - 1, 1)[:, None, None]
    value, vector = np.linalg.eigh(covariance)
    # Rounding can leave the covariance of points on a line with an eigenvalue below 0.
    value = factor**2 * np.maximum(value, 0.0) + _RIDGE**2
    kernel = _from_axes(value, vector)
    return _Kernel(kernel.whiten / span[:, None], kernel.peak / np.prod(span))


def _kernel(matrix: Floats, axes: int) -> _Kernel:
    """Kernel with bandwidth matrix (B, B), or kernels with (R, B, B)."""
    if matrix.ndim < 2 or matrix.shape[-2:] != (axes, axes):
        raise NichechainError(
            f"bandwidth matrix has shape {matrix.shape[-2:]}, but behavior needs {(axes, axes)}"
        )
    _check_matrix(matrix)
    value, vector = np.linalg.eigh(matrix.reshape(-1, axes, axes))
    return _from_axes(value, vector)


def _from_axes(value: Floats, vector: Floats) -> _Kernel:
    """Kernel from the eigenvalues (R, B) and eigenvectors (R, B, B) of H."""
    # One factor at a time: the determinant of a narrow bandwidth may be below the smallest float.
    peak: Floats = np.prod(1.0 / np.sqrt(2.0 * math.pi * value), axis=1)
    return _Kernel(vector / np.sqrt(value)[:, None, :], peak)


def _check_matrix(matrix: Floats) -> None:
    if matrix.ndim < 2 or matrix.shape[-1] != matrix.shape[-2]:
        raise NichechainError(f"bandwidth matrix has shape {matrix.shape}, but must be square")
    if not np.isfinite(matrix).all():
        raise NichechainError("bandwidth matrix has NaN or infinite values, but must be finite")
    if not np.allclose(matrix, np.swapaxes(matrix, -1, -2), rtol=1e-9, atol=0.0):
        raise NichechainError("bandwidth matrix is not symmetric, but must be")
    value = np.linalg.eigvalsh(matrix)
    if (value <= np.finfo(np.float64).eps * matrix.shape[-1] * value.max(axis=-1, keepdims=True)).any():
        raise NichechainError(
            f"bandwidth matrix has smallest eigenvalue {value.min():g}, but must be positive definite, "
            "not singular"
        )


def _times(points: Floats, maps: Floats) -> Floats:
    """Points (R, N, B) as row vectors times maps (R or 1, B, B), in a fixed order of summation."""
    return ordered_sum(points[:, :, None, :] * np.swapaxes(maps, 1, 2)[:, None, :, :])


def _over_points(values: Floats) -> Floats:
    """Sum of (R, M, C) over its M points, from the first to the last."""
    return ordered_sum(np.swapaxes(values, 1, 2))
