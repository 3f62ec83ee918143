"""Small searches of pyribs, and a plain account of what they add."""

from __future__ import annotations

import numpy as np
from ribs.archives import CVTArchive, GridArchive
from ribs.schedulers import Scheduler

RANGES = [(-1.0, 1.0), (-0.8, 0.9)]


def grid(**options):
    settings = {"solution_dim": 5, "dims": (7, 6), "ranges": RANGES, "seed": 1}
    return GridArchive(**{**settings, **options})


def cvt(**options):
    centroids = np.random.default_rng(0).uniform([-1, -0.8], [1, 0.9], (30, 2))
    return CVTArchive(solution_dim=5, centroids=centroids, ranges=RANGES, seed=1, **options)


def evaluate(solutions):
    """Objective, and the hand of a planar arm, which leaves the ranges now and then."""
    angles = np.cumsum(solutions, axis=1)
    measures = np.stack([np.cos(angles).mean(axis=1), np.sin(angles).mean(axis=1)], axis=1)
    return -np.round(np.var(solutions, axis=1), 2), measures


def run(scheduler, iterations, evaluation=evaluate):
    """Run a search; returns every solution that was added, in order."""
    added = []
    for _ in range(iterations):
        solutions = scheduler.ask()
        added.append(solutions.copy())
        scheduler.tell(*evaluation(solutions))
    return np.concatenate(added)


def search(archive, *emitters, **options):
    return Scheduler(archive, list(emitters), **options)
