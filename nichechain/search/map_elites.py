"""MAP-Elites that remembers who was born where, and from which niche.

One step: draw parents from the occupied niches, mutate, evaluate, keep. Mutation is left to who
evaluates. Elites live in a pyribs archive. Which birth of a niche is its elite follows one rule, *the
largest key wins*, so the elites after N births are a function of the set of births, in whatever order
they came. A direct search for evolvability judges by children instead, see
:mod:`nichechain.search.contests`.
Some of the children come from unselected lineages instead, see :mod:`nichechain.search.lineages`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain import births
from nichechain.births.table import NONE, Offspring, niches_of
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Domain, Evaluation
from nichechain.execution import Executor
from nichechain.niches import Niches
from nichechain.search.config import BuildConfig
from nichechain.search.contests import UNJUDGED, Contests
from nichechain.search.elites import EliteArchive, Elites, SearchState
from nichechain.search.lineages import Stretch, UnderWay
from nichechain.search.savings import Savings
from nichechain.search.selection import ParentSelection, Told, UniformParents, draw_parents
from nichechain.variation import Mutation
from nichechain.variation.unborn import Unborn

Ints = NDArray[np.int64]

_NUMBERS = itertools.count()


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
    selection : ParentSelection, optional
        How parents are drawn, having been told of the births so far; by default each elite alike.
    stretch : Stretch, optional
        The steps to come, by default those of the build.
    contests : Contests, optional
        Of a direct search for evolvability, having been told of the births so far. By default births
        contest no niche: where the objective is evolvability, they only fill empty ones.

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
        If the configuration asks for a selection and none is given.
    """

    def __init__(
        self,
        domain: Domain,
        niches: Niches,
        mutate: Mutation,
        config: BuildConfig,
        state: SearchState | None = None,
        selection: ParentSelection | None = None,
        stretch: Stretch | None = None,
        contests: Contests | None = None,
    ) -> None:
        if selection is None and config.selection != "uniform":
            raise NichechainError(
                f"selection is missing: the configuration asks for {config.selection}, "
                "which goes on from the births so far"
            )
        self._selection = UniformParents() if selection is None else selection
        # Tells its elites from those of any other search in this process.
        self._number = next(_NUMBERS)
        self._domain = domain
        self._niches = niches
        self._config = config
        self._mutate = mutate
        self._stretch = stretch or Stretch.of_build(config)
        self._contests = contests
        self._archive = EliteArchive(domain, niches)
        self._pending = Offspring.none(domain.genotype_length)
        self._lineages = UnderWay.none(domain.genotype_length)
        self._contenders = Elites.none(domain.genotype_length, len(niches.bounds))
        self.births = 0
        self.step = -1
        self.savings = Savings()
        self.settled = True
        if state is not None:
            self._archive.put(state.elites)
            self._pending = state.pending
            self._lineages = state.lineages
            self._contenders = state.contenders
            self.births = state.births
            self.step = state.step

    @property
    def state(self) -> SearchState:
        """The search after its last finished batch."""
        elites = self._archive.elites(self._archive.occupied())
        pending = replace(self._pending, genotype=self._pending.grown())
        return SearchState(elites, pending, self.births, self.step, self._lineages, self._contenders)

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
        slot = np.full(len(offspring), NONE, np.int64)
        if step:
            slot = self._stretch.slots(step)[0][offspring.uid - self._first_uid(step)]
        # Lineages will go on from their births, so those are grown here while all are evaluated.
        with ThreadPoolExecutor(1) as aside:
            growing = aside.submit(offspring[slot != NONE].grown)
            evaluation = executor.evaluate(self._domain, offspring.genotype, on_done)
            of_lineages = growing.result()
        # Nothing of the search changes before the evaluation is there, so an interrupted one
        # leaves the last state whole.
        self.settled = False
        self._pending = waiting[limit:]
        self.step = step
        self.births += len(offspring)
        self.savings = self.savings.and_of(evaluation)
        rows = self._keep(offspring, evaluation, slot, of_lineages)
        self.settled = True
        return rows

    def _initial(self) -> Offspring:
        n = self._config.initial
        genotypes = self._domain.sample(n, seed=keyed(self._config.seed, Purpose.INITIAL))
        none = np.full(n, NONE, np.int64)
        return Offspring(genotypes, np.arange(n), none, none, np.zeros(n, np.int64), np.zeros(n, bool))

    def _children(self, step: int) -> Offspring:
        occupied = self._archive.occupied()
        if self._niches.outside == "absorb":
            occupied = occupied[occupied < len(self._niches)]
        if not len(occupied):
            raise NichechainError(
                f"none of the {self.births} initial births can be a parent: "
                "widen the bounds, keep outside as a state, or raise the number of initial births"
            )
        batch = self._stretch.batch
        judged = self._judged(step)
        self._selection.begin(step)
        weights = self._selection.weights(occupied, self._archive.uids(occupied))
        rng = keyed(self._config.seed, Purpose.SELECTION, step)
        drawn = draw_parents(weights, len(occupied), batch, rng)
        # Drawn for every child, so that a lineage begins at an elite that its first birth had drawn,
        # and a brood at the one that the first of its births had.
        drawn = drawn[self._stretch.drawing(step)]
        distinct, parent = np.unique(drawn, return_inverse=True)
        elites = self._archive.elites(occupied[distinct])
        slot, goes_on = self._stretch.slots(step)
        latest = np.where(goes_on, self._lineages.rows(slot), NONE)
        unselected = latest != NONE
        # Parents are the elites that were drawn, and behind them the lineages under way.
        parent[unselected] = len(elites) + latest[unselected]
        if self._contests is not None:
            # And behind these, whoever is judged by children.
            who, rows = np.unique(self._contests.due.parent, return_inverse=True)
            judged = judged[np.searchsorted(judged.uid, who)]
            parent[self._contests.due.place] = len(elites) + len(self._lineages) + rows

        def whose(name: str) -> NDArray[Any]:
            of: NDArray[Any] = np.concatenate(
                [getattr(those, name) for those in (elites, self._lineages, judged)]
            )
            return of

        uid = self._first_uid(step) + np.arange(batch)
        parent_uid = whose("uid")
        unborn = Unborn(
            self._mutate,
            Purpose.MUTATION,
            whose("genotype"),
            (self._config.seed,) * len(parent_uid),
            parent,
            uid,
            [(self._number, one) for one in parent_uid.tolist()],
        )
        return Offspring(
            unborn,
            uid,
            parent_uid[parent],
            whose("niche")[parent],
            whose("depth")[parent] + 1,
            unselected,
        )

    def _judged(self, step: int) -> Elites:
        """Elites and contenders that a step may judge, sorted by uid."""
        if self._contests is None:
            return self._contenders
        self._contests.begin(step)
        return self._contestants(self._contests.due.niche)

    def _settle(self, contests: Contests) -> None:
        """End contests, all births of a step being kept."""
        ended = contests.settle()
        if len(ended):
            both = self._contestants(ended.niche)
            won = both[np.searchsorted(both.uid, ended.uid)]
            self._archive.put(replace(won, key=ended.value))
            self._contenders = self._contenders[~np.isin(self._contenders.niche, ended.niche)]

    def _contestants(self, niche: Ints) -> Elites:
        """Elites and contenders of some niches, which may repeat, sorted by uid."""
        elites = self._archive.elites(np.unique(niche))
        both = Elites.concatenate([elites, self._contenders[np.isin(self._contenders.niche, niche)]])
        return both[np.argsort(both.uid)]

    def _first_uid(self, step: int) -> int:
        return self._stretch.uids(step)[0]

    def _keep(
        self, offspring: Offspring, evaluation: Evaluation, slot: Ints, of_lineages: NDArray[np.float32]
    ) -> pa.Table:
        """The births of a step, of which those with a slot are of lineages and have a genotype each."""
        fine = ~evaluation.failed
        niche = niches_of(evaluation, self._niches)
        keys = self._keys(offspring.uid, evaluation.objective)
        accepted = np.zeros(len(offspring), bool)
        accepted[fine] = self._archive.offer(niche[fine], keys[fine])
        # Of each niche the last that was accepted stays. Only what stays, or has children, is grown here.
        last = {state: row for row, state in enumerate(niche.tolist()) if accepted[row]}

        def kept(rows: Ints) -> Elites:
            return Elites(
                niche[rows],
                offspring[rows].grown(),
                evaluation.behavior[rows].astype(np.float64),
                evaluation.objective[rows],
                keys[rows],
                offspring.uid[rows],
                offspring.depth[rows],
            )

        self._archive.put(kept(np.array(sorted(last.values()), np.int64)))
        self._lineages = self._gone_on(offspring, niche, slot, of_lineages)
        told = Told(
            offspring.parent_uid,
            offspring.parent_niche,
            niche,
            accepted,
            np.full(len(offspring), self.step),
            offspring.uid,
            offspring.lineage,
        )
        self._selection.tell(told)
        if self._contests is not None:
            self._contenders = Elites.concatenate([self._contenders, kept(self._contests.hear(told))])
            if not len(self._pending):
                self._settle(self._contests)
        return births.make_table(offspring, evaluation, child_niche=niche, accepted=accepted, step=self.step)

    def _gone_on(
        self, offspring: Offspring, niche: Ints, slot: Ints, of_lineages: NDArray[np.float32]
    ) -> UnderWay:
        """The lineages after some births of a step, see :meth:`_keep`."""
        can = niche != NONE
        if self._niches.outside == "absorb":
            can &= niche < len(self._niches)
        ours, ended = (slot != NONE) & can, (slot != NONE) & ~can
        births = UnderWay(
            slot[ours],
            of_lineages[can[slot != NONE]],
            offspring.uid[ours],
            niche[ours],
            offspring.depth[ours],
        )
        return self._lineages.after(births, slot[ended])

    def _keys(self, uid: NDArray[np.int64], objective: NDArray[np.float64]) -> NDArray[np.float64]:
        """The key of each birth; the largest of a niche makes its elite."""
        match self._config.replacement:
            case "random":
                # One uniform key each: the elite is a uniform sample of its niche's births.
                size = self._config.initial if self.step == 0 else self._stretch.batch
                keys = keyed(self._config.seed, Purpose.REPLACEMENT, self.step).random(size)
                return keys[uid - self._first_uid(self.step)]
            case "first":
                return -uid.astype(np.float64)
            case "newest":
                return uid.astype(np.float64)
            case "objective" if self._config.objective == "domain":
                return objective
            case "objective":
                # Nobody is judged at birth, and the first in a niche is its elite.
                return np.full(len(uid), UNJUDGED)
