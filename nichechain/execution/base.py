"""What an executor is, and what every one of them says of a genotype whose evaluation raises."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from nichechain.domains.base import Domain, Evaluation
from nichechain.errors import NichechainError


class Executor(Protocol):
    """Evaluates batches of genotypes somewhere."""

    def evaluate(
        self,
        domain: Domain,
        genotypes: NDArray[np.float32],
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        """The rows of ``domain.evaluate(genotypes)``, in order, to the bit.

        Parameters
        ----------
        domain : Domain
        genotypes : (N, P) float32 array
            N at least 1.
        on_done : callable, optional
            Told how many more have been evaluated.

        Raises
        ------
        Exception
            What the domain raises; a note names the row of the genotype.
        """
        ...


def evaluate_rows(domain: Domain, genotypes: NDArray[np.float32], first: int) -> Evaluation:
    """Evaluate some rows of a batch, from row ``first`` on; an exception gets a note of its row."""
    try:
        return domain.evaluate(genotypes)
    except Exception as error:
        error.add_note(f"raised by {domain!r} for {_culprit(domain, genotypes, first)}")
        raise


def _culprit(domain: Domain, genotypes: NDArray[np.float32], first: int) -> str:
    if len(genotypes) > 1:
        # Domains are pure, so the row that raised among others raises alone.
        for row in range(len(genotypes)):
            try:
                domain.evaluate(genotypes[row : row + 1])
            except Exception:
                return f"row {first + row} of the batch"
        return f"rows {first} to {first + len(genotypes) - 1} of the batch"
    return f"row {first} of the batch"


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
    if count < 1:
        raise NichechainError(f"workers is {count}, but at least 1 is needed")
    return count
