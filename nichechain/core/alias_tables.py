"""Loops of :mod:`nichechain.core.row_sampler`, compiled.

A module of its own, since whoever draws nothing need not wait for the compiler to be loaded.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nichechain.core.compiled import compiled


@compiled
def tables(start: Any, column: Any, weight: Any) -> Any:
    """For each cell the share that is its own entry's, and whose the rest is."""
    keep = np.ones(column.size)
    other = column.copy()
    small, large = np.empty(column.size, np.int64), np.empty(column.size, np.int64)
    for row in range(start.size - 1):
        begin, end = start[row], start[row + 1]
        total = weight[begin:end].sum()
        few = many = 0
        for cell in range(begin, end):
            keep[cell] = weight[cell] / total * (end - begin)
            if keep[cell] < 1.0:
                small[few] = cell
                few += 1
            else:
                large[many] = cell
                many += 1
        while few > 0 and many > 0:
            few -= 1
            poor, rich = small[few], large[many - 1]
            other[poor] = column[rich]
            keep[rich] -= 1.0 - keep[poor]
            if keep[rich] < 1.0:
                many -= 1
                small[few] = rich
                few += 1
        # What rounding left over is whole.
        for k in range(few):
            keep[small[k]] = 1.0
        for k in range(many):
            keep[large[k]] = 1.0
    return keep, other


@compiled
def draw(start: Any, column: Any, keep: Any, other: Any, rows: Any, uniform: Any, drawn: Any) -> None:
    """Write one column for each of some rows."""
    for k in range(rows.size):
        begin = start[rows[k]]
        size = start[rows[k] + 1] - begin
        place = uniform[k] * size
        # A uniform number just below 1 could round up to the size itself.
        cell = min(np.int64(place), size - 1)
        at = begin + cell
        drawn[k] = column[at] if place - cell < keep[at] else other[at]
