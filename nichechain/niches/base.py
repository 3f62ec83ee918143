"""What the rest of the package asks of niches, however they divide the behavior space."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_floats, shown
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bounds = tuple[tuple[float, float], ...]

OUTSIDE: Final = "outside"
"""How the outside state is called."""

Niche = int | tuple[int, ...] | Literal["outside"]
"""A niche is its flat id or its index: of a grid one number per axis (C order, axis 0 is x).

Where a state is asked for, the outside state is one as well: by its name, or its id n.
"""

OUTSIDE_MODES = ("state", "absorb", "clip")
"""What may become of behaviors outside the bounds."""


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
            Finite values. Of float32, a value that is a bound in that precision lies on the bound.

        Returns
        -------
        (N,) int64 array
            Flat ids of niches, ``len(self)`` for the outside state.

        Raises
        ------
        NichechainError
            If the shape does not fit or a value is not finite.
        """
        precision = precision_of(behavior)
        points = as_floats("behavior", behavior)
        if points.ndim != 2 or points.shape[1] != len(self.bounds):
            raise NichechainError(f"behavior has shape {points.shape}, but must be (N, {len(self.bounds)})")
        if not np.isfinite(points).all():
            raise NichechainError("behavior has NaN or infinite values, which belong to no niche")
        state = self._nearest(points)
        if self.outside != "clip":
            state[~is_inside(points, self.bounds, precision)] = len(self)
        return state

    def state(self, niche: Niche) -> int:
        """State of the chain, given as a niche or as the outside state.

        Raises
        ------
        NichechainError
            If there is no such state.
        """
        if isinstance(niche, str):
            if niche != OUTSIDE:
                raise NichechainError(
                    f"niche is {shown(niche)}, but must be an index, a number, or {OUTSIDE!r}"
                )
            if self.outside == "clip":
                raise NichechainError(
                    "niche is 'outside', but these niches have no outside state: it is clipped"
                )
            return len(self)
        if isinstance(niche, (int, np.integer)) and niche == len(self) and self.outside != "clip":
            return len(self)
        return self.flat(niche)

    def label(self, state: int) -> str:
        """How a state is called in tables and figures: its index, as ``"7,11"``, or ``"outside"``."""
        outside = isinstance(state, (int, np.integer)) and state == len(self)
        return OUTSIDE if outside else ",".join(map(str, self.index(state)))


MOST_NICHES = 10_000_000
"""More than any archive fills; what lies beyond is a mistyped number that no memory holds."""


def check_bounds(bounds: Bounds) -> None:
    """Refuse bounds that are none, or not finite and increasing."""
    if not len(bounds):
        raise NichechainError("bounds are empty, but must have a pair of numbers for each axis")
    for low, high in bounds:
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise NichechainError(f"bounds are {low:g} to {high:g}, but must be finite and increasing")
        if not np.isfinite(high - low) or low + (high - low) / 2 in (low, high):
            raise NichechainError(
                f"bounds are {low:g} to {high:g}, whose span floating-point numbers cannot divide"
            )


def precision_of(behavior: object) -> np.dtype[np.floating[Any]]:
    """The precision that behaviors came in: that of an array of short floats, or else float64."""
    kind = getattr(behavior, "dtype", None)
    short = isinstance(kind, np.dtype) and kind.kind == "f" and kind.itemsize < 8
    return np.dtype(kind if short else np.float64)


def is_inside(
    points: Floats, bounds: Bounds, precision: np.dtype[np.floating[Any]] | None = None
) -> NDArray[np.bool_]:
    """Whether each point (N, B) lies in the box, ends included.

    Parameters
    ----------
    points : (N, B) float64 array
    bounds : tuple of (float, float)
    precision : numpy.dtype, optional
        That of the values behind the points. The bounds are rounded to it: 1.1 in float32 is larger
        than 1.1, and lies on a bound of 1.1 all the same.
    """
    lower, upper = np.array(bounds).astype(precision or np.float64).astype(np.float64).T
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
    if not points.ndim or not points.shape[-1]:
        raise NichechainError(f"behavior has shape {points.shape}, but must be (..., {len(niches.bounds)})")
    flat = points.reshape(-1, points.shape[-1])
    known = ~np.isnan(flat).any(axis=-1)
    state = niches.of(flat[known])
    form = np.zeros((len(flat), len(niches)))
    inside = state < len(niches)
    form[np.flatnonzero(known)[inside], state[inside]] = 1.0
    return form.reshape(*points.shape[:-1], len(niches))
