"""Who evaluates, as options say it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from nichechain.cli import progress

if TYPE_CHECKING:
    from nichechain.execution import Executor


@contextmanager
def hired(workers: str | None, cache_memory: str | None) -> Iterator[Executor]:
    """The executor of ``--workers`` and ``--cache-memory``, with something that turns while Ray starts."""
    from nichechain import execution

    with progress.spinner("starting workers"):
        made = execution.make(workers, cache_memory)
    with made as executor:
        yield executor
