"""MAP-Elites that remembers who was born where, and from which niche.

One step: draw parents from the occupied niches, mutate, evaluate, keep. Elites live in
a pyribs archive. Which birth of a niche is its elite follows one rule, *the largest key wins*,
so the elites after N births are a function of the set of births, in whatever order they came.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain import births
from nichechain.births import NONE, Offspring
from nichechain.config import BuildConfig
from nichechain.domains.base import Domain, Evaluation
from nichechain.errors import NichechainError
from nichechain.execution import Executor
from nichechain.niches import CVTNiches, GridNiches, Niches
from nichechain.randomness import Purpose, keyed
from nichechain.savings import Savings
from nichechain.selection import CuriosityScores, draw_curious
from nichechain.variation import Mutation


@dataclass(frozen=True)
class Elites:
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

    def __len__(self) -> int:
        return len(self.niche)

    def __getitem__(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> Elites:
        return Elites(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @staticmethod
    def concatenate(first: Elites, second: Elites) -> Elites:
        """The rows of both."""
        names = Elites.__dataclass_fields__
        return Elites(*(np.concatenate([getattr(first, k), getattr(second, k)]) for k in names))


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
    """

    elites: Elites
    pending: Offspring
    births: int
    step: int


class MapElites:
    """The search loop.

    Parameters
    ----------
    domain : Domain
    niches : Niches
    mutate : Mutation
    config : BuildConfig
    state : SearchState, optional
        Where to go on from; by default from the start.
    curiosity : CuriosityScores, optional
        Scores after the births so far, where parents are selected by them and there is a state.

    Attributes
    ----------
    births : int
        Births so far.
    step : int
        The last step begun, -1 before the first.
    savings : Savings
        How much physics the births so far were spared, as far as they were evaluated here.
    settled : bool
        Whether the state is that after a finished batch, not in the middle of keeping one.

    Raises
    ------
    NichechainError
        If a search by curiosity is given a state and no scores.
    """

    def __init__(
        self,
        domain: Domain,
        niches: Niches,
        mutate: Mutation,
        config: BuildConfig,
        state: SearchState | None = None,
        curiosity: CuriosityScores | None = None,
    ) -> None:
        if config.selection == "curiosity" and state is not None and curiosity is None:
            raise NichechainError("a search that selects by curiosity goes on from its scores: give them")
        self._curiosity = curiosity or CuriosityScores()
        self._domain = domain
        self._niches = niches
        self._config = config
        self._mutate = mutate
        self._archive = _Archive(domain, niches)
        self._pending = _no_offspring(domain.genotype_length)
        self.births = 0
        self.step = -1
        self.savings = Savings()
        self.settled = True
        if state is not None:
            self._archive.add(state.elites)
            self._pending = state.pending
            self.births = state.births
            self.step = state.step

    @property
    def state(self) -> SearchState:
        """The search after its last finished batch."""
        elites = self._archive.elites(self._archive.occupied())
        return SearchState(elites, self._pending, self.births, self.step)

    @property
    def filled(self) -> int:
        """Niches with an elite; the outside state is not one."""
        return self._archive.filled

    def advance(
        self, executor: Executor, limit: int, on_done: Callable[[int], None] | None = None
    ) -> pa.Table:
        """Evaluate the children of one step, at most ``limit`` of them.

        Parameters
        ----------
        executor : Executor
        limit : int
            At least 1. The children beyond it stay pending.
        on_done : callable, optional
            Told how many more have been evaluated.

        Returns
        -------
        pyarrow.Table
            Their births.

        Raises
        ------
        NichechainError
            If no birth so far can be a parent.
        """
        if len(self._pending):
            step, waiting = self.step, self._pending
        else:
            step = self.step + 1
            waiting = self._initial() if step == 0 else self._children(step)
        offspring = waiting[:limit]
        evaluation = executor.evaluate(self._domain, offspring.genotype, on_done)
        # Nothing of the search changes before the evaluation is there, so an interrupted one
        # leaves the last state whole.
        self.settled = False
        self._pending = waiting[limit:]
        self.step = step
        self.births += len(offspring)
        self.savings = self.savings.and_of(evaluation)
        rows = self._keep(offspring, evaluation)
        self.settled = True
        return rows

    def _initial(self) -> Offspring:
        n = self._config.initial
        genotypes = self._domain.sample(n, seed=keyed(self._config.seed, Purpose.INITIAL))
        none = np.full(n, NONE, np.int64)
        return Offspring(genotypes, np.arange(n), none, none, np.zeros(n, np.int64))

    def _children(self, step: int) -> Offspring:
        occupied = self._archive.occupied()
        if self._niches.outside == "absorb":
            occupied = occupied[occupied < len(self._niches)]
        if not len(occupied):
            raise NichechainError(
                f"none of the {self.births} initial births can be a parent: "
                "widen the bounds, keep outside as a state, or raise the number of initial births"
            )
        batch = self._config.batch
        rng = keyed(self._config.seed, Purpose.SELECTION, step)
        if self._config.selection == "curiosity":
            scores = self._curiosity.of(self._archive.elites(occupied).uid)
            drawn = draw_curious(scores, batch, rng)
        else:
            drawn = rng.integers(len(occupied), size=batch)
        parents = self._archive.elites(occupied[drawn])
        uid = self._first_uid(step) + np.arange(batch)
        return Offspring(
            np.stack([self._child(*pair) for pair in zip(parents.genotype, uid.tolist(), strict=True)]),
            uid,
            parents.uid,
            parents.niche,
            parents.depth + 1,
        )

    def _child(self, parent: NDArray[np.float32], uid: int) -> NDArray[np.float32]:
        return self._mutate(parent, keyed(self._config.seed, Purpose.MUTATION, uid))

    def _first_uid(self, step: int) -> int:
        return 0 if step == 0 else self._config.initial + (step - 1) * self._config.batch

    def _keep(self, offspring: Offspring, evaluation: Evaluation) -> pa.Table:
        fine = ~evaluation.failed
        niche = np.full(len(offspring), NONE, np.int64)
        niche[fine] = self._niches.of(evaluation.behavior[fine])
        candidates = Elites(
            niche,
            offspring.genotype,
            evaluation.behavior,
            evaluation.objective,
            self._keys(offspring.uid, evaluation.objective),
            offspring.uid,
            offspring.depth,
        )
        accepted = np.zeros(len(offspring), bool)
        accepted[fine] = self._archive.add(candidates[fine])
        if self._config.selection == "curiosity":
            self._curiosity.tell(offspring.parent_uid, accepted)
        return births.table(offspring, evaluation, child_niche=niche, accepted=accepted, step=self.step)

    def _keys(self, uid: NDArray[np.int64], objective: NDArray[np.float64]) -> NDArray[np.float64]:
        """The key of each birth; the largest of a niche makes its elite."""
        match self._config.replacement:
            case "random":
                # One uniform key each: the elite is a uniform sample of its niche's births.
                size = self._config.initial if self.step == 0 else self._config.batch
                keys = keyed(self._config.seed, Purpose.REPLACEMENT, self.step).random(size)
                return keys[uid - self._first_uid(self.step)]
            case "first":
                return -uid.astype(np.float64)
            case "newest":
                return uid.astype(np.float64)
            case "objective":
                return objective


