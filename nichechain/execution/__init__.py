"""Where evaluations run: threads, processes or a Ray cluster. Results never depend on it."""

from __future__ import annotations

from contextlib import AbstractContextManager

from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.domains.memory import parse_memory
from nichechain.execution.base import WORKER_DIED, Executor, available_cpus, evaluate_rows
from nichechain.execution.processes import Processes
from nichechain.execution.ray import Ray
from nichechain.execution.threads import Threads

__all__ = [
    "WORKER_DIED",
    "Executor",
    "Processes",
    "Ray",
    "Threads",
    "available_cpus",
    "evaluate_rows",
    "make",
]


# More than any machine has processors: a mistyped number, for which as many processes would be started.
_MOST_WORKERS = 4096


def make(workers: str | None = None, cache_memory: str | None = None) -> AbstractContextManager[Executor]:
    """The executor of that description, as the command line knows it.

    Parameters
    ----------
    workers : str, optional
        ``4`` or ``threads:4``, ``processes:4``, ``ray`` or ``ray://host:port``; without a number,
        one worker per processor. By default ``threads``.
    cache_memory : str, optional
        Memory that caches of a domain may take on each machine, such as ``500MB``, or ``0`` for
        none; by default as much as the domain says.

    Returns
    -------
    context manager of an Executor
        Leaving it ends the workers.

    Raises
    ------
    NichechainError
        If there is no such executor, the memory is none, or Ray is asked for and is not installed
        or does not answer.
    """
    limit = None if cache_memory is None else parse_memory(cache_memory)
    kind, _, rest = (workers or "threads").partition(":")
    if not rest and _is_number(kind):
        kind, rest = "threads", kind
    if kind == "ray" and workers == "ray":
        return Ray(cache_memory=limit)
    if kind == "ray" and rest.startswith("//") and len(rest) > 2:
        return Ray(workers, cache_memory=limit)
    if kind in ("threads", "processes") and (workers in (None, kind) or _is_number(rest)):
        count = int(rest) if rest else None
        if count is not None and count > _MOST_WORKERS:
            raise NichechainError(
                f"workers is {shown(workers)}, but must be at most {_MOST_WORKERS} on a machine"
            )
        kind_of = Threads if kind == "threads" else Processes
        return kind_of(count, cache_memory=limit)
    raise NichechainError(
        f"workers is {shown(workers)}, but must be a number of threads, threads:N, processes:N, ray or ray://HOST:PORT"
    )


def _is_number(text: str) -> bool:
    return text.removeprefix("-").isdecimal() and text.isascii()
