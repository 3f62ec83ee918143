"""What an executor is, and what every one of them makes of a genotype whose evaluation goes wrong."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError
from nichechain.core.text import printable
from nichechain.domains.base import Domain, Evaluation
from nichechain.variation.unborn import Unborn, grown

WORKER_DIED = "worker died"
"""Why a row failed that no worker outlives."""

LOOK_SECONDS = 1.0
"""Who waits for others wakes so often: a Ctrl-C in the instant before falling asleep is heard only then."""

_LONGEST_REASON = 500


class Executor(Protocol):
    """Evaluates batches of genotypes somewhere."""

    def evaluate(
        self,
        domain: Domain,
        genotypes: NDArray[np.float32] | Unborn,
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        """The rows of ``evaluate_rows(domain, genotypes)``, in order, to the bit.

        Parameters
        ----------
        domain : Domain
        genotypes : (N, P) float32 array or Unborn
            N at least 1. Unborn children are best grown by who evaluates them; ``numpy.asarray`` grows
            them, too.
        on_done : callable, optional
            Told how many more have been evaluated.

        Raises
        ------
        NichechainError
            If the domain raises it, or does not return what a domain must.
        MemoryError
            If the domain runs out of memory, for that is not the genotype's doing.
        """
        ...


def evaluate_rows(domain: Domain, genotypes: NDArray[np.float32] | Unborn) -> Evaluation:
    """Evaluate genotypes here; one for which the domain raises has failed, and only that one.

    Parameters
    ----------
    domain : Domain
    genotypes : (N, P) float32 array or Unborn
        N at least 1.

    Returns
    -------
    Evaluation
        A row also failed if its behavior or objective is not finite.

    Raises
    ------
    NichechainError
        If the domain raises it, or does not return what a domain must.
    MemoryError
        If the domain runs out of memory, for that is not the genotype's doing.
    """
    # Outside of what follows: a mutation that raises is not the genotype's doing.
    genotypes = grown(genotypes)
    try:
        evaluation = domain.evaluate(genotypes)
    except (MemoryError, NichechainError):
        raise
    except Exception as error:
        if len(genotypes) == 1:
            return all_failed(domain, 1, reason_of(error))
        # Domains are pure, so the row that raised among others raises alone, and the others do not.
        half = len(genotypes) // 2
        return Evaluation.concatenate(
            [evaluate_rows(domain, genotypes[:half]), evaluate_rows(domain, genotypes[half:])]
        )
    return _checked(domain, evaluation, len(genotypes))


def all_failed(domain: Domain, rows: int, reason: str) -> Evaluation:
    """Rows none of which has a behavior, for one reason."""
    behavior = np.full((rows, len(domain.behavior_names)), np.nan)
    return Evaluation(behavior, np.full(rows, np.nan), np.ones(rows, bool), (reason,) * rows)


def reason_of(error: BaseException) -> str:
    """Type and message of an exception on one line, the same wherever it was raised."""
    try:
        message = str(error)
    except Exception:
        message = ""
    # Where an object happened to lie differs from one process to the next.
    message = re.sub(r"\b0x[0-9a-fA-F]+", "0x...", " ".join(message.split()))
    name = type(error).__name__
    return _storable(f"{name}: {message}" if message else name)


def _storable(reason: str) -> str:
    return printable(reason).encode("utf-8", "backslashreplace")[:_LONGEST_REASON].decode("utf-8", "ignore")


def _checked(domain: Domain, evaluation: Evaluation, rows: int) -> Evaluation:
    behavior, objective, failed = evaluation.behavior, evaluation.objective, evaluation.failed
    expected = (rows, len(domain.behavior_names))
    lengths = (len(objective), len(failed), len(evaluation.reasons))
    if behavior.shape != expected or lengths != (rows,) * 3:
        raise NichechainError(
            f"{domain!r} gave behaviors of shape {behavior.shape} and {lengths[0]} objectives, {lengths[1]} "
            f"flags and {lengths[2]} reasons, but must give shape {expected} and {rows} of each"
        )
    odd = ~failed & ~(np.isfinite(behavior).all(axis=1) & np.isfinite(objective))
    reasons = tuple(
        "behavior or objective is not finite" if bad else _storable(reason) if reason else ""
        for bad, reason in zip(odd, evaluation.reasons, strict=True)
    )
    if not odd.any() and reasons == evaluation.reasons:
        return evaluation
    return replace(
        evaluation,
        behavior=np.where(odd[:, None], np.nan, behavior),
        objective=np.where(odd, np.nan, objective),
        failed=failed | odd,
        reasons=reasons,
        spread=None if evaluation.spread is None else np.where(odd[:, None], np.nan, evaluation.spread),
    )


def available_cpus() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def count_workers(workers: int | None) -> int:
    """How many workers are asked for, by default one per processor.

    Raises
    ------
    NichechainError
        If it is below 1.
    """
    count = available_cpus() if workers is None else workers
    check_at_least(1, workers=count)
    return count
