"""Births of a search into an archive folder, commit by commit."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from nichechain.archive.write import Writer
from nichechain.execution import Executor
from nichechain.search import savings
from nichechain.search.failures import Failures
from nichechain.search.map_elites import MapElites

CHECKPOINT_SECONDS = 30.0
_COMMIT_SHARE = 0.01


@dataclass(frozen=True)
class BuildProgress:
    """How far a build or a calibration is.

    Parameters
    ----------
    births : int
        Evaluated so far, those of the batch under way among them.
    filled : int
        Niches with an elite.
    outside, failed : int
        Births out of bounds, and births whose evaluation failed.
    """

    births: int
    filled: int
    outside: int
    failed: int


@dataclass
class Filling:
    """A search that fills a folder.

    Parameters
    ----------
    folder : Path
    search : MapElites
    writer : Writer
    failures : Failures
    outside : int
        Births out of bounds so far.
    state : int
        The number of the outside state.
    on_progress : callable, optional
    kept : int
        Births that the folder holds: it stays as it is until there are more.
    """

    folder: Path
    search: MapElites
    writer: Writer
    failures: Failures
    outside: int
    state: int
    on_progress: Callable[[BuildProgress], None] | None
    kept: int = 0
    _under_way: int = 0

    def go(self, births: int, executor: Executor, on_step: Callable[[pa.Table], None] | None = None) -> None:
        """Search until there are so many births.

        Commits every half minute, or less often if that would take more than a hundredth of the
        time, at the end, and when interrupted.

        Parameters
        ----------
        births : int
        executor : Executor
        on_step : callable, optional
            Given the births of each step before they count.

        Raises
        ------
        NichechainError
            If more births fail than may.
        ArchiveError
            If the folder cannot be written to.
        """
        last_commit = time.monotonic()
        pause = CHECKPOINT_SECONDS
        self._tell()
        try:
            while self.search.births < births:
                self.failures.check(
                    f"{self.folder} keeps them, and a build with a larger max_failed goes on from there"
                )
                rows = self.search.advance(executor, births - self.search.births, self._tell)
                self._under_way = 0
                if on_step is not None:
                    on_step(rows)
                self.writer.append(rows)
                self.outside += count(rows, self.state)
                self.failures.count(rows)
                self._tell()
                if time.monotonic() - last_commit > pause:
                    began = time.monotonic()
                    self._commit()
                    last_commit = time.monotonic()
                    # Many large genotypes take a while to write.
                    pause = max(CHECKPOINT_SECONDS, (last_commit - began) / _COMMIT_SHARE)
        finally:
            # An interrupt between two halves of a step leaves nothing to commit; the last commit
            # is at most half a minute old.
            if self.search.settled and self.search.births == self.writer.births > self.kept:
                self._commit()

    def _commit(self) -> None:
        self.writer.commit(self.search.state)
        # Of no consequence where it cannot be written.
        with suppress(OSError):
            savings.write(self.folder, self.search.savings)

    def _tell(self, done: int = 0) -> None:
        self._under_way += done
        if self.on_progress is not None:
            births = self.search.births + self._under_way
            self.on_progress(BuildProgress(births, self.search.filled, self.outside, self.failures.failed))


def count(rows: pa.Table, state: int) -> int:
    """Births in a state."""
    return int(np.count_nonzero(rows["child_niche"].to_numpy() == state))
