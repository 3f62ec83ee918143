"""Genotypes of births, grown again from their roots."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE, Offspring
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Domain
from nichechain.search.elites import Elites
from nichechain.search.lineages import Lineages
from nichechain.variation import Mutation
from nichechain.verification.result import GENOTYPES, Check
from nichechain.verification.runs import Run, differs, largest_difference

Ints = NDArray[np.int64]
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
    pending : Offspring
    lineages : Lineages
    wanted : (K,) int64 array
        Births whose genotypes are asked for, sorted.
    """

    runs: Sequence[Run]
    parent_uid: Ints
    elites: Elites
    pending: Offspring
    lineages: Lineages
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
        for more in (self.pending, self.lineages):
            stored |= dict(zip(more.uid.tolist(), more.genotype, strict=True))
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
            ("pending children", self.pending.uid),
            ("lineages under way", self.lineages.uid),
        ):
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
        uids = np.unique(np.concatenate([self.elites.uid, self.lineages.uid, self.wanted]))
        own = uids[(uids >= run.first_uid) & (uids < run.first_uid + run.births)] - run.first_uid
        return np.concatenate([own, self.pending.uid])

    def _parents(self, run: Run) -> Ints:
        """Parents by their numbers within the run, those of pending children last."""
        own = self.parent_uid[run.rows]
        within = np.where(own == NONE, NONE, own - run.first_uid)
        return np.concatenate([within, self.pending.parent_uid])
