"""Niches: a grid over the behavior space, and the state outside it."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

Niche = int | tuple[int, ...]
"""A niche is its flat id or its grid index (C order, axis 0 is x)."""

OUTSIDE_MODES = ("state", "absorb", "clip")

# pyribs adds this to a scaled coordinate before it rounds down (its default ``epsilon``), and the
# two must put a behavior in the same cell.
_EPSILON = 1e-6


@dataclass(frozen=True)
class GridNiches:
    """Equal cells over a box of behavior space.

    Parameters
    ----------
    shape : tuple of int
        Cells along each axis of behavior.
    bounds : tuple of (float, float)
        Lower and upper bound of each axis. Both ends belong to the grid.
    outside : {"state", "absorb", "clip"}
        What a behavior out of bounds belongs to. ``state``: a state of its own, numbered last,
        whose elite can be a parent. ``absorb``: a state that no lineage leaves. ``clip``: the
        nearest niche on the edge, as in pyribs.

    Raises
    ------
    NichechainError
        If the shape and bounds do not fit together or are empty.
    """

    shape: tuple[int, ...]
    bounds: tuple[tuple[float, float], ...]
    outside: str = "state"

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", tuple(int(k) for k in self.shape))
        object.__setattr__(self, "bounds", tuple((float(a), float(b)) for a, b in self.bounds))
        if not self.shape or min(self.shape) < 1:
            raise NichechainError(f"grid shape is {self.shape}, but every axis needs at least 1 cell")
        if len(self.shape) != len(self.bounds):
            raise NichechainError(
                f"grid has {len(self.shape)} axes but bounds have {len(self.bounds)}: one pair per axis"
            )
        for low, high in self.bounds:
            if not (np.isfinite(low) and np.isfinite(high) and low < high):
                raise NichechainError(f"bounds are {low:g} to {high:g}, but must be finite and increasing")
        if self.outside not in OUTSIDE_MODES:
            raise NichechainError(
                f"outside is {self.outside!r}, but must be one of {', '.join(OUTSIDE_MODES)}"
            )

    def __len__(self) -> int:
        """Number of niches; the outside state is not one."""
        return int(np.prod(self.shape))

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

    @property
    def centers(self) -> Floats:
        """Centre of each niche, (n, B), in units of behavior."""
        index = np.stack(np.unravel_index(np.arange(len(self)), self.shape), axis=1)
        centers: Floats = self.lower + (index + 0.5) * (self.upper - self.lower) / np.array(self.shape)
        return centers

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
        points = np.asarray(behavior, np.float64)
        if points.ndim != 2 or points.shape[1] != len(self.shape):
            raise NichechainError(f"behavior has shape {points.shape}, but must be (N, {len(self.shape)})")
        if not np.isfinite(points).all():
            raise NichechainError("behavior has NaN or infinite values, which belong to no niche")
        shape = np.array(self.shape)
        scaled = (shape * (points - self.lower) + _EPSILON) / (self.upper - self.lower)
        index = np.clip(scaled, 0, shape - 1).astype(np.int64)
        flat: Ints = np.ravel_multi_index(tuple(index.T), self.shape).astype(np.int64)
        if self.outside != "clip":
            inside = ((points >= self.lower) & (points <= self.upper)).all(axis=1)
            flat[~inside] = len(self)
        return flat

    def flat(self, niche: Niche) -> int:
        """Flat id of a niche given as flat id or grid index.

        Raises
        ------
        NichechainError
            If it is outside the grid or has the wrong number of axes.
        """
        if isinstance(niche, (int, np.integer)):
            if not 0 <= niche < len(self):
                raise NichechainError(f"niche is {niche}, but the grid has niches 0 to {len(self) - 1}")
            return int(niche)
        try:
            index = tuple(operator.index(k) for k in niche)
        except TypeError:
            raise NichechainError(
                f"niche is {niche!r}, but must be a whole number or one per axis of the grid"
            ) from None
        if len(index) != len(self.shape):
            raise NichechainError(f"niche is {index}, but a niche of this grid has {len(self.shape)} indices")
        for k, size in zip(index, self.shape, strict=True):
            if not 0 <= k < size:
                top = ",".join(str(size - 1) for size in self.shape)
                raise NichechainError(
                    f"niche is {','.join(map(str, index))}, but this grid runs from "
                    f"{','.join('0' for _ in self.shape)} to {top}"
                )
        return int(np.ravel_multi_index(index, self.shape))

    def index(self, flat: int) -> tuple[int, ...]:
        """Grid index of a niche given as flat id."""
        return tuple(int(k) for k in np.unravel_index(self.flat(flat), self.shape))

    def label(self, state: int) -> str:
        """``"7,11"`` for a niche, ``"outside"`` for the outside state."""
        return "outside" if state == len(self) else ",".join(map(str, self.index(state)))

    def as_grid(self, values: ArrayLike) -> NDArray[Any]:
        """Values of all niches (n,) laid out as the grid."""
        array: NDArray[Any] = np.asarray(values)
        return array.reshape(self.shape)


def parse_shape(text: str) -> tuple[int, ...]:
    """``"20x20"`` as ``(20, 20)``.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    try:
        shape = tuple(int(part) for part in text.lower().split("x"))
    except ValueError:
        shape = ()
    if not shape or min(shape) < 1:
        raise NichechainError(
            f"--grid is {text!r}, but must be cells per axis such as 20x20, each at least 1"
        )
    return shape


def parse_bounds(text: str) -> tuple[tuple[float, float], ...]:
    """``"1.05,1.55,0.4,1.1"`` as ``((1.05, 1.55), (0.4, 1.1))``.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    try:
        values: Sequence[float] = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    pairs = tuple(zip(values[::2], values[1::2], strict=False))
    finite = all(np.isfinite(values))
    if not values or len(values) % 2 or not finite or any(low >= high for low, high in pairs):
        raise NichechainError(
            f"--bounds is {text!r}, but must be X0,X1,Y0,Y1 with X0 < X1 and Y0 < Y1, "
            "such as 1.05,1.55,0.4,1.1"
        )
    return pairs


def parse_niche(text: str, option: str) -> tuple[int, ...] | int:
    """``"7,11"`` as ``(7, 11)``, ``"151"`` as ``151``.

    Raises
    ------
    NichechainError
        If the text is no such thing.
    """
    try:
        index = tuple(int(part) for part in text.split(","))
    except ValueError:
        raise NichechainError(
            f"{option} is {text!r}, but must be a grid index such as 7,11 or a niche number such as 151"
        ) from None
    return index if len(index) > 1 else index[0]
