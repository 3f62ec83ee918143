"""Small searches of pyribs, and a plain account of what they add."""

from __future__ import annotations

import numpy as np
from ribs.archives import CVTArchive, GridArchive
from ribs.emitters import EvolutionStrategyEmitter, GaussianEmitter, GeneticAlgorithmEmitter, IsoLineEmitter
from ribs.schedulers import Scheduler

from nichechain import variation
from nichechain.pyribs import MutationEmitter
from nichechain.pyribs.recording import recording_of

RANGES = [(-1.0, 1.0), (-0.8, 0.9)]
INITIAL = np.random.default_rng(2).uniform(-1.5, 1.5, (40, 5))
TINY = 1e-9


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


def gaussian(archive, sigma=TINY, **options):
    return GaussianEmitter(archive, sigma=sigma, initial_solutions=INITIAL, batch_size=20, seed=3, **options)


def iso_line(archive, **options):
    sigmas = {"iso_sigma": TINY, "line_sigma": 0.0, **options}
    return IsoLineEmitter(archive, **sigmas, initial_solutions=INITIAL, batch_size=20, seed=4)


def genetic(archive, operator="gaussian", **kwargs):
    return GeneticAlgorithmEmitter(
        archive,
        operator=operator,
        operator_kwargs=kwargs or {"sigma": TINY},
        initial_solutions=INITIAL,
        batch_size=20,
        seed=5,
    )


def ours(archive):
    return MutationEmitter(
        archive, variation.gaussian(TINY), initial_solutions=INITIAL, batch_size=20, seed=6
    )


def genetic_line(archive):
    return genetic(archive, "isoline", iso_sigma=TINY, line_sigma=0.0)


def strategist(archive):
    # Of the strategies this is the one that numba does not have to compile first.
    return EvolutionStrategyEmitter(
        archive, x0=np.zeros(5), sigma0=0.3, es="openai_es", batch_size=10, seed=8
    )


def check_table(frame, archive):
    """What holds for any births: parents came before, and stood where the child says."""
    children = frame[frame["parent_uid"].notna()]
    parents = frame.loc[children["parent_uid"].astype(int)]
    assert (children.index > parents.index).all()
    assert (children["step"].to_numpy() > parents["step"].to_numpy()).all()
    assert (children["parent_niche"].to_numpy() == parents["child_niche"].to_numpy()).all()
    assert (children["depth"].to_numpy() == parents["depth"].to_numpy() + 1).all()
    assert frame["uid"].tolist() == list(range(len(frame)))
    # Someone who became an elite is there now, or was replaced by a later one of the same cell.
    assert set(recording_of(archive).elites()[1].tolist()) <= set(frame[frame["accepted"]].index)


def children_near_parents(births, solutions):
    """How many births have a parent, from which each is a tiny step away."""
    children = births["parent_uid"].notna()
    parents = solutions[births["parent_uid"][children].astype(int)]
    assert np.abs(solutions[children] - parents).max() < 100 * TINY
    return children.sum()
