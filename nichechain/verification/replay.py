"""Genotypes of births, grown again from their roots and evaluated again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE, niches_of
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Domain, Evaluation
from nichechain.execution import Executor
from nichechain.niches import Niches
from nichechain.search.elites import Elites, SearchState
from nichechain.variation import Mutation
from nichechain.verification.record import Ints, Run, differs, largest_difference
from nichechain.verification.result import EVALUATION, GENOTYPES, Check

Float32s = NDArray[np.float32]


def replayed(
    uids: Ints,
    parent_uid: Ints,
    *,
    roots: Callable[[], Float32s],
    mutate: Mutation,
    seed: int,
    on_done: Callable[[int], None] | None = None,
) -> Iterator[tuple[int, Float32s]]:
    """Genotypes of some births of a run, in the order of their uids.

    A genotype is made once, however many descend from it, and forgotten after its last child: what
    is held at a time is the generation under way, not the family tree.

    Parameters
    ----------
    uids : (K,) int64 array
        Which births; numbers within the run.
    parent_uid : (N,) int64 array
        Parent of every birth of the run, ``NONE`` for initial ones. Parents come before children.
    roots : callable
        Genotypes of the initial births, (at least as many as are needed, P).
    mutate : Mutation
    seed : int
        Seed of the run.
    on_done : callable, optional
        Told how many more genotypes have been made.

    Yields
    ------
    uid : int
    genotype : (P,) float32 array
    """
    wanted = np.zeros(len(parent_uid), bool)
    wanted[uids] = True
    needed = ancestry(uids, parent_uid)
    children = parent_uid[needed & (parent_uid != NONE)]
    uses = np.bincount(children, minlength=len(parent_uid))
    first = roots()
    alive: dict[int, Float32s] = {}
    for uid in np.flatnonzero(needed).tolist():
        parent = int(parent_uid[uid])
        if parent == NONE:
            genotype = first[uid]
        else:
            genotype = mutate(alive[parent], keyed(seed, Purpose.MUTATION, uid))
            uses[parent] -= 1
            if not uses[parent]:
                del alive[parent]
        if uses[uid]:
            alive[uid] = genotype
        if on_done is not None:
            on_done(1)
        if wanted[uid]:
            yield uid, genotype


def ancestry(uids: Ints, parent_uid: Ints) -> NDArray[np.bool_]:
    """Which births some births are or descend from, (N,)."""
    needed = np.zeros(len(parent_uid), bool)
    generation = np.unique(uids)
    while generation.size:
        needed[generation] = True
        parents = parent_uid[generation]
        generation = np.unique(parents[parents != NONE])
        generation = generation[~needed[generation]]
    return needed


@dataclass
class Regrowth:
    """Genotypes of an archive, grown again; those that it stores are compared on the way.

    Parameters
    ----------
    runs : sequence of Run
    parent_uid : (N,) int64 array
        Of all births.
    elites : Elites
        Those of the archive.
    state : SearchState
        Where else genotypes are stored.
    wanted : (K,) int64 array
        Births whose genotypes are asked for, sorted.
    """

    runs: Sequence[Run]
    parent_uid: Ints
    elites: Elites
    state: SearchState
    wanted: Ints
    _apart: dict[int, float | None] = field(default_factory=dict)

    def needed(self) -> int:
        """How many genotypes have to be made."""
        return sum(int(ancestry(self._targets(run), self._parents(run)).sum()) for run in self.runs)

    def genotypes(
        self, domain: Domain, mutate: Mutation, on_done: Callable[[int], None] | None = None
    ) -> Iterator[Float32s]:
        """Those that are wanted, in order."""
        stored = dict(zip(self.elites.uid.tolist(), self.elites.genotype, strict=True))
        pending, lineages, contenders = self.state.pending, self.state.lineages, self.state.contenders
        stored |= dict(zip(pending.uid.tolist(), pending.grown(), strict=True))
        stored |= dict(zip(lineages.uid.tolist(), lineages.genotype, strict=True))
        stored |= dict(zip(contenders.uid.tolist(), contenders.genotype, strict=True))
        wanted = set(self.wanted.tolist())
        for run in self.runs:
            grown = replayed(
                self._targets(run),
                self._parents(run),
                roots=lambda config=run.config: domain.sample(  # type: ignore[misc]
                    config.initial, seed=keyed(config.seed, Purpose.INITIAL)
                ),
                mutate=mutate,
                seed=run.config.seed,
                on_done=on_done,
            )
            for number, genotype in grown:
                uid = number + run.first_uid
                if uid in stored and differs(stored[uid][None], genotype[None]).any():
                    self._apart[uid] = largest_difference(stored[uid], genotype)
                if uid in wanted:
                    yield genotype

    def checks(self) -> list[Check]:
        """Whether stored genotypes are those that were grown, once all have been."""
        checks = []
        for who, uids in (
            ("elites", self.elites.uid),
            ("pending children", self.state.pending.uid),
            ("lineages under way", self.state.lineages.uid),
            ("contenders", self.state.contenders.uid),
        ):
            if who == "contenders" and not len(uids):
                # Only a direct search for evolvability has any.
                continue
            odd = [int(uid) in self._apart for uid in uids]
            sizes = [self._apart.get(int(uid)) or 0.0 for uid in uids]
            checks.append(
                Check.of(
                    f"genotypes of {who} grow from their roots",
                    "genotypes",
                    odd,
                    uids,
                    difference=max(sizes, default=None),
                    depends_on=GENOTYPES,
                )
            )
        return checks

    def _targets(self, run: Run) -> Ints:
        """Numbers within the run of all genotypes that are compared or wanted."""
        state = self.state
        uids = np.unique(
            np.concatenate([self.elites.uid, state.lineages.uid, state.contenders.uid, self.wanted])
        )
        own = uids[(uids >= run.first_uid) & (uids < run.first_uid + run.births)] - run.first_uid
        return np.concatenate([own, state.pending.uid])

    def _parents(self, run: Run) -> Ints:
        """Parents by their numbers within the run, those of pending children last."""
        own = self.parent_uid[run.rows]
        within = np.where(own == NONE, NONE, own - run.first_uid)
        return np.concatenate([within, self.state.pending.parent_uid])


# Enough for every worker, little to hold.
_BATCH = 256


def evaluated(
    domain: Domain,
    genotypes: Iterable[NDArray[np.float32]],
    axes: int,
    executor: Executor,
    on_done: Callable[[int], None] | None = None,
) -> Evaluation:
    """What becomes of genotypes, of which only some are held at a time.

    Parameters
    ----------
    domain : Domain
    genotypes : iterable of (P,) arrays
        There may be none.
    axes : int
        Axes of behavior.
    executor : Executor
    on_done : callable, optional
        Told how many more have been evaluated.
    """
    size = max(_BATCH, 4 * domain.chunk)
    none = Evaluation(np.empty((0, axes)), np.empty(0), np.empty(0, bool), ())
    parts = [none]
    parts += [executor.evaluate(domain, rows, on_done) for rows in _batches(genotypes, size)]
    return Evaluation.concatenate(parts)


def _batches(genotypes: Iterable[NDArray[np.float32]], size: int) -> Iterator[NDArray[np.float32]]:
    waiting: list[NDArray[np.float32]] = []
    for genotype in genotypes:
        waiting.append(genotype)
        if len(waiting) == size:
            yield np.stack(waiting)
            waiting.clear()
    if waiting:
        yield np.stack(waiting)


def check_evaluations(
    who: str, uids: Ints, recorded: Evaluation, niche: Ints, again: Evaluation, niches: Niches
) -> list[Check]:
    """Checks of evaluations against the record.

    Parameters
    ----------
    who : {"elites", "births"}
    uids : (N,) int64 array
    recorded : Evaluation
    niche : (N,) int64 array
        As recorded.
    again : Evaluation
    niches : Niches
    """
    group = f"{who} evaluated"
    outcome = recorded.failed != again.failed
    outcome |= np.array([a != b for a, b in zip(recorded.reasons, again.reasons, strict=True)], bool)
    both = ~recorded.failed & ~again.failed
    landed = niches_of(again, niches)

    def check(name: str, was: NDArray[np.float64], now: NDArray[np.float64]) -> Check:
        apart = largest_difference(was[both], now[both])
        odd = differs(was[both], now[both])
        return Check.of(name, group, odd, uids[both], difference=apart, depends_on=EVALUATION)

    return [
        Check.of(f"{who} fail or not, for the recorded reason", group, outcome, uids, depends_on=EVALUATION),
        check(f"{who} have the recorded behavior", recorded.behavior, again.behavior),
        check(f"{who} have the recorded objective", recorded.objective, again.objective),
        Check.of(
            f"{who} land in the recorded niche",
            group,
            (niche != landed)[both],
            uids[both],
            depends_on=EVALUATION,
        ),
    ]
