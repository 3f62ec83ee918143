"""Mutation operators: a parent's genotype and a generator in, a child's genotype out.

An operator defines the neighbourhood N(θ) of a genotype and the distribution F over it. There is
no crossover. The noise is Cauchy (the paper's), normal, Student's t or uniform in a ball; a
:class:`Bound` makes N(θ) a real set; scales may differ by layer, and may be genes themselves.
"""

from __future__ import annotations

from collections.abc import Callable

from nichechain.core.checks import check_choice
from nichechain.core.errors import NichechainError
from nichechain.variation.additive import BOUND_KINDS, AdditiveMutation, Bound, Mutation
from nichechain.variation.noise import BallNoise, CauchyNoise, GaussianNoise, MutationNoise, StudentTNoise
from nichechain.variation.polynomial import PolynomialMutation
from nichechain.variation.self_adaptive import SelfAdaptiveDomain, SelfAdaptiveMutation

__all__ = [
    "BOUND_KINDS",
    "AdditiveMutation",
    "Bound",
    "Mutation",
    "PolynomialMutation",
    "SelfAdaptiveDomain",
    "SelfAdaptiveMutation",
    "cauchy",
    "gaussian",
    "make",
    "noise_of",
    "student_t",
    "uniform_ball",
]


def cauchy(scale: float = 1.0, bound: Bound | None = None) -> AdditiveMutation:
    """Standard Cauchy noise, the paper's operator ("Variation operator")."""
    return AdditiveMutation(CauchyNoise(), scale, bound)


def gaussian(scale: float = 1.0, bound: Bound | None = None) -> AdditiveMutation:
    """Normal noise; ``scale`` is its standard deviation."""
    return AdditiveMutation(GaussianNoise(), scale, bound)


def student_t(scale: float = 1.0, bound: Bound | None = None, *, df: float = 3.0) -> AdditiveMutation:
    """Student's t noise: between Cauchy (1 degree of freedom) and normal (infinitely many)."""
    return AdditiveMutation(StudentTNoise(df), scale, bound)


def uniform_ball(scale: float = 1.0) -> AdditiveMutation:
    """A step drawn uniformly from the ball of radius ``scale``, up to rounding of the child."""
    return AdditiveMutation(BallNoise(), scale)


_NOISES: dict[str, Callable[[], MutationNoise]] = {
    "cauchy": CauchyNoise,
    "gaussian": GaussianNoise,
    "student-t": StudentTNoise,
    "uniform-ball": BallNoise,
}


def noise_of(name: str, df: float | None = None) -> MutationNoise:
    """The noise of the operator of that name.

    Parameters
    ----------
    name : {"cauchy", "gaussian", "student-t", "uniform-ball"}
    df : float, optional
        Degrees of freedom of student-t, by default 3.

    Raises
    ------
    NichechainError
        If there is none, or degrees of freedom are given to another than student-t.
    """
    check_choice("mutation", name, _NOISES)
    if df is None:
        return _NOISES[name]()
    if name != "student-t":
        raise NichechainError(f"df is {df:g}, but {name} has no degrees of freedom: only student-t has")
    return StudentTNoise(df)


def make(name: str, scale: float, *, df: float | None = None, bound: Bound | None = None) -> AdditiveMutation:
    """The operator of that name.

    Parameters
    ----------
    name : {"cauchy", "gaussian", "student-t", "uniform-ball"}
    scale : float
    df : float, optional
        Degrees of freedom of student-t, by default 3.
    bound : Bound, optional
        Makes N(θ) a bounded set.

    Raises
    ------
    NichechainError
        If there is none, or a value is not what it must be.
    """
    return AdditiveMutation(noise_of(name, df), scale, bound)
