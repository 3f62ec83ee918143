"""The elites of a search: *the largest key wins* a niche.

They live in a pyribs archive, and the outside state's beside it. The elites after N births are a function of
the set of births, in whatever order they came.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE, Offspring
from nichechain.core.columns import Columnar
from nichechain.domains.base import Domain
from nichechain.niches import Niches
from nichechain.niches.ribs import empty_archive
from nichechain.search.lineages import UnderWay


@dataclass(frozen=True)
class Elites(Columnar):
    """The elites of the occupied states, sorted by state; the outside elite comes last.

    Parameters
    ----------
    niche : (K,) int64 array
    genotype : (K, P) float32 array
    behavior : (K, B) float64 array
    objective : (K,) float64 array
    key : (K,) float64 array
        What won the niche.
    uid, depth : (K,) int64 arrays
    """

    niche: NDArray[np.int64]
    genotype: NDArray[np.float32]
    behavior: NDArray[np.float64]
    objective: NDArray[np.float64]
    key: NDArray[np.float64]
    uid: NDArray[np.int64]
    depth: NDArray[np.int64]

    @classmethod
    def none(cls, length: int, axes: int) -> Elites:
        """No elite, of genotypes of that length and behaviors of so many axes."""
        whole, real = np.empty(0, np.int64), np.empty(0)
        return cls(whole, np.empty((0, length), np.float32), np.empty((0, axes)), real, real, whole, whole)

    def winners(self) -> Elites:
        """Of every state, the one with the largest key; of equal keys, the one with the smallest uid."""
        ordered = self[np.lexsort((self.uid, -self.key, self.niche))]
        return ordered[np.flatnonzero(np.diff(ordered.niche, prepend=-1))]


@dataclass(frozen=True)
class SearchState:
    """All that a search has to remember between two steps; it has no generator.

    Parameters
    ----------
    elites : Elites
    pending : Offspring
        The children of the last step that the budget did not reach. They are evaluated first
        when the search goes on, so that it ends as if it had never stopped.
    births : int
        Births so far.
    step : int
        The last step begun, 0 for the initial births; -1 before them.
    lineages : UnderWay
        Those under way.
    contenders : Elites
        Births that contest a niche and have not been judged yet, see :mod:`nichechain.search.contests`.
    """

    elites: Elites
    pending: Offspring
    births: int
    step: int
    lineages: UnderWay
    contenders: Elites

    @classmethod
    def at_rest(cls, elites: Elites, births: int, step: int) -> SearchState:
        """A state of a search that has nothing under way."""
        length, axes = elites.genotype.shape[1], elites.behavior.shape[1]
        nobody = Elites.none(length, axes)
        return cls(elites, Offspring.none(length), births, step, UnderWay.none(length), nobody)


class EliteArchive:
    """A pyribs archive for the niches, and beside it the elite of the outside state."""

    def __init__(self, domain: Domain, niches: Niches) -> None:
        self._niches = niches
        self._grid = empty_archive(
            niches,
            solution_dim=domain.genotype_length,
            solution_dtype=np.float32,
            objective_dtype=np.float64,
            measures_dtype=np.float64,
            extra_fields={
                "domain_objective": ((), np.float64),
                "key": ((), np.float64),
                "uid": ((), np.int64),
                "depth": ((), np.int64),
            },
        )
        self._outside: Elites | None = None
        self._largest_key = [-np.inf] * (len(niches) + 1)
        self._uid = np.full(len(niches) + 1, NONE, np.int64)
        self._puts = 0

    @property
    def filled(self) -> int:
        """Niches with an elite; the outside state is not one."""
        return len(self._grid)

    def offer(self, niche: NDArray[np.int64], key: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Judge births that did not fail: one by one, so that it does not matter how batches are cut.

        Parameters
        ----------
        niche : (N,) int64 array
        key : (N,) float64 array

        Returns
        -------
        (N,) bool array
            Whose key is larger than all before it in its niche. The last of each niche has to be
            put in.
        """
        accepted = np.zeros(len(niche), bool)
        for i, (state, value) in enumerate(zip(niche.tolist(), key.tolist(), strict=True)):
            if value > self._largest_key[state]:
                self._largest_key[state] = value
                accepted[i] = True
        return accepted

    def put(self, winners: Elites) -> None:
        """Put in the elites of some states, whoever was there before.

        pyribs gets only those in the grid: it would put the others in edge cells without a word. To it
        the later is the better, since keys are compared here, and may have fallen since they won.
        """
        self._puts += 1
        self._uid[winners.niche] = winners.uid
        for state, key in zip(winners.niche.tolist(), winners.key.tolist(), strict=True):
            self._largest_key[state] = key
        inside = winners[winners.niche < len(self._niches)]
        if len(inside):
            self._grid.add(
                inside.genotype,
                np.full(len(inside), float(self._puts)),
                inside.behavior,
                domain_objective=inside.objective,
                key=inside.key,
                uid=inside.uid,
                depth=inside.depth,
            )
        outside = winners[winners.niche == len(self._niches)]
        if len(outside):
            self._outside = outside

    def occupied(self) -> NDArray[np.int64]:
        """States that have an elite, sorted."""
        inside = np.sort(self._grid.data("index")).astype(np.int64)
        return inside if self._outside is None else np.append(inside, len(self._niches))

    def uids(self, state: NDArray[np.int64]) -> NDArray[np.int64]:
        """Number of the elite of each of some occupied states."""
        return self._uid[state]

    def elites(self, state: NDArray[np.int64]) -> Elites:
        """The elite of each of some occupied states, which may repeat."""
        inside = np.flatnonzero(state < len(self._niches))
        _, data = self._grid.retrieve(self._niches.centers[state[inside]])
        found = Elites(
            state[inside],
            data["solution"],
            data["measures"],
            data["domain_objective"],
            data["key"],
            data["uid"],
            data["depth"],
        )
        if self._outside is None:
            return found
        # Row len(found) stands for the outside elite.
        rows = np.full(len(state), len(found))
        rows[inside] = np.arange(len(found))
        return Elites.concatenate([found, self._outside])[rows]
