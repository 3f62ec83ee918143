"""Niches as plain values that JSON can hold, and back: what a table of births carries with it."""

from __future__ import annotations

from typing import Any

import numpy as np

from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.niches.base import Niches
from nichechain.niches.cvt import CVTNiches
from nichechain.niches.grid import GridNiches

ATTRIBUTE = "niches"
"""Where a table of births has them, among ``DataFrame.attrs``."""


def to_plain(niches: Niches) -> dict[str, Any]:
    """Plain values of niches; centroids are a text, which a table copies at no cost."""
    values = niches.settings()
    if isinstance(niches, CVTNiches):
        values["centroids"] = niches.centroids.tobytes().hex()
    return values


def from_plain(values: dict[str, Any]) -> Niches:
    """The niches that :func:`to_plain` has written.

    Raises
    ------
    NichechainError
        If the values are of something else.
    """
    try:
        bounds = tuple((float(low), float(high)) for low, high in values["bounds"])
        shape, outside = tuple(values["shape"]), values["outside"]
        if values["niches"] == GridNiches.kind:
            return GridNiches(shape, bounds, outside, values["epsilon"])
        centroids = np.frombuffer(bytes.fromhex(values["centroids"])).reshape(shape[0], len(bounds))
        return CVTNiches(centroids, bounds, outside)
    except (KeyError, TypeError, ValueError) as error:
        raise NichechainError(f"values are {shown(values)}, which are of no niches") from error