class _Archive:
    """A pyribs archive for the niches, and beside it the elite of the outside state."""

    def __init__(self, domain: Domain, niches: Niches) -> None:
        self._niches = niches
        make, cells = _pyribs(niches)
        self._grid = make(
            solution_dim=domain.genotype_length,
            ranges=niches.bounds,
            **cells,
            solution_dtype=np.float32,
            objective_dtype=np.float64,
            measures_dtype=np.float64,
            extra_fields={
                "domain_objective": ((), np.float64),
                "uid": ((), np.int64),
                "depth": ((), np.int64),
            },
        )
        self._outside: Elites | None = None
        self._largest_key = np.full(len(niches) + 1, -np.inf)

    @property
    def filled(self) -> int:
        return len(self._grid)

    def add(self, candidates: Elites) -> NDArray[np.bool_]:
        """Offer births that did not fail; true where one is larger than all before it in its niche.

        pyribs gets only those in the grid: it would put the others in edge cells without a word.
        """
        inside = candidates[candidates.niche < len(self._niches)]
        if len(inside):
            self._grid.add(
                inside.genotype,
                inside.key,
                inside.behavior,
                domain_objective=inside.objective,
                uid=inside.uid,
                depth=inside.depth,
            )
        outside = candidates[candidates.niche == len(self._niches)]
        if self._outside is not None:
            outside = Elites.concatenate(self._outside, outside)
        if len(outside):
            # argmax takes the first of equals, as pyribs does: the elite that is there stays.
            self._outside = outside[np.array([np.argmax(outside.key)])]
        # One by one, so that it does not matter how births are cut into batches.
        accepted = np.zeros(len(candidates), bool)
        for i, (niche, key) in enumerate(zip(candidates.niche, candidates.key, strict=True)):
            if key > self._largest_key[niche]:
                self._largest_key[niche] = key
                accepted[i] = True
        return accepted

    def occupied(self) -> NDArray[np.int64]:
        """States that have an elite, sorted."""
        inside = np.sort(self._grid.data("index")).astype(np.int64)
        return inside if self._outside is None else np.append(inside, len(self._niches))

    def elites(self, state: NDArray[np.int64]) -> Elites:
        """The elite of each of some occupied states, which may repeat."""
        inside = np.flatnonzero(state < len(self._niches))
        _, data = self._grid.retrieve(self._niches.centers[state[inside]])
        found = Elites(
            state[inside],
            data["solution"],
            data["measures"],
            data["domain_objective"],
            data["objective"],
            data["uid"],
            data["depth"],
        )
        if self._outside is None:
            return found
        # Row len(found) stands for the outside elite.
        rows = np.full(len(state), len(found))
        rows[inside] = np.arange(len(found))
        return Elites.concatenate(found, self._outside)[rows]


def _pyribs(niches: Niches) -> tuple[Any, dict[str, Any]]:
    """The class of archive that has such niches, and what it has to be told of them."""
    # Importing pyribs takes seconds, which only a search should spend.
    from ribs.archives import CVTArchive, GridArchive

    match niches:
        case GridNiches():
            return GridArchive, {"dims": niches.shape}
        case CVTNiches():
            return CVTArchive, {"centroids": niches.centroids}
        case _:
            raise NichechainError(f"niches are {niches!r}, but pyribs has an archive for grid and cvt only")


def _no_offspring(length: int) -> Offspring:
    none = np.empty(0, np.int64)
    return Offspring(np.empty((0, length), np.float32), none, none, none, none)
