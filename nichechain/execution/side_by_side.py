"""Computations that do not need each other, on as many threads as there are processors."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import TypeVar

from nichechain.execution.base import LOOK_SECONDS, available_cpus

Item = TypeVar("Item")
Result = TypeVar("Result")

# So many items for each thread wait for it, however many there are.
_AHEAD = 4

_under_way = threading.local()


def side_by_side(
    call: Callable[[Item], Result], items: Iterable[Item], on_done: Callable[[int], None] | None = None
) -> list[Result]:
    """What a function gives for each item, in the order of the items.

    Parameters
    ----------
    call : callable
        Leaves the interpreter to others most of the time, as products of matrices do. Where one item may
        take long, it calls :func:`stop_if_nobody_waits` now and then.
    items : iterable
    on_done : callable, optional
        Told, in the thread that asks, how many more are done.

    Returns
    -------
    list
        The same whatever the number of threads, if ``call`` depends on its item alone.
    """
    threads = available_cpus()
    over = threading.Event()
    pool = ThreadPoolExecutor(threads, initializer=_belong, initargs=(over,))
    results: list[Result] = []
    waiting: deque[Future[Result]] = deque()

    def take() -> None:
        while not wait([waiting[0]], LOOK_SECONDS).done:
            pass
        results.append(waiting.popleft().result())
        if on_done is not None:
            on_done(1)

    try:
        for item in items:
            waiting.append(pool.submit(call, item))
            if len(waiting) > _AHEAD * threads:
                take()
        while waiting:
            take()
        return results
    finally:
        # Whoever is interrupted waits for what is under way, and for no more.
        over.set()
        pool.shutdown(cancel_futures=True)


def stop_if_nobody_waits() -> None:
    """End a computation of :func:`side_by_side` that was interrupted, from within; anywhere else nothing.

    Raises
    ------
    InterruptedError
        If whoever asked for it has gone.
    """
    over = getattr(_under_way, "over", None)
    if over is not None and over.is_set():
        raise InterruptedError("nobody waits for this computation any more")


def _belong(over: threading.Event) -> None:
    _under_way.over = over
