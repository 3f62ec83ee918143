"""What a test of an experiment says: p, and beside it n, an effect size and its interval."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Interval:
    """A confidence interval.

    Parameters
    ----------
    low, high : float
    level : float
    method : str
        How it was found.
    """

    low: float
    high: float
    level: float
    method: str

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high


@dataclass(frozen=True)
class Effect:
    """Size of an effect.

    Parameters
    ----------
    name : str
    value : float
    interval : Interval, optional
        None where the resamples give none that holds the value, as when all values of a resample are
        alike, or the value is about the largest that there is.
    """

    name: str
    value: float
    interval: Interval | None


@dataclass(frozen=True)
class HypothesisTest:
    """A significance test.

    Parameters
    ----------
    name : str
    symbol : str
        Of the statistic.
    statistic, p : float
        p is two-sided where the test has sides.
    n : int
        Runs that it rests on.
    effect : Effect
    """

    name: str
    symbol: str
    statistic: float
    p: float
    n: int
    effect: Effect


@dataclass(frozen=True)
class Pair:
    """Two groups compared after the test between all.

    Parameters
    ----------
    first, second : str
    p : float
        Adjusted for the number of pairs.
    effect : Effect
        Above 0 where the first group has the larger values; its interval is of this pair alone.
    """

    first: str
    second: str
    p: float
    effect: Effect


@dataclass(frozen=True)
class GroupTest:
    """A test between groups and the comparisons that follow it.

    Parameters
    ----------
    test : HypothesisTest
    post_hoc : str
        Name of the test of each pair.
    mean_ranks : dict of str to float
        1 is the rank of the smallest value.
    pairs : tuple of Pair
    """

    test: HypothesisTest
    post_hoc: str
    mean_ranks: dict[str, float]
    pairs: tuple[Pair, ...]
