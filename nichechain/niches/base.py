"""What the rest of the package asks of niches, however they divide the behavior space."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_floats
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bounds = tuple[tuple[float, float], ...]

Niche = int | tuple[int, ...]
"""A niche is its flat id or its index: of a grid one number per axis (C order, axis 0 is x)."""

OUTSIDE_MODES = ("state", "absorb", "clip")


class Niches(ABC):
    """A division of a box of behavior space into niches, and the state outside it.

    Niches have flat ids 0 to n − 1; the outside state, where there is one, has id n. Two divisions
    are equal if they put every behavior in the same state.
    """

    kind: ClassVar[str]
    """``grid`` or ``cvt``, as in a configuration."""
    bounds: Bounds
    """Lower and upper bound of each axis of behavior; both belong to the box."""
    outside: str
    """What a behavior out of bounds belongs to: ``state``, ``absorb`` or ``clip``."""

    @abstractmethod
    def __len__(self) -> int:
        """Number of niches; the outside state is not one."""

    @property
    @abstractmethod
    def centers(self) -> Floats:
        """Centre of each niche, (n, B), in units of behavior."""

    @abstractmethod
    def flat(self, niche: Niche) -> int:
        """Flat id of a niche given as flat id or index.

        Raises
        ------
        NichechainError
            If there is no such niche.
        """

    @abstractmethod
    def index(self, flat: int) -> tuple[int, ...]:
        """Index of a niche given as flat id."""

    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """What the configuration of a build says of these niches, but for the seed of a tessellation."""

    @abstractmethod
    def _nearest(self, points: Floats) -> Ints:
        """The niche that each point (N, B) lies in, or that is nearest to it, (N,)."""

    @property
    def states(self) -> int:
        """States of the chain: the niches, and the outside state where there is one."""
        return len(self) + (self.outside != "clip")

    @property
    def lower(self) -> Floats:
        """Lower bound of each axis, (B,)."""
        return np.array([low for low, _ in self.bounds])

    @property
    def upper(self) -> Floats:
        """Upper bound of each axis, (B,)."""
        return np.array([high for _, high in self.bounds])

    def of(self, behavior: ArrayLike) -> Ints:
        """State that each behavior belongs to.

        Parameters
        ----------
        behavior : (N, B) array
            Finite values.

        Returns
        -------
        (N,) int64 array
            Flat ids of niches, ``len(self)`` for the outside state.

        Raises
        ------
        NichechainError
            If the shape does not fit or a value is not finite.
        """
        points = as_floats("behavior", behavior)
        if points.ndim != 2 or points.shape[1] != len(self.bounds):
            raise NichechainError(f"behavior has shape {points.shape}, but must be (N, {len(self.bounds)})")
        if not np.isfinite(points).all():
            raise NichechainError("behavior has NaN or infinite values, which belong to no niche")
        state = self._nearest(points)
        if self.outside != "clip":
            state[~is_inside(points, self.bounds)] = len(self)
        return state

    def label(self, state: int) -> str:
        """How a state is called in tables and figures: its index, as ``"7,11"``, or ``"outside"``."""
        return "outside" if state == len(self) else ",".join(map(str, self.index(state)))


MOST_NICHES = 10_000_000
"""More than any archive fills; what lies beyond is a mistyped number that no memory holds."""


def check_bounds(bounds: Bounds) -> None:
    """Refuse bounds that are not finite and increasing."""
    for low, high in bounds:
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise NichechainError(f"bounds are {low:g} to {high:g}, but must be finite and increasing")


def is_inside(points: Floats, bounds: Bounds) -> NDArray[np.bool_]:
    """Whether each point (N, B) lies in the box, ends included."""
    lower, upper = np.array(bounds).T
    inside: NDArray[np.bool_] = ((points >= lower) & (points <= upper)).all(axis=1)
    return inside


def one_hot(behavior: ArrayLike, niches: Niches) -> Floats:
    """One-hot form of behaviors: 1 for the niche they belong to, 0 for all others.

    Parameters
    ----------
    behavior : (..., B) array
        NaN, the behavior of what failed, belongs to no niche.
    niches : Niches

    Returns
    -------
    (..., n) float64 array
        Rows of zeros for what lies outside or failed: the outside state is no niche.

    Raises
    ------
    NichechainError
        If the last axis does not fit or a value is infinite.

    Notes
    -----
    The paper's section "Behavior function and descriptors". Two behaviors are √2 apart where their niches
    differ and at no distance where they are one: how far niches lie from each other is gone. The
    measures of :mod:`nichechain.landscape` take this form like any behavior: η* is then √2 times
    the probability that two offspring fall in different niches.
    """
    points = as_floats("behavior", behavior)
    flat = points.reshape(-1, points.shape[-1]) if points.ndim else points
    known = ~np.isnan(flat).any(axis=-1)
    state = niches.of(flat[known])
    form = np.zeros((len(flat), len(niches)))
    inside = state < len(niches)
    form[np.flatnonzero(known)[inside], state[inside]] = 1.0
    return form.reshape(*points.shape[:-1], len(niches))
