"""Behavior as a category: the niche it falls in, and no distances."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nichechain.core.checks import as_floats
from nichechain.niches.base import Floats, Niches


def one_hot(behavior: ArrayLike, niches: Niches) -> Floats:
    """One-hot form of behaviors: 1 for the niche they belong to, 0 for all others.

    Parameters
    ----------
    behavior : (..., B) array
        NaN, the behavior of what failed, belongs to no niche.
    niches : Niches

    Returns
    -------
    (..., n) float64 array
        Rows of zeros for what lies outside or failed: the outside state is no niche.

    Raises
    ------
    NichechainError
        If the last axis does not fit or a value is infinite.

    Notes
    -----
    The paper's section "Behavior function and descriptors". Two behaviors are √2 apart where their niches
    differ and at no distance where they are one: how far niches lie from each other is gone. The
    measures of :mod:`nichechain.landscape` take this form like any behavior: η* is then √2 times
    the probability that two offspring fall in different niches.
    """
    points = as_floats("behavior", behavior)
    flat = points.reshape(-1, points.shape[-1]) if points.ndim else points
    known = ~np.isnan(flat).any(axis=-1)
    state = niches.of(flat[known])
    form = np.zeros((len(flat), len(niches)))
    inside = state < len(niches)
    form[np.flatnonzero(known)[inside], state[inside]] = 1.0
    return form.reshape(*points.shape[:-1], len(niches))
