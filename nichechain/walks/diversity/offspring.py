"""A diversity metric that is no metric of behaviors: in how many niches a candidate's own offspring land."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_at_least, check_lineages
from nichechain.core.errors import NichechainError
from nichechain.core.rarefaction import niches_among
from nichechain.walks.diversity.metrics import Surroundings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class OffspringNiches:
    """Expected number of niches in which U of m offspring of a candidate land: its 1-evolvability.

    A walk that selects for it climbs evolvability itself. Every state and every child of a step then has m
    offspring evaluated, which are births of the walk.

    Parameters
    ----------
    offspring : int
        m, at least 1.
    lineages : int, optional
        U, from 1 to m; by default m.

    Raises
    ------
    NichechainError
        If a number is out of range.

    Notes
    -----
    By rarefaction; a child that failed lands in no niche, and neither does one outside. Offspring by which
    candidates are compared are not those that measure a state in the next step, so that what a walk
    reports of the states it selected is not too good by the luck of the selection.
    """

    offspring: int = 10
    lineages: int | None = None

    def __post_init__(self) -> None:
        check_at_least(1, offspring=self.offspring)
        check_lineages(self.offspring, lineages=self.lineages)

    @property
    def remembers(self) -> bool:
        """It does not look at the novelty archive."""
        return False

    @property
    def litter(self) -> int:
        """Offspring of each candidate that it asks for."""
        return self.offspring

    def __call__(self, query: Floats, lineage: Ints, itself: Ints, around: Surroundings) -> Floats:  # noqa: ARG002
        """Score behaviors (R, Q, B).

        Raises
        ------
        NichechainError
            If there are no litters to score by.
        """
        if around.litters is None:
            raise NichechainError("litters are missing, but candidates are scored by their own offspring")
        score = np.full(query.shape[:2], np.nan)
        for walk, place in np.argwhere(np.isfinite(query).all(axis=2)).tolist():
            landed = around.litters[walk, place]
            score[walk, place] = niches_among(landed, around.niches, self.lineages or landed.size)
        return score
