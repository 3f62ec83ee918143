"""Random generators keyed by what they are for, so that no run has a generator's state to save.

Every draw of a run comes from ``keyed(seed, purpose, index)``: a child's mutation by its uid, the
parents of a step by the step, a posterior sample by its number. What is drawn therefore depends
on neither the order of evaluation, nor the number of workers, nor on where a run was interrupted.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from nichechain.core.checks import check_seed


class Purpose(IntEnum):
    """What a generator is for. The numbers are part of the archive format: never reuse one."""

    INITIAL = 0
    """Genotypes of the first step."""
    SELECTION = 1
    """Parents of a step; index: the step."""
    MUTATION = 2
    """A child's mutation; index: its uid."""
    REPLACEMENT = 3
    """Keys that decide who stays in a niche; index: the step."""
    POSTERIOR = 4
    """A draw of T; index: its number."""
    WALKS = 5
    """Monte Carlo walks; index: the draw of T they run on."""
    OFFSPRING = 6
    """A child made to measure its parent's evolvability; index: its number."""
    FIRST_GENERATION = 7
    """A draw of D, the distribution of a genotype's children; index: its number."""
    RUN = 8
    """Seed of one of many runs of a configuration; index: the number of the run."""
    NOVELTY_ARCHIVE = 9
    """Which births enter a novelty archive; index: the step."""
    PERMUTATION = 10
    """Relabellings of a permutation test; index: which test."""
    CHECKED = 11
    """Which elites the chain's predictions are checked on."""
    LINEAGE = 12
    """A birth in a lineage without selection; index: its elite, lineage and generation."""
    PREDICTION = 13
    """Lineages simulated on a draw of T; index: the draw."""
    CONDITION = 14
    """Seed of the runs of one condition of a study; index: a checksum of its label."""
    FOLDS = 20
    """Which elites are held out together."""
    THINNING = 21
    """Which births are left out to see what fewer would have told; index: the repeat."""
    RESAMPLING = 22
    """Runs or elites drawn with replacement; index: the resample."""
    VERIFICATION = 23
    """Which elites (index 0) and which births (index 1) of an archive are evaluated again."""
    LINEAGE_LAW = 40
    """Lineages simulated to see how far those of one elite overlap."""
    ELITE_ROW = 41
    """What one elite's children are drawn from; index: the draw of T and the state."""
    GRANDCHILD = 42
    """A child's child, made to measure meta-evolvability; index: its number."""
    LEFT_OUT = 43
    """Which elites the prior of an estimate is judged by, while it is made of the others' births."""
    TESSELLATION = 30
    """Uniform samples that a Voronoi tessellation is made of."""


def keyed(seed: int, purpose: Purpose, index: int = 0) -> np.random.Generator:
    """The generator for one purpose of a run.

    Parameters
    ----------
    seed : int
        Seed of the run, not negative.
    purpose : Purpose
    index : int
        Which of the draws for this purpose.

    Returns
    -------
    numpy.random.Generator
        PCG64 seeded with ``SeedSequence(seed, spawn_key=(purpose, index))``.

    Raises
    ------
    NichechainError
        If the seed is negative or no whole number.
    """
    check_seed(seed)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(int(purpose), index)))
