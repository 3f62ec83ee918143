"""A small chain that is given, and counts of births by a chain that is known."""

from __future__ import annotations

import numpy as np

from nichechain import GridNiches, TransitionCounts

T = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]])
GRID = GridNiches((3, 3), ((0.0, 3.0), (0.0, 3.0)))


def simulated_counts(births, seed=0, niches=GRID):
    rng = np.random.default_rng(seed)
    truth = rng.dirichlet(np.full(niches.states, 0.5), niches.states)
    parent = rng.integers(niches.states, size=births)
    child = np.array([rng.choice(niches.states, p=truth[i]) for i in parent])
    return TransitionCounts.from_pairs(parent, child, niches), truth
