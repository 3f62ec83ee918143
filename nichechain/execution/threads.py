"""Threads of this process: for domains whose rollouts leave the GIL."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from queue import Empty, SimpleQueue
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from nichechain.domains.base import Domain, Evaluation
from nichechain.domains.memory import check_cache_memory, limit_cache
from nichechain.execution.base import LOOK_SECONDS, count_workers, evaluate_rows
from nichechain.variation.unborn import Unborn


class Threads:
    """Evaluates in threads: right for domains whose rollouts leave the GIL.

    Each worker takes the next chunk as soon as it is free, so a slow episode holds nobody up.

    Parameters
    ----------
    workers : int
        Number of threads, at least 1; by default the processors this process may use.
    cache_memory : int, optional
        Bytes that caches of a domain may take on this machine; by default as many as the domain says.

    Raises
    ------
    NichechainError
        If ``workers`` is below 1, or ``cache_memory`` is below 0.
    """

    def __init__(self, workers: int | None = None, *, cache_memory: int | None = None) -> None:
        if cache_memory is not None:
            check_cache_memory(cache_memory)
        self._cache_memory = cache_memory
        self._workers = count_workers(workers)
        self._pool = ThreadPoolExecutor(self._workers, thread_name_prefix="nichechain")

    def evaluate(
        self,
        domain: Domain,
        genotypes: NDArray[np.float32] | Unborn,
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        """Evaluate genotypes (N, P), N at least 1, telling ``on_done`` of every finished chunk's size."""
        if self._cache_memory is not None:
            limit_cache(domain, self._cache_memory)
        waiting = deque(range(0, len(genotypes), domain.chunk))
        chunks = len(waiting)
        parts: dict[int, Evaluation] = {}
        news: SimpleQueue[tuple[int, Evaluation] | BaseException] = SimpleQueue()

        def work() -> None:
            while True:
                try:
                    first = waiting.popleft()
                except IndexError:
                    return
                try:
                    rows = genotypes[first : first + domain.chunk]
                    news.put((first, evaluate_rows(domain, rows)))
                except BaseException as error:
                    news.put(error)
                    return

        try:
            for _ in range(min(self._workers, chunks)):
                self._pool.submit(work)
            while len(parts) < chunks:
                try:
                    told = news.get(timeout=LOOK_SECONDS)
                except Empty:
                    continue
                if isinstance(told, BaseException):
                    raise told
                first, part = told
                parts[first] = part
                if on_done is not None:
                    on_done(len(part))
        except BaseException:
            waiting.clear()
            raise
        return Evaluation.concatenate([parts[first] for first in sorted(parts)])

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
