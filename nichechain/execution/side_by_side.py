"""Computations that do not need each other, on as many threads as there are processors."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from nichechain.execution.base import available_cpus

Item = TypeVar("Item")
Result = TypeVar("Result")


def side_by_side(
    call: Callable[[Item], Result], items: Iterable[Item], on_done: Callable[[int], None] | None = None
) -> list[Result]:
    """What a function gives for each item, in the order of the items.

    Parameters
    ----------
    call : callable
        Leaves the interpreter to others most of the time, as products of matrices do.
    items : iterable
    on_done : callable, optional
        Told, in the thread that asks, how many more are done.

    Returns
    -------
    list
        The same whatever the number of threads, if ``call`` depends on its item alone.
    """
    pool = ThreadPoolExecutor(available_cpus())
    try:
        results = []
        for future in [pool.submit(call, item) for item in items]:
            results.append(future.result())
            if on_done is not None:
                on_done(1)
        return results
    finally:
        # Whoever is interrupted waits for what is under way, and for no more.
        pool.shutdown(cancel_futures=True)
