"""Meta-evolvability: how evolvable the offspring of a genotype are, measured by theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE, niches_of
from nichechain.core.checks import check_at_least, check_lineages, check_seed
from nichechain.core.intervals import mean_interval
from nichechain.core.randomness import Purpose
from nichechain.core.rarefaction import niches_among
from nichechain.variation.unborn import Unborn, check_litter, litters

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive, Elite
    from nichechain.execution import Executor

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class MetaEvolvability:
    """Mean 1-evolvability of the children of a genotype, measured to two generations.

    Parameters
    ----------
    value, low, high : float
        The mean over children with its 95 % t-interval.
    own : float
        1-evolvability of the genotype itself, by the same children and as many lineages.
    of_children : tuple of float
        1-evolvability of each child, 0 of one that failed.
    lineages : int
        How many offspring a number of niches is of.
    offspring : int
        Offspring evaluated of each child.
    failed : int
        Children that failed.
    """

    value: float
    low: float
    high: float
    own: float
    of_children: tuple[float, ...]
    lineages: int
    offspring: int
    failed: int


def meta_evolvability(
    archive: Archive,
    elite: Elite,
    *,
    children: int = 30,
    offspring: int = 10,
    lineages: int | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    on_done: Callable[[int], None] | None = None,
) -> MetaEvolvability:
    """How evolvable the offspring of a genotype are: two generations are evaluated, none is modelled.

    Parameters
    ----------
    archive : Archive
        Where domain, mutation and niches come from.
    elite : Elite
        The genotype, such as ``archive.elite((7, 11))``.
    children : int
        How many of its children are measured, at least 2.
    offspring : int
        How many offspring measure each of them, at least 1.
    lineages : int, optional
        U: niches are counted that so many offspring land in; by default, and at most, the smaller of
        ``offspring`` and ``children``.
    seed : int
        Children are those of the same seed that :func:`genotype_evolvability` evaluates.
    executor : Executor, optional
        Where to evaluate; by default here, all of a generation at once.
    on_done : callable, optional
        Told how many more have been evaluated, of ``children * (1 + offspring)`` where none fails.

    Returns
    -------
    MetaEvolvability

    Raises
    ------
    NichechainError
        If a number is out of range.

    Notes
    -----
    Source: the paper's "potential for evolvability", meta-evolvability. Of each child, the expected number of
    niches among U of its offspring is estimated without bias by rarefaction, and so is their mean. What
    failed lands in no niche. Every grandchild has noise of its own, so that children are independent.
    """
    check_at_least(2, children=children)
    check_at_least(1, offspring=offspring)
    check_seed(seed)
    most = min(offspring, children)
    check_lineages(most, lineages=lineages)
    check_litter(offspring, children)
    size = most if lineages is None else lineages
    mutate = archive.mutate

    def landed(unborn: Unborn) -> Ints:
        domain = archive.domain
        if executor is not None:
            return niches_of(executor.evaluate(domain, unborn, on_done), archive.niches)
        found = domain.evaluate(unborn.grow())
        if on_done is not None:
            on_done(len(unborn))
        return niches_of(found, archive.niches)

    first = litters(mutate, Purpose.OFFSPRING, np.asarray(elite.genotype)[None], seed, children)
    born = landed(first)
    fine = np.flatnonzero(born != NONE)
    values = np.zeros(children)
    if fine.size:
        parent = np.repeat(np.arange(fine.size), offspring)
        # By the number of the child, whoever else failed.
        number = (fine[:, None] * offspring + np.arange(offspring)).ravel()
        second = Unborn(mutate, Purpose.GRANDCHILD, first[fine].grow(), (seed,) * fine.size, parent, number)
        niches = len(archive.niches)
        for child, states in zip(fine.tolist(), landed(second).reshape(fine.size, offspring), strict=True):
            values[child] = niches_among(states, niches, size)
    mean, low, high = (float(bound) for bound in mean_interval(values))
    return MetaEvolvability(
        value=mean,
        low=max(0.0, low),
        high=high,
        own=niches_among(born, len(archive.niches), size),
        of_children=tuple(values.tolist()),
        lineages=size,
        offspring=offspring,
        failed=children - fine.size,
    )
