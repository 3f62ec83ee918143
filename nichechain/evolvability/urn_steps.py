"""Loops of :mod:`nichechain.evolvability.urns`, compiled.

A module of its own, since whoever needs none of them need not wait for the compiler to be loaded.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np


@numba.njit(nogil=True, cache=True)
def choose(
    start: Any,
    column: Any,
    upto: Any,
    strength: Any,
    stays: Any,
    states: Any,
    done: Any,
    uniform: Any,
    origin: Any,
) -> None:
    """Where each child of the generation that begins at ``done`` comes from.

    -1: from the base measure; -2 - j: as a birth in state j; else a copy of the child of the visit of
    that number.
    """
    g, lineages = uniform.shape
    size = start.size - 1
    last, times = np.full(size, -1), np.zeros(size, np.int64)
    before = np.empty(done + lineages, np.int64)
    for root in range(g):
        for visit in range(done):
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
            place = uniform[root, k] * (strength + known + times[state])
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
        for visit in range(done + lineages):
            state = states[root, visit]
            last[state] = -1
            times[state] = 0


@numba.njit(nogil=True, cache=True)
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


@numba.njit(nogil=True, cache=True)
def count(states: Any, lineages: Any, half: Any, niches: Any, whole: Any, early: Any, late: Any) -> Any:
    """Niches visited by some of all, of the first half and of the second half of lineages, (g, k) each."""
    g, visits = states.shape
    sizes = whole.shape[0]
    found = np.zeros((3, g, sizes))
    seen = np.full(niches, -1)
    number = np.zeros((niches, 2), np.int64)
    places = np.empty(visits, np.int64)
    for root in range(g):
        used = 0
        for lineage in range(lineages):
            side = 0 if lineage < half else 1
            for visit in range(lineage, visits, lineages):
                state = states[root, visit]
                if state >= niches or seen[state] == lineage:
                    continue
                seen[state] = lineage
                if number[state, 0] + number[state, 1] == 0:
                    places[used] = state
                    used += 1
                number[state, side] += 1
        for place in range(used):
            state = places[place]
            a, b = number[state]
            for k in range(sizes):
                found[0, root, k] += whole[k, a + b]
                found[1, root, k] += early[k, a]
                found[2, root, k] += late[k, b]
            number[state] = 0
            seen[state] = -1
    return found[0], found[1], found[2]
