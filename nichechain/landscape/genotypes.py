"""Measures of genotypes: make offspring, evaluate them, measure their behaviors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_floats
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose
from nichechain.domains.base import Domain, check_genotypes
from nichechain.landscape.behaviors import EPSILON
from nichechain.landscape.measures import check_sample_size, measure_behaviors
from nichechain.variation import Mutation
from nichechain.variation.unborn import litters

if TYPE_CHECKING:
    from nichechain.execution import Executor
    from nichechain.niches import Niches


@dataclass(frozen=True)
class GenotypeMeasures:
    """Local measures of one genotype, from a sample of its offspring.

    Parameters
    ----------
    sample_size : int
        Offspring evaluated.
    failed : int
        Those whose evaluation failed, which no measure counts.
    local_sensitivity, expected_local_sensitivity : float
        LS and LS*, in units of behavior. LS is a lower bound where mutation is unbounded.
    evolvability, expected_evolvability : float
        η and η*, in units of behavior. η is a lower bound where mutation is unbounded.
    one_hot_evolvability : float, optional
        d/n; None where there are no niches.
    ratio, expected_ratio : float
        r and r*.
    hull_volume : float
        Hypervolume of the convex hull of the offspring.
    """

    sample_size: int
    failed: int
    local_sensitivity: float
    expected_local_sensitivity: float
    evolvability: float
    expected_evolvability: float
    one_hot_evolvability: float | None
    ratio: float
    expected_ratio: float
    hull_volume: float


def measure(
    domain: Domain,
    genotype: ArrayLike,
    mutate: Mutation,
    sample_size: int = 30,
    seed: int = 0,
    executor: Executor | None = None,
    *,
    niches: Niches | None = None,
    epsilon: float = EPSILON,
) -> GenotypeMeasures:
    """All local measures of one genotype (P,); the rest is as in :func:`measure_genotypes`."""
    genotypes = as_floats("genotype", genotype)[None]
    return measure_genotypes(
        domain, genotypes, mutate, sample_size, seed, executor, niches=niches, epsilon=epsilon
    )[0]


def measure_genotypes(
    domain: Domain,
    genotypes: ArrayLike,
    mutate: Mutation,
    sample_size: int = 30,
    seed: int = 0,
    executor: Executor | None = None,
    *,
    niches: Niches | None = None,
    epsilon: float = EPSILON,
) -> tuple[GenotypeMeasures, ...]:
    """All local measures of several genotypes, evaluated as one batch.

    Parameters
    ----------
    domain : Domain
    genotypes : (G, P) array
    mutate : Mutation
    sample_size : int
        Offspring of each genotype, at least 2.
    seed : int
        The i-th child is a function of its parent and this seed, so measures do not depend on
        which genotypes are measured together. They share the noise of their i-th children.
    executor : Executor, optional
        Where to evaluate; by default here.
    niches : Niches, optional
        For one-hot evolvability.
    epsilon : float
        As in :func:`dissimila_ratio`.

    Returns
    -------
    tuple of GenotypeMeasures

    Raises
    ------
    NichechainError
        If the genotypes have the wrong length, one of them fails, or the sample is too small.
    """
    parents = check_genotypes(genotypes, domain.genotype_length)
    check_sample_size(sample_size)
    batch = np.concatenate([parents, make_offspring(parents, mutate, sample_size, seed)])
    evaluation = domain.evaluate(batch) if executor is None else executor.evaluate(domain, batch)
    count = len(parents)
    for number in np.flatnonzero(evaluation.failed[:count]):
        raise NichechainError(f"genotype {number} failed to evaluate: {evaluation.reasons[number]}")
    parent, offspring = np.split(evaluation.behavior, [count])
    offspring = offspring.reshape(count, sample_size, parent.shape[1])
    found = measure_behaviors(parent, offspring, niches, epsilon=epsilon)
    return tuple(
        GenotypeMeasures(
            sample_size,
            int(found.failed[g]),
            float(found.local_sensitivity[g]),
            float(found.expected_local_sensitivity[g]),
            float(found.evolvability[g]),
            float(found.expected_evolvability[g]),
            None if niches is None else float(found.one_hot_evolvability[g]),
            float(found.ratio[g]),
            float(found.expected_ratio[g]),
            float(found.hull_volume[g]),
        )
        for g in range(count)
    )


def make_offspring(
    parents: NDArray[np.float32], mutate: Mutation, sample_size: int, seed: int
) -> NDArray[np.float32]:
    """Children to measure (G·n, P), those of the first parent first.

    The i-th child of every parent (G, P) is made with the same noise, whatever else is measured.
    """
    return litters(mutate, Purpose.OFFSPRING, parents, seed, sample_size).grow()
