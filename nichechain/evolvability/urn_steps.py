"""Loops of :mod:`nichechain.evolvability.urns`, compiled.

A module of its own, since whoever needs none of them need not wait for the compiler to be loaded.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nichechain.core.compiled import compiled


@compiled
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
