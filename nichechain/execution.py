"""Where evaluations run. Results never depend on it."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
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
        """The rows of ``domain.evaluate(genotypes)``, in order, to the bit."""
        ...


class Threads:
    """Evaluates in threads: right for domains whose rollouts leave the GIL.

    Each worker takes the next chunk as soon as it is free, so a slow episode holds nobody up.

    Parameters
    ----------
    workers : int
        Number of threads, at least 1; by default the processors this process may use.

    Raises
    ------
    NichechainError
        If ``workers`` is below 1.
    """

    def __init__(self, workers: int | None = None) -> None:
        count = available_cpus() if workers is None else workers
        if count < 1:
            raise NichechainError(f"workers is {count}, but at least 1 is needed")
        self._pool = ThreadPoolExecutor(count, thread_name_prefix="nichechain")

    def evaluate(
        self,
        domain: Domain,
        genotypes: NDArray[np.float32],
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        """Evaluate genotypes (N, P), N at least 1, telling ``on_done`` of every finished chunk's size."""
        chunks = [genotypes[i : i + domain.chunk] for i in range(0, len(genotypes), domain.chunk)]
        futures = [self._pool.submit(domain.evaluate, chunk) for chunk in chunks]
        try:
            parts = []
            for future in futures:
                parts.append(future.result())
                if on_done is not None:
                    on_done(len(parts[-1]))
        except BaseException:
            for future in futures:
                future.cancel()
            raise
        return Evaluation.concatenate(parts)

    def close(self) -> None:
        """Let go of the threads once what they are at is done."""
        self._pool.shutdown(cancel_futures=True)

    def __enter__(self) -> Threads:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def available_cpus() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
