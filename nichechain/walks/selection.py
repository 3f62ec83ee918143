"""Who may follow the present state of a walk, from the least to the most permissive rule.

A rule only names candidates; one of them is then drawn uniformly. Every rule leaves the same draws
to be made, so two rules that name the same candidates make the same walk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_numbers, check_share, shown
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# 0.07 · 100 is 7.000000000000001 in floating point, and means 7.
_TOLERANCE = 1e-9


@dataclass(frozen=True)
class Scores:
    """What a rule looks at: C individuals of each of R walks.

    Parameters
    ----------
    score : (R, C) array
        G of each; NaN where it failed.
    parent_score : (R, C) array
        G of the state that each descends from.
    tie_key : (R, C) array
        Uniform random keys; of equal scores, the one with the larger key is better.
    eligible : (R, C) bool array
        Those that may be selected at all.
    places : int
        How many are to be selected.
    """

    score: Floats
    parent_score: Floats
    tie_key: Floats
    eligible: Bools
    places: int

    def best(self, count: Ints) -> Bools:
        """The ``count`` (R,) best of the eligible of each walk, (R, C)."""
        order = np.lexsort((self.tie_key, self.score, self.eligible), axis=-1)
        rank = np.empty_like(order)
        positions = np.broadcast_to(np.arange(order.shape[1])[::-1], order.shape)
        np.put_along_axis(rank, order, positions, axis=1)
        return self.eligible & (rank < count[:, None])


class Selection(Protocol):
    """A rule that names candidates."""

    def candidates(self, scores: Scores) -> Bools:
        """Those that may be selected, (R, C)."""
        ...


@dataclass(frozen=True)
class Selective:
    """The best only: the highly selective walk (Eq. 13). Ties are broken at random."""

    def candidates(self, scores: Scores) -> Bools:
        """As many as there are places, (R, C)."""
        return scores.best(np.full(len(scores.score), scores.places))


@dataclass(frozen=True)
class TopFraction:
    """The best share: the adaptive walk of the paper's experiments, whose threshold follows them.

    Parameters
    ----------
    fraction : float
        Of n individuals, the best ceil(fraction · n) are candidates; above 0 and at most 1.
    ties : {"random", "all"}
        ``random``: exactly so many, ties being broken at random. ``all``: all whose G is at least
        that of the last of them, the letter of the paper; many offspring may tie, because most
        change nothing.

    Raises
    ------
    NichechainError
        If a value is out of range.

    Notes
    -----
    n counts those that may be selected: an individual that failed is not one. With a fraction of
    1 this is the random walk, and with 1/n the highly selective walk.
    """

    fraction: float
    ties: Literal["random", "all"] = "random"

    def __post_init__(self) -> None:
        check_share(fraction=self.fraction)
        if self.ties not in ("random", "all"):
            raise NichechainError(f"ties is {shown(self.ties)}, but must be random or all")

    def candidates(self, scores: Scores) -> Bools:
        """The best share of the eligible, but no fewer than there are places, (R, C)."""
        eligible = scores.eligible.sum(axis=1)
        share = [math.ceil(self.fraction * n - _TOLERANCE) for n in eligible.tolist()]
        top = scores.best(np.maximum(share, scores.places))
        if self.ties == "random":
            return top
        threshold = np.where(top, scores.score, np.inf).min(axis=1, keepdims=True)
        passing: Bools = scores.eligible & (scores.score >= threshold)
        return passing


@dataclass(frozen=True)
class AtLeast:
    """All with G ≥ a: the adaptive walk with a constant threshold ("Adaptive walk").

    Parameters
    ----------
    threshold : float
        a, in units of the metric.

    Raises
    ------
    NichechainError
        If it is NaN.
    """

    threshold: float

    def __post_init__(self) -> None:
        check_numbers(threshold=self.threshold)
        if math.isnan(self.threshold):
            raise NichechainError("threshold is nan, but must be a number")

    def candidates(self, scores: Scores) -> Bools:
        """The eligible that pass, (R, C)."""
        return scores.eligible & (scores.score >= self.threshold)


@dataclass(frozen=True)
class BetterThanParent:
    """All that are better than the state they descend from ("Adaptive walk").

    Parameters
    ----------
    strict : bool
        Whether better means G larger than the parent's, or at least as large: the paper's C_a with
        a = G(parent), which lets a walk drift among equals. Parent and offspring are scored
        against the same step's population and archive.
    """

    strict: bool = True

    def candidates(self, scores: Scores) -> Bools:
        """The eligible that pass, (R, C)."""
        if self.strict:
            return scores.eligible & (scores.score > scores.parent_score)
        return scores.eligible & (scores.score >= scores.parent_score)


@dataclass(frozen=True)
class Uniform:
    """All: the random walk (Eq. 16)."""

    def candidates(self, scores: Scores) -> Bools:
        """The eligible, (R, C)."""
        return scores.eligible


def draw(candidates: Bools, choice: Floats) -> Ints:
    """Draw without replacement, uniformly.

    Parameters
    ----------
    candidates : (R, C) bool array
    choice : (R, μ) array
        One uniform number in [0, 1) for each draw.

    Returns
    -------
    (R, μ) int64 array
        Columns of the drawn; -1 from where no candidate was left.
    """
    drawn = np.full(choice.shape, -1, np.int64)
    for row, (passing, numbers) in enumerate(zip(candidates, choice.tolist(), strict=True)):
        left = np.flatnonzero(passing).tolist()
        for place, number in enumerate(numbers[: len(left)]):
            drawn[row, place] = left.pop(int(number * len(left)))
    return drawn
