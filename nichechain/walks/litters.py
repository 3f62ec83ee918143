"""Offspring that all who are scored in a step get, where a metric scores by them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain import births
from nichechain.births.table import NONE, Offspring, niches_of
from nichechain.core.randomness import Purpose
from nichechain.domains.base import Evaluation
from nichechain.niches import Niches
from nichechain.variation import Mutation
from nichechain.variation.unborn import Unborn

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Scored:
    """The states of R walks and the children of a step, Q of each walk.

    Parameters
    ----------
    genotype : (R, Q, P) float32 array
    uid, depth, niche : (R, Q) int64 arrays
    """

    genotype: NDArray[np.float32]
    uid: Ints
    depth: Ints
    niche: Ints


@dataclass(frozen=True)
class Litters:
    """What became of their offspring.

    Parameters
    ----------
    landed : (R, Q, m) int64 array
        States of the offspring; ``NONE`` where one failed, or its parent did and has none.
    births : pyarrow.Table
        The offspring, in the columns of :mod:`nichechain.births.table`; none of them is accepted.
    """

    landed: Ints
    births: pa.Table

    @classmethod
    def born(
        cls,
        scored: Scored,
        mutate: Mutation,
        seeds: Sequence[int],
        run: Ints,
        *,
        first: int,
        each: int,
        step: int,
        niches: Niches,
        evaluate: Callable[[Unborn], Evaluation],
    ) -> Litters:
        """Make and evaluate them.

        Parameters
        ----------
        scored : Scored
        mutate : Mutation
        seeds : sequence of int
            One for each walk.
        run : (R,) int64 array
        first : int
            Number of the first, within each walk.
        each : int
            m, how many each gets.
        step : int
        niches : Niches
        evaluate : callable
        """
        walks, count = scored.uid.shape
        place = np.arange(walks * count * each)
        # Whoever failed has no offspring.
        place = place[scored.niche.ravel()[place // each] != NONE]
        parent, uid = place // each, first + place % (count * each)
        unborn = Unborn(
            mutate,
            Purpose.MUTATION,
            scored.genotype.reshape(walks * count, -1),
            [seed for seed in seeds for _ in range(count)],
            parent,
            uid,
        )
        evaluation = evaluate(unborn)
        landed = niches_of(evaluation, niches)
        offspring = Offspring(
            unborn,
            uid,
            scored.uid.ravel()[parent],
            scored.niche.ravel()[parent],
            scored.depth.ravel()[parent] + 1,
            np.zeros(uid.size, bool),
        )
        table = births.make_table(
            offspring,
            evaluation,
            child_niche=landed,
            accepted=np.zeros(uid.size, bool),
            step=step,
            run=run[parent // count],
        )
        every = np.full(walks * count * each, NONE, np.int64)
        every[place] = landed
        return cls(every.reshape(walks, count, each), table)
