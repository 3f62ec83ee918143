"""What so many of a sample would have shown, drawn from it without replacement."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def distinct_among(counts: Ints, total: int, size: int) -> float:
    """Expected number of distinct kinds among some of a sample.

    Parameters
    ----------
    counts : (n,) int64 array
        How many of the sample are of each kind that counts.
    total : int
        Size of the sample, which may have others as well.
    size : int
        How many are drawn, between 1 and ``total``.

    Returns
    -------
    float
        The number of kinds, exactly, where ``size`` is ``total``.

    Notes
    -----
    E = Σ_j 1 − C(m − c_j, U) / C(m, U); Hurlbert (1971), "The nonconcept of species diversity".
    """
    others = total - counts[counts > 0]
    possible = others[others >= size].astype(np.float64)
    log_missed = (
        gammaln(possible + 1) - gammaln(possible - size + 1) - gammaln(total + 1) + gammaln(total - size + 1)
    )
    return float(others.size - np.exp(log_missed).sum())


def niches_among(states: Ints, niches: int, size: int) -> float:
    """Expected number of distinct niches among some of those that landed in states.

    Parameters
    ----------
    states : (m,) int64 array
        What is negative landed nowhere.
    niches : int
        States from 0 to below it are niches.
    size : int
        How many are drawn, between 1 and m.
    """
    counts = np.unique(states[(states >= 0) & (states < niches)], return_counts=True)[1].astype(np.int64)
    return distinct_among(counts, states.size, size)


def mean_product(values: Floats, size: int) -> Floats:
    """Mean over all subsets of so many rows of the product of their values.

    Parameters
    ----------
    values : (m, c) float64 array
    size : int
        Rows of a subset, from 0 to m.

    Returns
    -------
    (c,) float64 array

    Notes
    -----
    The elementary symmetric polynomial of degree U over C(m, U). With P_i[u] the mean over subsets of u of
    the first i rows, P_i[u] = (1 − u/i) P_{i−1}[u] + (u/i) x_i P_{i−1}[u−1]: nothing overflows or cancels.
    """
    mean = np.zeros((size + 1, values.shape[1]))
    mean[0] = 1.0
    for i, row in enumerate(values, start=1):
        share = np.minimum(np.arange(1, size + 1) / i, 1.0)[:, None]
        mean[1:] = (1.0 - share) * mean[1:] + share * row * mean[:-1]
    whole: Floats = mean[size]
    return whole
