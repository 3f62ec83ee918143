"""What the rest of the package asks of niches, however they divide the behavior space."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

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


@runtime_checkable
class Niches(Protocol):
    """A division of a box of behavior space into niches, and the state outside it.

    Niches have flat ids 0 to n − 1; the outside state, where there is one, has id n. Two divisions
    are equal if they put every behavior in the same state.
    """

    @property
    def kind(self) -> str:
        """``grid`` or ``cvt``, as in a configuration."""
        ...

    @property
    def bounds(self) -> Bounds:
        """Lower and upper bound of each axis of behavior; both belong to the box."""
        ...

    @property
    def outside(self) -> str:
        """What a behavior out of bounds belongs to: ``state``, ``absorb`` or ``clip``."""
        ...

    @property
    def states(self) -> int:
        """States of the chain: the niches, and the outside state where there is one."""
        ...

    @property
    def lower(self) -> Floats:
        """Lower bound of each axis, (B,)."""
        ...

    @property
    def upper(self) -> Floats:
        """Upper bound of each axis, (B,)."""
        ...

    @property
    def centers(self) -> Floats:
        """Centre of each niche, (n, B), in units of behavior."""
        ...

    def __len__(self) -> int:
        """Number of niches; the outside state is not one."""
        ...

    def of(self, behavior: ArrayLike) -> Ints:
        """State that each behavior (N, B) belongs to, (N,)."""
        ...

    def flat(self, niche: Niche) -> int:
        """Flat id of a niche given as flat id or index."""
        ...

    def index(self, flat: int) -> tuple[int, ...]:
        """Index of a niche given as flat id."""
        ...

    def label(self, state: int) -> str:
        """How a state is called in tables and figures."""
        ...

    def settings(self) -> dict[str, Any]:
        """What the configuration of a build says of these niches."""
        ...


MOST_NICHES = 10_000_000
"""More than any archive fills; what lies beyond is a mistyped number that no memory holds."""


def check_bounds(bounds: Bounds) -> None:
    """Refuse bounds that are not finite and increasing."""
    for low, high in bounds:
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise NichechainError(f"bounds are {low:g} to {high:g}, but must be finite and increasing")


def check_outside(outside: str) -> None:
    """Refuse an unknown mode."""
    if outside not in OUTSIDE_MODES:
        raise NichechainError(f"outside is {outside!r}, but must be one of {', '.join(OUTSIDE_MODES)}")


def checked_behavior(behavior: ArrayLike, axes: int) -> Floats:
    """Behaviors as a float64 array (N, axes) of finite values.

    Raises
    ------
    NichechainError
        If the shape does not fit or a value is not finite.
    """
    points = as_floats("behavior", behavior)
    if points.ndim != 2 or points.shape[1] != axes:
        raise NichechainError(f"behavior has shape {points.shape}, but must be (N, {axes})")
    if not np.isfinite(points).all():
        raise NichechainError("behavior has NaN or infinite values, which belong to no niche")
    return points


def is_inside(points: Floats, bounds: Bounds) -> NDArray[np.bool_]:
    """Whether each point (N, B) lies in the box, ends included."""
    lower, upper = np.array(bounds).T
    inside: NDArray[np.bool_] = ((points >= lower) & (points <= upper)).all(axis=1)
    return inside
