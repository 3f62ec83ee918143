"""Who evaluates, as options say it."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from nichechain.cli import progress

if TYPE_CHECKING:
    from nichechain.execution import Executor


def hired(workers: str | None, cache_memory: str | None) -> AbstractContextManager[Executor]:
    """The executor of ``--workers`` and ``--cache-memory``, with something that turns while Ray starts."""
    from nichechain import execution

    with progress.spinner("starting workers"):
        return execution.make(workers, cache_memory)
