"""Processes of this machine: for domains that hold the GIL, or that may crash."""

from __future__ import annotations

import os
import signal
import threading
import time
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from typing import TYPE_CHECKING, Any

from nichechain.execution.base import count_workers
from nichechain.execution.fleet import Fleet, Outcome, Raised, Rows, Workbench, Worker

if TYPE_CHECKING:
    from nichechain.domains.base import Evaluation


class Processes(Fleet):
    """Evaluates in processes of this machine.

    Right for domains that run in Python, and hold the GIL. A process that dies is replaced and
    its rows are evaluated again; what the domain defines may live in a script or a notebook.

    Parameters
    ----------
    workers : int
        Number of processes, at least 1; by default the processors this process may use.
    cache_memory : int, optional
        Bytes that caches of a domain may take in all processes together; by default as many as the
        domain says.

    Raises
    ------
    NichechainError
        If ``workers`` is below 1, or ``cache_memory`` is below 0.
    """

    _lost = (BrokenProcessPool,)

    def __init__(self, workers: int | None = None, *, cache_memory: int | None = None) -> None:
        super().__init__(cache_memory)
        self._count = count_workers(workers)
        self._pickled = b""

    def _size(self) -> int:
        return self._count

    def _neighbours(self) -> int:
        return self._count

    def _send(self, domain: bytes) -> None:
        self._pickled = domain

    def _hire(self) -> Worker:
        return _Process(self._pickled, self._cache_share)


class _Process(Worker):
    """A pool of one: when it breaks, we know over which rows, and the others go on."""

    def __init__(self, domain: bytes, cache_memory: int) -> None:
        super().__init__()
        from loky import ProcessPoolExecutor

        # As many numerical threads in each process as processors would be too many.
        env = {"OMP_NUM_THREADS": os.environ.get("OMP_NUM_THREADS", "1")}
        begun_with = (domain, cache_memory, os.getpid())
        self._pool: Any = ProcessPoolExecutor(1, initializer=_begin, initargs=begun_with, env=env)
        self.ready = self._pool.submit(_prepare)

    def submit(self, rows: Rows) -> Future[Outcome]:
        try:
            future: Future[Outcome] = self._pool.submit(_evaluate, rows)
        except BrokenProcessPool as error:
            future = Future()
            future.set_exception(error)
        return future

    def stop(self, *, kill: bool) -> None:
        self._pool.shutdown(wait=True, kill_workers=kill)


# A process of a pool has nowhere else to keep something between two tasks.
_bench: list[Workbench] = []


def _begin(domain: bytes, cache_memory: int, parent: int) -> None:
    # Ctrl-C reaches all processes of a terminal; what it means is for the parent to say.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    _bench[:] = [Workbench(domain, cache_memory)]


def _end_with(parent: int) -> None:
    """Leave when the parent has: it may have been killed, and told nobody."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def _prepare() -> Raised | None:
    return _bench[0].prepare()


def _evaluate(rows: Rows) -> Evaluation | Raised:
    return _bench[0].evaluate(rows)
