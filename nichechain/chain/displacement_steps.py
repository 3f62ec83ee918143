"""Loops of :mod:`nichechain.chain.displacement`, compiled.

A module of its own, since whoever needs none of them need not wait for the compiler to be loaded.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nichechain.core.compiled import compiled


@compiled
def landed(parent: Any, move: Any, shape: Any) -> Any:
    """Niche that each parent's child lands in by a number of the kernel, or -1 off the grid."""
    child = np.empty(parent.size, np.int64)
    for k in range(parent.size):
        cell, step, stride = parent[k], move[k], 1
        child[k] = 0
        for back in range(shape.size):
            side = shape[shape.size - 1 - back]
            place = cell % side + step % (2 * side - 1) - (side - 1)
            if place < 0 or place >= side:
                child[k] = -1
                break
            child[k] += place * stride
            cell //= side
            step //= 2 * side - 1
            stride *= side
    return child
