"""Deb's polynomial mutation, for genes with bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_numbers
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PolynomialMutation:
    """Moves every gene within its bounds, seldom far.

    Parameters
    ----------
    low, high : float
        Bounds of every gene.
    eta : float
        Distribution index η, from 0 on: the larger, the smaller the steps.

    Raises
    ------
    NichechainError
        If the bounds are not finite and in order, or ``eta`` is negative or not finite.

    Notes
    -----
    Source: K. Deb and S. Agrawal, A niched-penalty approach for constraint handling in genetic
    algorithms, 1999; in NSGA-II with bounds. Of the range, a gene in the middle of it moves by
    1/(η + 2) or less on average. N(θ) is the whole box.
    """

    low: float
    high: float
    eta: float = 45.0

    def __post_init__(self) -> None:
        check_numbers(low=self.low, high=self.high, eta=self.eta)
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise NichechainError(f"genes are from {self.low} to {self.high}, but must have finite bounds")
        if not (math.isfinite(self.eta) and self.eta >= 0):
            raise NichechainError(f"eta is {self.eta}, but must be a number from 0")

    def __call__(self, parent: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
        """One child of a parent, or one of each of several (..., P), of the same shape and type.

        A gene outside of its bounds is taken to the nearest first.
        """
        gene = np.clip(np.asarray(parent, np.float64), self.low, self.high)
        u = rng.random(gene.shape)
        extent = self.high - self.low
        # The two halves of the distribution mirror each other: room is how far the gene is from the
        # other bound, and tail the chance on its side, both as shares.
        down = u < 0.5
        room = 1.0 - np.where(down, gene - self.low, self.high - gene) / extent
        tail = 2.0 * np.where(down, u, 1.0 - u)
        size = 1.0 - (tail + (1.0 - tail) * room ** (self.eta + 1.0)) ** (1.0 / (self.eta + 1.0))
        child = gene + np.where(down, -size, size) * extent
        return np.clip(child, self.low, self.high).astype(parent.dtype)
