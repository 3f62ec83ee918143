"""The novelty archive X: behaviors that a walk remembers ("Hyperparameters")."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_at_least, check_share, shown
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Scope = Literal["walk", "configuration"]
Entry = Literal["offspring", "selected"]


@dataclass(frozen=True)
class ArchiveRule:
    """What a novelty archive remembers.

    Parameters
    ----------
    limit : int
        Most behaviors it holds; when it is full, the first in is the first out.
    entry : {"offspring", "selected"}
        What may enter: every evaluated offspring, or the selected ones only.
    probability : float, optional
        With which each of those enters; by default 0.1 for offspring and 1 for the selected.
    count : int, optional
        Instead of a probability: so many of those enter in each step of a walk, drawn uniformly
        without replacement, or all if there are fewer. Doncieux et al. (2020) let 6 of 40
        offspring in.
    scope : {"walk", "configuration"}
        ``walk``: each walk has an archive of its own, empty at the start. ``configuration``: all
        walks of a configuration share one, in the order of their numbers, so that a walk depends
        on those beside it.

    Raises
    ------
    NichechainError
        If a value is out of range.

    Notes
    -----
    The paper gives the limit of 1200 and the probability of 0.1. It leaves open whether walks share
    an archive, and what leaves a full one. At 30 offspring and 50 steps an archive per walk holds
    about 150 behaviors, so that its limit never binds.
    """

    limit: int = 1200
    entry: Entry = "offspring"
    probability: float | None = None
    count: int | None = None
    scope: Scope = "walk"

    def __post_init__(self) -> None:
        check_at_least(1, archive_limit=self.limit)
        if self.probability is not None:
            check_share(archive_probability=self.probability)
        if self.count is not None:
            check_at_least(1, archive_count=self.count)
        if self.count is not None and self.probability is not None:
            raise NichechainError(
                f"archive count {self.count} and probability {self.probability} exclude each other: "
                "either so many enter, or each by chance"
            )
        for name, value, allowed in (
            ("entry", self.entry, get_args(Entry)),
            ("scope", self.scope, get_args(Scope)),
        ):
            if not isinstance(value, str) or value not in allowed:
                raise NichechainError(f"archive {name} is {shown(value)}, but must be {' or '.join(allowed)}")

    @property
    def chance(self) -> float:
        """The probability with which each of those that may enter does so."""
        if self.probability is not None:
            return self.probability
        return 0.1 if self.entry == "offspring" else 1.0

    def enters(self, lots: Floats, may: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Who enters in a step.

        Parameters
        ----------
        lots : (R, N) array
            A uniform number in [0, 1) for each of the N of each walk.
        may : (R, N) bool array
            Who may enter.

        Returns
        -------
        (R, N) bool array
        """
        if self.count is None:
            return (lots < self.chance) & may
        # The smallest lots of those that may; a lot is below 1, so the others come after them.
        rank = np.argsort(np.argsort(np.where(may, lots, 1.0), axis=1, kind="stable"), axis=1, kind="stable")
        return (rank < self.count) & may


@dataclass(frozen=True)
class NoveltyArchive:
    """Behaviors that A archives hold, the oldest first.

    Parameters
    ----------
    behavior : (A, M, B) float64 array
        NaN behind the last of a shorter archive.
    entered : (A, M) int64 array
        Step of the walk in which each was born; -1 behind the last.
    """

    behavior: Floats
    entered: NDArray[np.int64]

    @staticmethod
    def empty(archives: int, axes: int) -> NoveltyArchive:
        """That many archives with nothing in them."""
        return NoveltyArchive(np.empty((archives, 0, axes)), np.empty((archives, 0), np.int64))

    @property
    def size(self) -> NDArray[np.int64]:
        """Behaviors in each archive, (A,)."""
        size: NDArray[np.int64] = (self.entered >= 0).sum(axis=1, dtype=np.int64)
        return size

    def add(self, behavior: Floats, enters: NDArray[np.bool_], step: int, limit: int) -> NoveltyArchive:
        """Archives with more behaviors; the oldest leave those that would exceed the limit.

        Parameters
        ----------
        behavior : (A, N, B) array
        enters : (A, N) bool array
            Which of them enter.
        step : int
            Step of the walk in which they were born, not negative.
        limit : int
        """
        born = np.full(enters.shape, step, np.int64)
        points = np.concatenate([self.behavior, behavior], axis=1)
        entered = np.concatenate([self.entered, np.where(enters, born, -1)], axis=1)
        stays = entered >= 0
        surplus = stays.sum(axis=1, keepdims=True) - limit
        stays &= np.cumsum(stays, axis=1) > surplus
        # A stable sort closes the gaps and keeps the order of entry.
        order = np.argsort(~stays, axis=1, kind="stable")[:, : stays.sum(axis=1).max(initial=0)]
        kept = np.take_along_axis(stays, order, axis=1)
        points = np.take_along_axis(points, order[:, :, None], axis=1)
        entered = np.take_along_axis(entered, order, axis=1)
        return NoveltyArchive(np.where(kept[:, :, None], points, np.nan), np.where(kept, entered, -1))
