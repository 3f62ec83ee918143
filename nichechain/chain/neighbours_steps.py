"""The loop of :mod:`nichechain.chain.neighbours`, compiled.

A module of its own, since whoever draws nothing need not wait for the compiler to be loaded.
"""

from __future__ import annotations

from typing import Any

import numba


@numba.njit(nogil=True, cache=True)
def draw(said: Any, shift: Any, moves: Any, pairs: Any, niches: Any, asked: Any, drawn: Any) -> None:
    """Write a column for each row that is asked for: whose words are taken, then which birth's."""
    through, mass = said
    start, child, births = pairs
    rows, uniform = asked
    offsets = shift.size
    for k in range(rows.size):
        row = rows[k]
        left = uniform[k, 0] * mass[row]
        voice = -1
        for v in range(2 * offsets):
            if through[v, row] > 0.0:
                voice = v
                left -= through[v, row]
                if left < 0.0:
                    break
        kind, offset = voice // offsets, voice % offsets
        speaker = row - shift[offset]
        total = 0.0
        for e in range(start[speaker], start[speaker + 1]):
            if kind == 0 or moves[offset, e]:
                total += births[kind, e]
        left = uniform[k, 1] * total
        chosen = -1
        for e in range(start[speaker], start[speaker + 1]):
            if (kind == 0 or moves[offset, e]) and births[kind, e] > 0.0:
                chosen = e
                left -= births[kind, e]
                if left < 0.0:
                    break
        column = child[chosen]
        drawn[k] = column + shift[offset] if kind == 1 and column < niches else column
