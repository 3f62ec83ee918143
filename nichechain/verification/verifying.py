"""Verify an archive: its record, its search, its genotypes, and what becomes of some of them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from nichechain.archive import read
from nichechain.archive.archive import Archive, load
from nichechain.core.checks import check_at_least, check_seed
from nichechain.core.errors import NichechainError
from nichechain.core.machine import library_versions, machine
from nichechain.core.randomness import Purpose, keyed
from nichechain.domains.base import Domain, Evaluation
from nichechain.execution import Executor, Threads
from nichechain.execution.base import WORKER_DIED
from nichechain.search.elites import Elites, SearchState
from nichechain.search.making import make_niches
from nichechain.verification import record
from nichechain.verification.record import Births, Ints, Run, largest_difference, runs_of
from nichechain.verification.replay import Regrowth, check_evaluations, evaluated
from nichechain.verification.result import EVALUATION, SEARCH, Check, Difference, Verification
from nichechain.verification.search import (
    check_contenders_again,
    check_lineages_again,
    check_pending_again,
    check_search,
    check_winners,
    search_again,
)


@dataclass(frozen=True)
class VerificationProgress:
    """How far a verification is.

    Parameters
    ----------
    stage : {"search", "genotypes", "evaluations"}
        What is being made again.
    done, total : int
        How many of them.
    """

    stage: str
    done: int
    total: int


def verify(
    archive: Archive | str | Path,
    *,
    sample: int | None = 100,
    seed: int = 0,
    executor: Executor | None = None,
    on_progress: Callable[[VerificationProgress], None] | None = None,
) -> Verification:
    """Make parts of an archive again from its configuration, and compare to the bit.

    Checked are: its files against their checksums; the record of births and elites against itself;
    the whole search, with behaviors taken from the record; the genotypes of all elites, grown from
    their roots; and some elites and some births, evaluated again.

    Parameters
    ----------
    archive : Archive or path
        Of a domain that nichechain does not know by name, give ``load(path, domain=...)``.
    sample : int, optional
        How many elites, and how many births, to evaluate again; all where there are fewer. None
        evaluates all of both, which takes longer than the build did.
    seed : int
        Seed of the choice of these, not negative.
    executor : Executor, optional
        Where to evaluate; by default on threads, one per processor.
    on_progress : callable, optional

    Raises
    ------
    NichechainError
        If ``sample`` or ``seed`` is negative.
    ArchiveError
        If there is no archive there, or a file is missing or damaged.

    Notes
    -----
    A birth that was altered consistently, so that nothing contradicts it but its own evaluation, is
    found only if it is evaluated again: of k such births among N, a sample of n contains one
    with probability 1 - C(N - k, n) / C(N, n), about 1 - (1 - n/N)^k.
    """
    if sample is not None:
        check_at_least(0, sample=sample)
    check_seed(seed)
    archive = archive if isinstance(archive, Archive) else load(archive)
    with ExitStack() as stack:
        if executor is None:
            executor = stack.enter_context(Threads())
        work = _Work(archive, sample, seed, executor, on_progress)
        work.run()
    return Verification(
        str(archive.folder),
        archive.meta.births,
        len(archive.elites),
        work.sampled_births,
        work.sampled_elites,
        seed,
        tuple(work.checks),
        tuple(work.unverified),
        _differences(archive.meta),
        bool(archive.meta.machine),
    )


def _differences(meta: read.Meta) -> tuple[Difference, ...]:
    recorded = {**meta.versions, **meta.machine}
    present = {**library_versions(), **machine()}
    return tuple(
        Difference(name, str(was), present[name])
        for name, was in recorded.items()
        if name in present and present[name] != was
    )


@dataclass
class _Work:
    """A verification under way."""

    archive: Archive
    sample: int | None
    seed: int
    executor: Executor
    on_progress: Callable[[VerificationProgress], None] | None
    checks: list[Check] = field(default_factory=list)
    unverified: list[str] = field(default_factory=list)
    sampled_births: int = 0
    sampled_elites: int = 0

    def run(self) -> None:
        meta, niches = self.archive.meta, self.archive.niches
        births = Births.of(read.read_births(self.archive.folder, meta))
        self.checks += record.check_values(births, niches)
        runs = list(runs_of(meta))
        if not runs:
            kind = "of unknown origin" if meta.origin is None else meta.origin["kind"]
            self.checks += record.check_unique(births)
            self.unverified.append(
                f"ancestry, search, elites, genotypes and evaluations: the births were {kind}, "
                "so their configuration is not known"
            )
            return
        self.checks.append(record.check_runs(runs, len(births)))
        if self.checks[-1].mismatches:
            self.unverified.append("everything else: it is not known which births are of which run")
            return
        state = read.read_state(self.archive.folder, meta)
        elites = self.archive.elites
        self.checks += record.check_ancestry(births, runs)
        self.checks += record.check_elites(elites, births, niches)
        if meta.origin is None:
            self.checks += record.check_pending(state.pending, births, len(births))
            self.checks += record.check_lineages(state.lineages, births)
        self._search(births, runs, state)
        self._genotypes(births, runs, state)

    def _broken(self, *names: str) -> bool:
        """Whether one of the checks of that name found something."""
        return any(check.mismatches for check in self.checks if check.name in names)

    def _tell(self, stage: str, total: int) -> Callable[[int], None]:
        done = 0

        def tell(more: int) -> None:
            nonlocal done
            done += more
            if self.on_progress is not None:
                self.on_progress(VerificationProgress(stage, done, total))

        tell(0)
        return tell

    def _search(self, births: Births, runs: list[Run], state: SearchState) -> None:
        if self._broken(record.COMPLETE):
            self.unverified.append("the search: without the niches of all births it cannot be made again")
            return
        # Takes seconds, which the first rate that is told should not count.
        import ribs.archives  # noqa: F401

        self._tessellation()
        tell = self._tell("search", len(births))
        try:
            made = [search_again(run, births[run.rows], self.archive.niches, tell) for run in runs]
        except NichechainError as error:
            self.checks.append(Check(f"the search can be made again ({error})", "search", 1, 1))
            return
        self.checks += check_search(births, Births.concatenate([again.births for again in made]))
        winners = Elites.concatenate([again.state.elites for again in made]).winners()
        self.checks += check_winners(self.archive.elites, winners)
        if self.archive.meta.origin is None:
            self.checks += check_pending_again(state.pending, made[0].state.pending)
            self.checks += check_lineages_again(state.lineages, made[0].state.lineages)
            self.checks += check_contenders_again(state.contenders, made[0].state.contenders)

    def _tessellation(self) -> None:
        """Whether the centroids that are kept are those that the configuration's seed gives."""
        config = self.archive.config
        if config.niches == "cvt":
            odd = make_niches(config) != self.archive.niches
            self.checks.append(
                Check("the tessellation is that of its seed", "search", 1, int(odd), (), None, SEARCH)
            )

    def _genotypes(self, births: Births, runs: list[Run], state: SearchState) -> None:
        try:
            domain, mutate = self.archive.domain, self.archive.mutate
        except NichechainError as error:
            self.unverified.append(f"genotypes and evaluations: {error}")
            return
        self.checks.append(_check_domain(self.archive, domain))
        elites, niches = self.archive.elites, self.archive.niches
        axes = births.behavior.shape[1]
        chosen, some = self._choose(len(elites), 0), self._choose(len(births), 1)
        rooted = not self._broken(*record.ROOTED)
        if not rooted:
            self.unverified.append("genotypes from their roots: the record does not tell all parents")
            some = some[:0]
        deadly = births.reasons[some] == WORKER_DIED
        if deadly.any():
            number = int(np.count_nonzero(deadly))
            self.unverified.append(
                f"{number} births that cost a worker: evaluating them could end this process"
            )
            some = some[~deadly]
        self.sampled_elites, self.sampled_births = len(chosen), len(some)
        evaluating = self._tell("evaluations", len(chosen) + len(some))
        if rooted:
            regrowth = Regrowth(runs, births.parent_uid, elites, state, some)
            making = self._tell("genotypes", regrowth.needed())
            grown = regrowth.genotypes(domain, mutate, making)
            again = evaluated(domain, grown, axes, self.executor, evaluating)
            self.checks += regrowth.checks()
            self.checks += check_evaluations(
                "births", births.uid[some], births[some].evaluation, births.child_niche[some], again, niches
            )
        mine = elites[chosen]
        again = evaluated(domain, mine.genotype, axes, self.executor, evaluating)
        nobody = np.zeros(len(mine), bool)
        recorded = Evaluation(mine.behavior, mine.objective, nobody, ("",) * len(mine))
        self.checks += check_evaluations("elites", mine.uid, recorded, mine.niche, again, niches)

    def _choose(self, among: int, index: int) -> Ints:
        """Which of so many are evaluated again, sorted."""
        size = among if self.sample is None else min(self.sample, among)
        rng = keyed(self.seed, Purpose.VERIFICATION, index)
        chosen: Ints = np.sort(rng.choice(among, size=size, replace=False)).astype(np.int64)
        return chosen


def _check_domain(archive: Archive, domain: Domain) -> Check:
    """Whether the domain is what the archive says of it."""
    was, now = archive.meta.facts, read.DomainFacts.of(domain)
    agree = [getattr(was, name) == getattr(now, name) for name in was.__dataclass_fields__]
    agree.append(domain.seed == archive.config.domain_seed)
    apart = None
    if was.start is not None and now.start is not None and was.start != now.start:
        apart = largest_difference(np.array(was.start), np.array(now.start))
    return Check(
        "the domain has the recorded seed, axes, objective and start",
        "domain",
        len(agree),
        agree.count(False),
        (),
        apart,
        EVALUATION,
    )
