"""A grid over the behavior space."""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import EPSILON, as_bounds, as_shape, check_choice, check_numbers, shown
from nichechain.core.errors import NichechainError
from nichechain.niches.base import MOST_NICHES, OUTSIDE_MODES, Floats, Ints, Niche, Niches, check_bounds


@dataclass(frozen=True)
class GridNiches(Niches):
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
    epsilon : float
        Added to a scaled coordinate before it is rounded down, as in pyribs, whose archives and these
        niches must put a behavior in the same cell.

    Raises
    ------
    NichechainError
        If the shape and bounds do not fit together or are empty.
    """

    shape: tuple[int, ...]
    bounds: tuple[tuple[float, float], ...]
    outside: str = "state"
    epsilon: float = field(default=EPSILON, repr=False)

    kind: ClassVar[str] = "grid"

    def __post_init__(self) -> None:
        object.__setattr__(self, "shape", as_shape(self.shape))
        object.__setattr__(self, "bounds", as_bounds(self.bounds))
        if not self.shape or min(self.shape) < 1:
            raise NichechainError(f"grid shape is {self.shape}, but every axis needs at least 1 cell")
        if math.prod(self.shape) > MOST_NICHES:
            raise NichechainError(f"grid shape is {self.shape}, but a grid has at most {MOST_NICHES} cells")
        if len(self.shape) != len(self.bounds):
            raise NichechainError(
                f"grid has {len(self.shape)} axes but bounds have {len(self.bounds)}: one pair per axis"
            )
        check_bounds(self.bounds)
        check_choice("outside", self.outside, OUTSIDE_MODES)
        check_numbers(epsilon=self.epsilon)
        if not 0 <= self.epsilon < math.inf:
            raise NichechainError(f"epsilon is {self.epsilon}, but must be finite and not negative")
        object.__setattr__(self, "epsilon", float(self.epsilon))

    def __len__(self) -> int:
        """Number of niches; the outside state is not one."""
        return math.prod(self.shape)

    @property
    def centers(self) -> Floats:
        """Centre of each niche, (n, B), in units of behavior."""
        index = np.stack(np.unravel_index(np.arange(len(self)), self.shape), axis=1)
        centers: Floats = self.lower + (index + 0.5) * (self.upper - self.lower) / np.array(self.shape)
        return centers

    def _nearest(self, points: Floats) -> Ints:
        shape = np.array(self.shape)
        scaled = (shape * (points - self.lower) + self.epsilon) / (self.upper - self.lower)
        index = np.clip(scaled, 0, shape - 1).astype(np.int64)
        flat: Ints = np.ravel_multi_index(tuple(index.T), self.shape).astype(np.int64)
        return flat

    def flat(self, niche: Niche) -> int:
        """Flat id of a niche given as flat id or grid index.

        Raises
        ------
        NichechainError
            If it is outside the grid or has the wrong number of axes.
        """
        # NumPy has spans of time among its integers.
        if isinstance(niche, (int, np.integer)) and not isinstance(niche, np.timedelta64):
            if not 0 <= niche < len(self):
                raise NichechainError(f"niche is {niche}, but the grid has niches 0 to {len(self) - 1}")
            return int(niche)
        try:
            index = tuple(operator.index(k) for k in niche)  # type: ignore[arg-type]  # a text raises
        except TypeError:
            raise NichechainError(
                f"niche is {shown(niche)}, but must be a whole number or one per axis of the grid"
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

    def settings(self) -> dict[str, Any]:
        """What the configuration of a build says of these niches."""
        of_grid = {"shape": self.shape, "bounds": self.bounds, "outside": self.outside}
        return {"niches": self.kind, **of_grid, "epsilon": self.epsilon}

    def as_grid(self, values: ArrayLike) -> NDArray[Any]:
        """Values of all niches (n,) laid out as the grid."""
        array: NDArray[Any] = np.asarray(values)
        if array.shape != (len(self),):
            raise NichechainError(
                f"values have shape {array.shape}, but must be ({len(self)},), one per niche of the grid"
            )
        return array.reshape(self.shape)
