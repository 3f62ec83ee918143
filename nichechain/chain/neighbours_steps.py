"""The loop of :mod:`nichechain.chain.neighbours`, compiled.

A module of its own, since whoever draws nothing need not wait for the compiler to be loaded.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from nichechain.core.compiled import compiled


@numba.njit(nogil=True, inline="always")
def _below(upto: Any, wanted: Any) -> Any:
    """The part that a number below the whole lies in, the last that is anything where rounding says none."""
    place = np.searchsorted(upto, wanted, "right")
    return place if place < upto.size else np.searchsorted(upto, upto[-1], "left")


@compiled
def draw(voices: Any, shift: Any, moves: Any, pairs: Any, niches: Any, asked: Any, drawn: Any) -> None:
    """Write a column for each row that is asked for: whose words are taken, then which birth's."""
    start, child, upto = pairs
    rows, uniform = asked
    offsets = shift.size
    for k in range(rows.size):
        said = voices[rows[k]]
        voice = _below(said, uniform[k, 0] * said[-1])
        kind, offset = voice // offsets, voice % offsets
        speaker = rows[k] - shift[offset]
        begin, end = start[speaker], start[speaker + 1]
        before, births = upto[kind, begin], upto[kind, begin + 1 : end + 1]
        wanted = before + uniform[k, 1] * (births[-1] - before)
        chosen = _below(births, wanted)
        if kind == 1 and not moves[offset, begin + chosen]:
            # One that this row does not hear of: one that it does, by what is left of the number.
            below = births[chosen - 1] if chosen else before
            left = min((wanted - below) / (births[chosen] - below), 1.0)
            heard = np.diff(upto[kind, begin : end + 1]) * moves[offset, begin:end]
            heard = np.cumsum(heard)
            chosen = _below(heard, left * heard[-1])
        column = child[begin + chosen]
        drawn[k] = column + shift[offset] if kind == 1 and column < niches else column
