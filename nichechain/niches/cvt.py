"""A centroidal Voronoi tessellation of the behavior space."""

from __future__ import annotations

import operator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from nichechain.core.checks import as_bounds, as_floats, check_choice, check_whole, shown
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.niches.base import (
    MOST_NICHES,
    OUTSIDE_MODES,
    Bounds,
    Floats,
    Ints,
    Niche,
    Niches,
    check_bounds,
    is_inside,
)

if TYPE_CHECKING:
    from scipy.spatial import KDTree

# Uniform samples that stand for the box, for each niche and at least.
_SAMPLES_EACH = 100
_FEWEST_SAMPLES = 10_000
_MOST_ROUNDS = 30
# Rounds end when no centroid moves by more than this part of a niche's width.
_SETTLED = 1e-3
# Squares of coordinates beyond this would not be finite.
_FARTHEST = 1e150


@dataclass(frozen=True, eq=False, repr=False)
class CVTNiches(Niches):
    """Niches around centroids: a behavior belongs to the nearest one (Vassiliades et al. 2018).

    Their number does not depend on the number of axes, where a grid's is exponential in it.

    Parameters
    ----------
    centroids : (n, B) array
        In units of behavior, in which distances are Euclidean, as in pyribs; all different and
        within the bounds.
    bounds : tuple of (float, float)
        Lower and upper bound of each axis. Both ends belong to the box.
    outside : {"state", "absorb", "clip"}
        What a behavior out of bounds belongs to. ``state``: a state of its own, numbered last,
        whose elite can be a parent. ``absorb``: a state that no lineage leaves. ``clip``: the
        niche of the nearest centroid, as in pyribs.

    Raises
    ------
    NichechainError
        If centroids and bounds do not fit together or are empty, or two centroids are the same.
    """

    centroids: Floats
    bounds: Bounds
    outside: str = "state"

    kind: ClassVar[str] = "cvt"

    def __post_init__(self) -> None:
        object.__setattr__(self, "bounds", as_bounds(self.bounds))
        check_bounds(self.bounds)
        check_choice("outside", self.outside, OUTSIDE_MODES)
        centroids = as_floats("centroids", self.centroids).copy()
        if centroids.ndim != 2 or not centroids.size or centroids.shape[1] != len(self.bounds):
            raise NichechainError(
                f"centroids have shape {centroids.shape}, but must be (n, {len(self.bounds)})"
            )
        odd = ~is_inside(centroids, self.bounds)
        if odd.any():
            place = ", ".join(f"{x:g}" for x in centroids[np.argmax(odd)])
            raise NichechainError(f"centroid {np.argmax(odd)} is at {place}, which is out of bounds")
        if len(np.unique(centroids, axis=0)) < len(centroids):
            raise NichechainError("two centroids are the same, so that a niche would be empty")
        centroids.setflags(write=False)
        object.__setattr__(self, "centroids", centroids)

    @classmethod
    def tessellated(cls, number: int, bounds: Bounds, *, seed: int = 0, outside: str = "state") -> CVTNiches:
        """Niches of about equal volume that fill the box.

        Parameters
        ----------
        number : int
            Niches, at least 1.
        bounds : tuple of (float, float)
        seed : int
            Of the samples, not negative.
        outside : {"state", "absorb", "clip"}

        Raises
        ------
        NichechainError
            If a value is out of range.

        Notes
        -----
        Lloyd's k-means on uniform samples of the box, a hundred for each niche. Every sum is made
        in one order, so that neither threads nor libraries that share them change the centroids.
        """
        check_whole(niches=number)
        if not 1 <= number <= MOST_NICHES:
            raise NichechainError(f"niches are {number}, but must be from 1 to {MOST_NICHES}")
        number, bounds = int(number), as_bounds(bounds)
        check_bounds(bounds)
        return cls(_lloyd(number, np.array(bounds, np.float64), seed), bounds, outside)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, CVTNiches):
            return NotImplemented
        same = (self.bounds, self.outside) == (other.bounds, other.outside)
        return same and np.array_equal(self.centroids, other.centroids)

    def __hash__(self) -> int:
        return hash((self.bounds, self.outside, self.centroids.tobytes()))

    def __repr__(self) -> str:
        return f"CVTNiches({len(self)} centroids, bounds={self.bounds}, outside={self.outside!r})"

    def __len__(self) -> int:
        """Number of niches; the outside state is not one."""
        return len(self.centroids)

    @property
    def centers(self) -> Floats:
        """Centroid of each niche, (n, B), in units of behavior."""
        return self.centroids

    @cached_property
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(self.centroids)

    def _nearest(self, points: Floats) -> Ints:
        _, nearest = self._tree.query(np.clip(points, -_FARTHEST, _FARTHEST))
        state: Ints = nearest.astype(np.int64)
        return state

    def flat(self, niche: Niche) -> int:
        """Number of a niche, given as it is or as a tuple of one.

        Raises
        ------
        NichechainError
            If there is no such niche.
        """
        given = niche[0] if isinstance(niche, tuple) and len(niche) == 1 else niche
        try:
            number = operator.index(given)  # type: ignore[arg-type]
        except TypeError:
            raise NichechainError(
                f"niche is {shown(niche)}, but niches of a tessellation have one number each, such as 17"
            ) from None
        if not 0 <= number < len(self):
            raise NichechainError(f"niche is {number}, but there are niches 0 to {len(self) - 1}")
        return number

    def index(self, flat: int) -> tuple[int, ...]:
        """The number of a niche as a tuple of one."""
        return (self.flat(flat),)

    def settings(self) -> dict[str, Any]:
        """What the configuration of a build says of these niches, but for their seed."""
        return {"niches": self.kind, "shape": (len(self),), "bounds": self.bounds, "outside": self.outside}


def _lloyd(number: int, bounds: Floats, seed: int) -> Floats:
    """Centroids of uniform samples, (number, B)."""
    from scipy.spatial import KDTree

    lower, upper = bounds.T
    size = max(_FEWEST_SAMPLES, _SAMPLES_EACH * number)
    samples = keyed(seed, Purpose.TESSELLATION).uniform(lower, upper, (size, len(bounds)))
    width = float(np.prod((upper - lower) ** (1.0 / len(bounds)))) / number ** (1.0 / len(bounds))
    centroids = samples[:number].copy()
    for _ in range(_MOST_ROUNDS):
        _, nearest = KDTree(centroids).query(samples)
        held = np.bincount(nearest, minlength=number)
        sums = np.stack([np.bincount(nearest, axis, number) for axis in samples.T], axis=1)
        # A centroid that no sample is nearest to stays where it is.
        moved = np.where(held[:, None] > 0, sums / np.maximum(1, held)[:, None], centroids)
        step = float(np.abs(moved - centroids).max())
        centroids = moved
        if step <= _SETTLED * width:
            break
    return centroids
