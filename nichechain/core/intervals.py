"""Means over runs with their intervals, and intervals of posterior draws."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

LEVEL = 0.95
"""Level of every interval over runs."""

DRAWN = (0.05, 0.95)
"""Shares of posterior draws below the two ends of every interval of an answer."""


def drawn_interval(draws: ArrayLike, axis: int = 0) -> tuple[Floats, Floats]:
    """5 % and 95 % quantiles of posterior draws.

    Parameters
    ----------
    draws : array
        Draws along one axis.
    axis : int
        Which one.

    Returns
    -------
    low, high : arrays without that axis

    Notes
    -----
    By place k / (n + 1), ``method="weibull"``: another draw falls within the interval nine times of
    ten. NumPy's default takes the ends of a sample for those of the distribution, so that intervals of
    few draws are too narrow (Hyndman and Fan 1996, definition 6).
    """
    low, high = np.quantile(np.asarray(draws, np.float64), DRAWN, axis=axis, method="weibull")
    return low, high


def no_interval(value: Floats) -> tuple[Floats, Floats]:
    """The bounds of values of a single T: a given one, or an estimate without a posterior, has no spread."""
    none = np.full_like(value, np.nan, dtype=np.float64)
    return none, none


def mean_interval(values: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Mean over runs with its t-interval.

    Parameters
    ----------
    values : (N, ...) array
        One row per run; NaN where a run has no value.

    Returns
    -------
    mean, low, high : (...) arrays
        The bounds are NaN where fewer than two runs have a value, and so is the mean where none has.
    """
    from scipy import stats

    value = np.asarray(values, np.float64)
    n = (~np.isnan(value)).sum(axis=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        mean = np.nanmean(value, axis=0)
        error = stats.sem(value, axis=0, nan_policy="omit")
    # With no spread the interval is a point, for which SciPy gives NaN.
    half = np.where(n > 1, stats.t.ppf((1 + LEVEL) / 2, np.maximum(n - 1, 1)) * error, np.nan)
    return np.asarray(mean), np.asarray(mean - half), np.asarray(mean + half)
