"""Walks, all of a configuration's runs advancing together: one step is one batch of evaluations.

A child's genotype is a function of its parent's, its run's seed and its uid; what a step draws, of
the run's seed and the step. So a walk depends neither on the walks beside it nor on the workers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

from nichechain import births
from nichechain.births.table import NONE, Offspring, niches_of
from nichechain.core.checks import as_floats, as_whole
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Domain, Evaluation
from nichechain.execution import Executor, evaluate_rows
from nichechain.landscape import population_evolvability
from nichechain.niches import Niches
from nichechain.variation import Mutation
from nichechain.variation.unborn import Unborn
from nichechain.walks.config import WalkConfig, run_seed
from nichechain.walks.diversity import NoveltyArchive, Surroundings
from nichechain.walks.litters import Litters, Scored
from nichechain.walks.selection import Scores, draw
from nichechain.walks.state import StepRecord, WalkState, measure_states

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Step:
    """What a step gives.

    Parameters
    ----------
    state : WalkState
        The walks after it.
    record : StepRecord
        Measures of the states before it.
    births : pyarrow.Table
        The children, in the columns of :mod:`nichechain.births.table`; accepted are those that follow.
    """

    state: WalkState
    record: StepRecord
    births: pa.Table


class Walks:
    """Runs of a kind of walk on a domain; the walks' states are outside, in :class:`WalkState`.

    Parameters
    ----------
    domain : Domain
    mutate : Mutation
    config : WalkConfig
    niches : Niches, optional
        For the niche variant, coverage and the niches of births.

    Raises
    ------
    NichechainError
        If the niche variant, or a metric that counts niches, is asked for without niches.
    """

    def __init__(
        self, domain: Domain, mutate: Mutation, config: WalkConfig, niches: Niches | None = None
    ) -> None:
        if config.other_niche and niches is None:
            raise NichechainError("other_niche is asked for, but a niche walk needs niches: none are given")
        if config.metric.litter and niches is None:
            raise NichechainError("metric counts the niches of offspring, but no niches are given")
        self._domain = domain
        self._mutate = mutate
        self._config = config
        self._niches = niches
        self._span = np.array([high - low for low, high in domain.bounds])
        width, count = config.width, config.width * config.offspring
        # Columns of what is scored: the states, then the children of each.
        self._lineage = np.concatenate([np.arange(width), np.repeat(np.arange(width), config.offspring)])
        alone = config.states is None
        self._itself = np.arange(width + count) - (width if alone else 0)
        self._selectable = np.arange(width + count) >= (width if alone else 0)

    def start(
        self,
        runs: int | Sequence[int],
        executor: Executor | None = None,
        genotypes: ArrayLike | None = None,
    ) -> tuple[WalkState, pa.Table]:
        """Walks at their first state.

        Parameters
        ----------
        runs : int or sequence of int
            How many, or their numbers within the configuration.
        executor : Executor, optional
            Where to evaluate; by default here.
        genotypes : (R, P) array, or (R, μ, P) for a multi-state walk, optional
            By default sampled from the domain's initialisation, for each run by its seed.

        Returns
        -------
        WalkState
        pyarrow.Table
            Births of the first states.

        Raises
        ------
        NichechainError
            If there is no run, a genotype has the wrong length, or one of them fails.
        """
        run = run_numbers(runs)
        width, length = self._config.width, self._domain.genotype_length
        if genotypes is None:
            seeds = [run_seed(self._config.seed, number) for number in run.tolist()]
            first = np.stack([self._domain.sample(width, seed=keyed(s, Purpose.INITIAL)) for s in seeds])
        else:
            first = as_floats("start genotypes", genotypes).astype(np.float32)
            expected = (len(run), length) if self._config.states is None else (len(run), width, length)
            if first.shape != expected:
                raise NichechainError(f"start genotypes have shape {first.shape}, but must be {expected}")
            first = first.reshape(len(run), width, length)
        evaluation = self._evaluate(first.reshape(-1, length), executor)
        for row in np.flatnonzero(evaluation.failed):
            raise NichechainError(
                f"start genotype of run {run[row // width]} failed to evaluate: {evaluation.reasons[row]}"
            )
        niche = niches_of(evaluation, self._niches)
        uid = np.broadcast_to(np.arange(width), (len(run), width))
        none = np.full(uid.size, NONE, np.int64)
        depth = np.zeros(uid.size, np.int64)
        nobody = np.zeros(uid.size, bool)
        offspring = Offspring(first.reshape(-1, length), uid.ravel(), none, none, depth, nobody)
        archives = 1 if self._config.archive.scope == "configuration" else len(run)
        axes = evaluation.behavior.shape[1]
        state = WalkState(
            step=0,
            run=run,
            genotype=first,
            uid=uid.copy(),
            depth=depth.reshape(uid.shape),
            niche=niche.reshape(uid.shape),
            path=evaluation.behavior.reshape(len(run), width, 1, axes),
            archive=NoveltyArchive.empty(archives, axes),
            stalls=np.zeros(len(run), np.int64),
        )
        rows = births.make_table(
            offspring,
            evaluation,
            child_niche=niche,
            accepted=np.ones(uid.size, bool),
            step=0,
            run=np.repeat(run, uid.size // run.size),
        )
        return state, rows

    def advance(
        self,
        state: WalkState,
        executor: Executor | None = None,
        on_done: Callable[[int], None] | None = None,
    ) -> Step:
        """Measure the states of all walks by their offspring, and choose who follows.

        A walk of T steps has T + 1 states, and the last is measured by offspring too: it takes T + 1
        calls. Whom the last of them chose begins step T + 1, should the walk go on.

        Parameters
        ----------
        state : WalkState
            Not changed.
        executor : Executor, optional
            Where to evaluate; by default here.
        on_done : callable, optional
            Told how many more have been evaluated.

        Raises
        ------
        NichechainError
            If a bandwidth matrix does not fit the behaviors.
        """
        config = self._config
        walks, width = state.uid.shape
        seeds = [run_seed(config.seed, number) for number in state.run.tolist()]
        offspring = self._offspring(state, seeds)
        evaluation = self._evaluate(offspring.genotype, executor, on_done)
        landed = niches_of(evaluation, self._niches)

        axes = evaluation.behavior.shape[1]
        children = evaluation.behavior.reshape(walks, -1, axes)
        niche = np.concatenate([state.niche, landed.reshape(walks, -1)], axis=1)
        behavior = np.concatenate([state.behavior, children], axis=1)
        failed = evaluation.failed.reshape(walks, -1)
        everyone = {
            "uid": np.concatenate([state.uid, offspring.uid.reshape(walks, -1)], axis=1),
            "depth": np.concatenate([state.depth, offspring.depth.reshape(walks, -1)], axis=1),
            "niche": niche,
        }
        around = self._around(state, children)
        judging = None
        if config.metric.litter:
            assert self._niches is not None
            grown = offspring.grown().reshape(*children.shape[:2], -1)
            judging = Litters.born(
                Scored(np.concatenate([state.genotype, grown], axis=1), **everyone),
                self._mutate,
                seeds,
                state.run,
                first=self._first_uid(state) + children.shape[1],
                each=config.metric.litter,
                step=state.step + 1,
                niches=self._niches,
                evaluate=lambda unborn: self._evaluate(unborn, executor, on_done),
            )
            around = replace(around, litters=judging.landed, niches=len(self._niches))
        score = config.metric(behavior, self._lineage, self._itself, around)
        chosen, stalled = self._select(state, seeds, score, failed, niche)

        rows = np.arange(walks)[:, None]
        path = np.concatenate(
            [state.path[rows, self._lineage[chosen]], behavior[rows, chosen][:, :, None]], axis=2
        )
        follows = np.zeros(score.shape, bool)
        follows[rows, chosen] = True
        follows = follows[:, width:]
        after = WalkState(
            step=state.step + 1,
            run=state.run,
            genotype=self._genotypes(state, offspring, chosen),
            path=path,
            archive=self._remember(state, seeds, children, failed, follows),
            stalls=state.stalls + stalled.sum(axis=1),
            **{name: values[rows, chosen] for name, values in everyone.items()},
        )
        record = self._record(state, after, children, landed, score[rows, chosen], stalled)
        table = births.make_table(
            offspring,
            evaluation,
            child_niche=landed,
            accepted=follows.ravel(),
            step=after.step,
            run=np.repeat(state.run, len(offspring) // len(state.run)),
        )
        if judging is not None:
            table = pa.concat_tables([table, judging.births])
        return Step(after, record, table)

    def _evaluate(
        self,
        genotypes: NDArray[np.float32] | Unborn,
        executor: Executor | None,
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        if executor is None:
            return evaluate_rows(self._domain, genotypes)
        return executor.evaluate(self._domain, genotypes, on_done)

    def _offspring(self, state: WalkState, seeds: Sequence[int]) -> Offspring:
        """Children of all states: run by run, state by state."""
        each = self._config.offspring
        walks, width = state.uid.shape
        first = self._first_uid(state)
        uid = first + np.arange(width * each)
        unborn = Unborn(
            self._mutate,
            Purpose.MUTATION,
            state.genotype.reshape(walks * width, -1),
            [seed for seed in seeds for _ in range(width)],
            np.repeat(np.arange(walks * width), each),
            np.tile(uid, walks),
        )
        return Offspring(
            unborn,
            np.tile(uid, walks),
            np.repeat(state.uid.ravel(), each),
            np.repeat(state.niche.ravel(), each),
            np.repeat(state.depth.ravel() + 1, each),
            np.zeros(walks * width * each, bool),
        )

    def _first_uid(self, state: WalkState) -> int:
        """Number of the first child of a step: before it are the starts, and what earlier steps made."""
        width, each, litter = self._config.width, self._config.offspring, self._config.metric.litter
        return width + state.step * (width * each + (width + width * each) * litter)

    def _genotypes(self, state: WalkState, offspring: Offspring, chosen: Ints) -> NDArray[np.float32]:
        """Those of the chosen columns (R, μ, P): only children that follow are grown here."""
        walks, width = state.uid.shape
        rows = np.arange(walks)[:, None]
        genotype: NDArray[np.float32] = state.genotype[rows, np.minimum(chosen, width - 1)]
        born = chosen >= width
        children = rows * (len(offspring) // walks) + chosen - width
        genotype[born] = offspring[children[born]].grown()
        return genotype

    def _around(self, state: WalkState, children: Floats) -> Surroundings:
        siblings = children
        if self._config.states is not None:
            siblings = np.concatenate([state.behavior, children], axis=1)
        archive = state.archive
        held = (len(state.run), *archive.behavior.shape[1:])
        return Surroundings(
            siblings,
            np.broadcast_to(archive.behavior, held),
            np.broadcast_to(state.step - archive.entered, held[:2]),
            state.path,
            self._span,
        )

    def _select(
        self, state: WalkState, seeds: Sequence[int], score: Floats, failed: Bools, niche: Ints
    ) -> tuple[Ints, Bools]:
        """Columns of those that follow (R, μ), and which of them stay for want of a candidate."""
        width = self._config.width
        eligible = np.broadcast_to(self._selectable, score.shape).copy()
        eligible[:, width:] &= ~failed
        if self._config.other_niche:
            assert self._niches is not None
            eligible &= niche != state.niche[:, self._lineage]
            if self._niches.outside == "absorb":
                eligible &= niche < len(self._niches)
        # One key per individual and one number per place, whatever the rule does with them.
        draws = [keyed(seed, Purpose.SELECTION, state.step).random(score.shape[1] + width) for seed in seeds]
        tie_key, choice = np.split(np.stack(draws), [score.shape[1]], axis=1)
        scores = Scores(score, score[:, self._lineage], tie_key, eligible, width)
        chosen = draw(self._config.selection.candidates(scores), choice)
        stalled = chosen < 0
        for walk in np.flatnonzero(stalled.any(axis=1)):
            free = np.setdiff1d(np.arange(width), chosen[walk])
            best = free[np.lexsort((tie_key[walk, free], score[walk, free]))[::-1]]
            chosen[walk, stalled[walk]] = best[: stalled[walk].sum()]
        return chosen, stalled

    def _remember(
        self, state: WalkState, seeds: Sequence[int], children: Floats, failed: Bools, follows: Bools
    ) -> NoveltyArchive:
        rule = self._config.archive
        if not self._config.metric.remembers:
            return state.archive
        lots = [keyed(seed, Purpose.NOVELTY_ARCHIVE, state.step).random(children.shape[1]) for seed in seeds]
        may = ~failed & follows if rule.entry == "selected" else ~failed
        enters = rule.enters(np.stack(lots), may)
        archives = len(state.archive.entered)
        return state.archive.add(
            children.reshape(archives, -1, children.shape[2]),
            enters.reshape(archives, -1),
            state.step,
            rule.limit,
        )

    def _record(
        self,
        state: WalkState,
        after: WalkState,
        children: Floats,
        landed: Ints,
        diversity: Floats,
        stalled: Bools,
    ) -> StepRecord:
        walks, width = state.uid.shape
        offspring = children.reshape(walks, width, self._config.offspring, -1)
        niches = 0 if self._niches is None else len(self._niches)
        size, farthest, away, widest, mean, coverage = measure_states(
            state.behavior, offspring, landed.reshape(walks, width, -1), niches
        )
        return StepRecord(
            step=state.step,
            run=state.run,
            uid=state.uid,
            behavior=state.behavior,
            niche=state.niche,
            sample_size=size,
            local_sensitivity=farthest,
            expected_local_sensitivity=away,
            evolvability=widest,
            expected_evolvability=mean,
            coverage=coverage,
            population_evolvability=population_evolvability(after.behavior),
            next_uid=after.uid,
            next_behavior=after.behavior,
            diversity=np.where(stalled, np.nan, diversity),
            stalled=stalled.sum(axis=1),
        )


def run_numbers(runs: int | Sequence[int]) -> Ints:
    """Numbers of the runs, of which there may be given how many.

    Raises
    ------
    NichechainError
        If there is none, or a number is negative.
    """
    run: Ints = np.arange(runs) if isinstance(runs, (int, np.integer)) else as_whole("runs", runs)
    if run.ndim != 1 or not run.size or run.min() < 0:
        raise NichechainError(f"runs is {runs}, but at least one run is needed, numbered from 0")
    return run
