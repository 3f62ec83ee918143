"""Dissimila: points far from their offspring, which are close to each other (Local "optima")."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_floats, check_numbers, check_share
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Where the distribution of r* over a set is reported."""


@dataclass(frozen=True)
class Dissimila:
    """Which points of a set are dissimila: dissimilar to their offspring, which resemble each other.

    Parameters
    ----------
    dissimila : (G,) bool array
        Not neutral, and of the smallest r*.
    neutral : (G,) bool array
        LS* is about 0: no offspring differs, so r* says nothing.
    threshold : float
        Largest r* of a dissimilum; NaN where every point is neutral.
    quantiles : (5,) array
        r* of the points that are not neutral, at :data:`QUANTILES`.
    """

    dissimila: Bools
    neutral: Bools
    threshold: float
    quantiles: Floats


def find_dissimila(
    ratio: ArrayLike, sensitivity: ArrayLike, *, share: float = 0.1, neutral: float = 1e-9
) -> Dissimila:
    """Flag the dissimila of a set ('Local "optima"').

    Parameters
    ----------
    ratio : (G,) array
        r* of each point; NaN where it could not be measured, which is never a dissimilum.
    sensitivity : (G,) array
        LS* of each point, in units of behavior.
    share : float
        Quantile of r* up to which a point is a dissimilum. The paper says "relatively small".
    neutral : float
        LS* up to which a point is neutral, in units of behavior.

    Raises
    ------
    NichechainError
        If ``share`` is outside (0, 1], ``neutral`` is negative or the shapes differ.
    """
    check_share(share=share)
    check_numbers(neutral=neutral)
    if not neutral >= 0:
        raise NichechainError(f"neutral is {neutral}, but must not be negative")
    value, spread = as_floats("ratio", ratio), as_floats("sensitivity", sensitivity)
    if value.ndim != 1 or value.shape != spread.shape:
        raise NichechainError(
            f"ratio and sensitivity have shapes {value.shape} and {spread.shape}, "
            "but must be one number per point"
        )
    still: Bools = spread <= neutral
    judged = ~still & ~np.isnan(value)
    if not judged.any():
        return Dissimila(np.zeros(len(value), bool), still, np.nan, np.full(len(QUANTILES), np.nan))
    # A value of the set itself, so that rounding cannot leave it out.
    threshold = float(np.quantile(value[judged], share, method="inverted_cdf"))
    return Dissimila(
        judged & (value <= threshold), still, threshold, np.quantile(value[judged], np.array(QUANTILES))
    )
