"""Genotypes evaluated again, and what became of them against the record."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.domains.base import Domain, Evaluation
from nichechain.execution import Executor
from nichechain.niches import Niches
from nichechain.verification.result import EVALUATION, Check
from nichechain.verification.runs import Ints, differs, largest_difference

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
    landed = np.full(len(uids), NONE, np.int64)
    landed[~again.failed] = niches.of(again.behavior[~again.failed])

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
