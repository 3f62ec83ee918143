"""Niches from what a configuration says of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nichechain.errors import NichechainError
from nichechain.niches.base import Floats, Niches
from nichechain.niches.cvt import CVTNiches
from nichechain.niches.grid import GridNiches

if TYPE_CHECKING:
    from nichechain.config import BuildConfig


def check(config: BuildConfig) -> None:
    """Refuse what :func:`make` would refuse, without making a tessellation.

    Raises
    ------
    NichechainError
        If the configuration's values do not fit together.
    """
    if config.niches == "grid":
        make(config)
    else:
        middle = [[(low + high) / 2.0 for low, high in config.bounds]]
        CVTNiches(np.array(middle), config.bounds, config.outside)


def make(config: BuildConfig, centroids: Floats | None = None) -> Niches:
    """The niches that a configuration asks for.

    Parameters
    ----------
    config : BuildConfig
    centroids : (n, B) array, optional
        Those of a tessellation that was made before; by default they are made from its seed.

    Raises
    ------
    NichechainError
        If the configuration's values, or the centroids, do not fit together.
    """
    if config.niches == "grid":
        return GridNiches(config.shape, config.bounds, config.outside)
    if centroids is None:
        return CVTNiches.tessellated(
            config.shape[0], config.bounds, seed=config.niches_seed, outside=config.outside
        )
    if len(centroids) != config.shape[0]:
        raise NichechainError(f"there are {len(centroids)} centroids, but must be {config.shape[0]}")
    return CVTNiches(centroids, config.bounds, config.outside)
