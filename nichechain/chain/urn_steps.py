"""Loops of :mod:`nichechain.chain.urns`, compiled.

A module of its own, since whoever needs none of them need not wait for the compiler to be loaded.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nichechain.core.compiled import compiled


@compiled
def choose(
    start: Any,
    column: Any,
    upto: Any,
    strength: Any,
    stays: Any,
    states: Any,
    since: Any,
    done: Any,
    uniform: Any,
    origin: Any,
) -> None:
    """Where each child of the generation that begins at ``done`` comes from, given visits from ``since`` on.

    -1: from the base measure; -2 - j: as a birth in state j; else a copy of the child of the visit of
    that number.
    """
    g, lineages = uniform.shape
    size = start.size - 1
    last, times = np.full(size, -1), np.zeros(size, np.int64)
    before = np.empty(done + lineages, np.int64)
    for root in range(g):
        for visit in range(since, done):
            state = states[root, visit]
            before[visit] = last[state]
            last[state] = visit
            times[state] += 1
        for k in range(lineages):
            visit = done + k
            state = states[root, visit]
            if state == stays:
                origin[root, k] = -2 - state
                continue
            begin, end = start[state], start[state + 1]
            known = upto[end] - upto[begin]
            place = uniform[root, k] * (strength[state] + known + times[state])
            if place < known:
                at = begin + np.searchsorted(upto[begin + 1 : end + 1], upto[begin] + place, "right")
                origin[root, k] = -2 - column[min(at, end - 1)]
            elif place < known + times[state]:
                back = min(np.int64(place - known), times[state] - 1)
                at = last[state]
                for _ in range(back):
                    at = before[at]
                origin[root, k] = at
            else:
                origin[root, k] = -1
            before[visit] = last[state]
            last[state] = visit
            times[state] += 1
        for visit in range(since, done + lineages):
            state = states[root, visit]
            last[state] = -1
            times[state] = 0


@compiled
def resolve(origin: Any, fresh: Any, states: Any, done: Any) -> None:
    """The children: that of visit v is in place v + M, M after its parent."""
    g, lineages = origin.shape
    for root in range(g):
        for k in range(lineages):
            source = origin[root, k]
            if source == -1:
                states[root, done + k] = fresh[root, k]
            elif source < -1:
                states[root, done + k] = -2 - source
            else:
                states[root, done + k] = states[root, source + lineages]
