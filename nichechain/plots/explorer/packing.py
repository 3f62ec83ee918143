"""Numbers as text that a browser unpacks at once."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_MOST = 65_535


def packed(values: Any, kind: type[np.generic]) -> str:
    """An array as base64, little-endian, which is what every browser's typed arrays are."""
    array = np.ascontiguousarray(values).astype(np.dtype(kind).newbyteorder("<"))
    return base64.b64encode(array.tobytes()).decode("ascii")


def in_steps(values: Floats) -> tuple[Floats, NDArray[np.uint16]]:
    """Numbers from 0 as 65,535 steps up to the largest of each block, half the size of floats.

    Parameters
    ----------
    values : (..., m) float64 array
        None negative; a block is along the last axis.

    Returns
    -------
    scale : (...) float64 array
    steps : (..., m) uint16 array
        A value is ``steps * scale / 65535``, to a part in 130,000 of the largest.
    """
    scale = np.maximum(values.max(axis=-1), 1e-9)
    return scale, np.rint(values / scale[..., None] * _MOST).astype(np.uint16)
