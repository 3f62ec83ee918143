"""Mutation operators: a parent's genotype and a generator in, a child's genotype out.

An operator defines the neighbourhood N(θ) of a genotype and the distribution F over it. There is
no crossover.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from nichechain.errors import NichechainError

Floats = NDArray[np.float64]
Genotype = NDArray[np.float32]


class Mutation(Protocol):
    """A mutation operator."""

    def __call__(self, parent: Genotype, rng: np.random.Generator) -> Genotype:
        """One child of a parent."""
        ...


@dataclass(frozen=True)
class AdditiveMutation:
    """Adds noise to every weight.

    Parameters
    ----------
    noise : callable
        ``noise(rng, n)`` gives n float64 values at scale 1.
    scale : float
        Factor on the noise, positive.

    Notes
    -----
    The sum is made in float64 and rounded once to the parent's precision.
    """

    noise: Callable[[np.random.Generator, int], Floats]
    scale: float = 1.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise NichechainError(f"mutation scale is {self.scale}, but must be a positive number")

    def __call__(self, parent: Genotype, rng: np.random.Generator) -> Genotype:
        """One child of a parent (P,), of the same shape and type."""
        return (parent + self.scale * self.noise(rng, parent.size)).astype(parent.dtype)


def cauchy(scale: float = 1.0) -> AdditiveMutation:
    """Standard Cauchy noise, the paper's operator ("Variation operator")."""
    return AdditiveMutation(_cauchy_noise, scale)


def gaussian(scale: float = 1.0) -> AdditiveMutation:
    """Normal noise; ``scale`` is its standard deviation."""
    return AdditiveMutation(_gaussian_noise, scale)


def student_t(scale: float = 1.0) -> AdditiveMutation:
    """Student's t noise with 3 degrees of freedom: between Cauchy (1) and normal (infinitely many)."""
    return AdditiveMutation(_student_t_noise, scale)


def uniform_ball(scale: float = 1.0) -> AdditiveMutation:
    """A step drawn uniformly from the ball of radius ``scale``: N(θ) is bounded."""
    return AdditiveMutation(_ball_noise, scale)


def _cauchy_noise(rng: np.random.Generator, n: int) -> Floats:
    return rng.standard_cauchy(n)


def _gaussian_noise(rng: np.random.Generator, n: int) -> Floats:
    return rng.standard_normal(n)


def _student_t_noise(rng: np.random.Generator, n: int) -> Floats:
    return rng.standard_t(3, n)


def _ball_noise(rng: np.random.Generator, n: int) -> Floats:
    direction = rng.standard_normal(n)
    # The radius of a uniform point in n dimensions has distribution function r^n.
    step: Floats = direction / np.linalg.norm(direction) * rng.random() ** (1.0 / n)
    return step


_OPERATORS: dict[str, Callable[[float], AdditiveMutation]] = {
    "cauchy": cauchy,
    "gaussian": gaussian,
    "student-t": student_t,
    "uniform-ball": uniform_ball,
}


def make(name: str, scale: float) -> AdditiveMutation:
    """The operator of that name: cauchy, gaussian, student-t or uniform-ball.

    Raises
    ------
    NichechainError
        If there is none, or the scale is not positive.
    """
    if name not in _OPERATORS:
        raise NichechainError(f"mutation is {name!r}, but must be one of {', '.join(_OPERATORS)}")
    return _OPERATORS[name](scale)
