"""What a mutation adds to the weights: distributions at scale 1."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_positive

Floats = NDArray[np.float64]


class MutationNoise(Protocol):
    """A distribution of steps."""

    def __call__(self, rng: np.random.Generator, n: int) -> Floats:
        """One step in n dimensions, (n,), at scale 1."""
        ...


@runtime_checkable
class IndependentNoise(MutationNoise, Protocol):
    """Coordinates that are independent and alike, symmetric about 0 and continuous."""

    def tail(self, x: Floats) -> Floats:
        """P(X > x) for x ≥ 0."""
        ...

    def from_tail(self, p: Floats) -> Floats:
        """The x ≥ 0 with P(X > x) = p, for 0 < p ≤ 1/2."""
        ...


@dataclass(frozen=True)
class CauchyNoise:
    """Standard Cauchy coordinates."""

    def __call__(self, rng: np.random.Generator, n: int) -> Floats:
        """One step, (n,)."""
        return rng.standard_cauchy(n)

    def tail(self, x: Floats) -> Floats:
        """P(X > x)."""
        tail: Floats = np.arctan2(1.0, x) / np.pi
        return tail

    def from_tail(self, p: Floats) -> Floats:
        """The inverse of :meth:`tail`."""
        x: Floats = 1.0 / np.tan(np.pi * p)
        return x


@dataclass(frozen=True)
class GaussianNoise:
    """Standard normal coordinates."""

    def __call__(self, rng: np.random.Generator, n: int) -> Floats:
        """One step, (n,)."""
        return rng.standard_normal(n)

    def tail(self, x: Floats) -> Floats:
        """P(X > x)."""
        from scipy.special import ndtr

        tail: Floats = ndtr(-x)
        return tail

    def from_tail(self, p: Floats) -> Floats:
        """The inverse of :meth:`tail`."""
        from scipy.special import ndtri

        x: Floats = -ndtri(p)
        return x


@dataclass(frozen=True)
class StudentTNoise:
    """Coordinates of Student's t distribution.

    Parameters
    ----------
    df : float
        Degrees of freedom, positive: 1 is Cauchy, infinitely many would be normal.
    """

    df: float = 3.0

    def __post_init__(self) -> None:
        check_positive(df=self.df)

    def __call__(self, rng: np.random.Generator, n: int) -> Floats:
        """One step, (n,)."""
        return rng.standard_t(self.df, n)

    def tail(self, x: Floats) -> Floats:
        """P(X > x)."""
        from scipy.special import stdtr

        tail: Floats = stdtr(self.df, -x)
        return tail

    def from_tail(self, p: Floats) -> Floats:
        """The inverse of :meth:`tail`."""
        from scipy.special import stdtrit

        x: Floats = -stdtrit(self.df, p)
        return x


@dataclass(frozen=True)
class BallNoise:
    """A point drawn uniformly from the unit ball; its coordinates depend on each other."""

    def __call__(self, rng: np.random.Generator, n: int) -> Floats:
        """One step, (n,)."""
        direction = rng.standard_normal(n)
        # The radius of a uniform point in n dimensions has distribution function r^n.
        step: Floats = direction / np.linalg.norm(direction) * rng.random() ** (1.0 / n)
        return step


def truncated(noise: IndependentNoise, rng: np.random.Generator, limit: Floats) -> Floats:
    """One step of which every coordinate is conditioned on lying in [-limit, limit].

    Parameters
    ----------
    noise : IndependentNoise
    rng : numpy.random.Generator
        One uniform number is drawn per coordinate.
    limit : (n,) array
        Positive, at scale 1.

    Returns
    -------
    (n,) array

    Notes
    -----
    Exact inversion, F⁻¹(u) for u uniform between F(-limit) and F(limit), done from the tail that a
    coordinate lies in: close to 1 a distribution function has no digits left.
    """
    signed = 2.0 * rng.random(limit.size) - 1.0
    beyond = noise.tail(limit)
    p = 0.5 - np.abs(signed) * (0.5 - beyond)
    # p = 0 stands for the limit itself, where what lies beyond it is too small for a float64.
    with np.errstate(divide="ignore"):
        size = np.minimum(noise.from_tail(np.maximum(p, np.finfo(np.float64).tiny)), limit)
    step: Floats = np.copysign(size, signed)
    return step
