"""Who becomes a parent: what a selection of parents is, mixtures of several, and how they are asked for.

A selection remembers what it has to from births alone: it is told of every birth, in their order, and
before each step that draws parents. So a search that goes on from its births draws the parents of one that
never stopped, and a verification can draw them once more. ``uniform`` and ``curiosity`` are in this room,
those that ask the chain in :mod:`nichechain.steering`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.core.columns import Columnar

if TYPE_CHECKING:
    import pyarrow as pa

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Told(Columnar):
    """What a selection is told of some births, in their order.

    Parameters
    ----------
    parent_uid, parent_niche : (N,) int64 arrays
        ``NONE`` for initial births.
    child_niche : (N,) int64 array
        ``NONE`` where the evaluation failed.
    accepted : (N,) bool array
        Whether the child became its niche's elite, see :mod:`nichechain.births.table`.
    step, uid : (N,) int64 arrays
    lineage : (N,) bool array
        Whose parent is the latest birth of a lineage.
    """

    parent_uid: Ints
    parent_niche: Ints
    child_niche: Ints
    accepted: Bools
    step: Ints
    uid: Ints
    lineage: Bools

    @classmethod
    def of(cls, births: pa.Table) -> Told:
        """Of rows of a table of births."""
        parent, niche, child, step, uid = (
            births[name].fill_null(NONE).to_numpy().astype(np.int64)
            for name in ("parent_uid", "parent_niche", "child_niche", "step", "uid")
        )
        accepted, lineage = (births[name].to_numpy(zero_copy_only=False) for name in ("accepted", "lineage"))
        return cls(parent, niche, child, accepted, step, uid, lineage)


class Listener(Protocol):
    """Who is told of every birth, in their order, and of every step that draws parents."""

    def tell(self, births: Told) -> None:
        """What became of some births."""
        ...

    def begin(self, step: int) -> None:
        """All births before a step have been told, and its parents are drawn next."""
        ...


class ParentSelection(Listener, Protocol):
    """How likely each elite is to become a parent, by what births have shown so far."""

    def weights(self, niche: Ints, uid: Ints) -> Floats | None:
        """Weight of each of some elites, (K,), not negative.

        Parameters
        ----------
        niche, uid : (K,) int64 arrays

        Returns
        -------
        (K,) float64 array or None
            Elites are drawn in proportion to it. None, for all alike, where nothing tells them apart.
        """
        ...


class UniformParents:
    """Each elite alike."""

    def tell(self, births: Told) -> None:
        """Nothing is remembered."""

    def begin(self, step: int) -> None:
        """Nothing is to be prepared."""

    def weights(self, niche: Ints, uid: Ints) -> Floats | None:  # noqa: ARG002
        """None: all alike."""
        return None


@dataclass(frozen=True)
class Tempered:
    """A selection whose weights w become w^(1/τ): the lower τ, the more the largest get.

    Parameters
    ----------
    selection : ParentSelection
    temperature : float
        τ, above 0; 1 changes nothing.
    """

    selection: ParentSelection
    temperature: float

    def tell(self, births: Told) -> None:
        """What became of some births."""
        self.selection.tell(births)

    def begin(self, step: int) -> None:
        """A step is about to draw its parents."""
        self.selection.begin(step)

    def weights(self, niche: Ints, uid: Ints) -> Floats | None:
        """Weight of each of some elites, (K,), the largest being 1; None for all alike."""
        weights = self.selection.weights(niche, uid)
        if weights is None or self.temperature == 1.0:
            return weights
        tempered: Floats = (weights / weights.max()) ** (1.0 / self.temperature)
        return tempered


@dataclass(frozen=True)
class Mixture:
    """Each parent is drawn by one of several selections, chosen by their shares.

    Parameters
    ----------
    selections : sequence of ParentSelection
    shares : sequence of float
        They sum to 1.
    """

    selections: Sequence[ParentSelection]
    shares: Sequence[float]

    def tell(self, births: Told) -> None:
        """What became of some births."""
        for selection in self.selections:
            selection.tell(births)

    def begin(self, step: int) -> None:
        """A step is about to draw its parents."""
        for selection in self.selections:
            selection.begin(step)

    def weights(self, niche: Ints, uid: Ints) -> Floats | None:
        """Probability of each of some elites, (K,); None for all alike."""
        mixed = np.zeros(niche.size)
        told = False
        for selection, share in zip(self.selections, self.shares, strict=True):
            weights = selection.weights(niche, uid)
            told |= weights is not None
            mixed += share / niche.size if weights is None else share * (weights / weights.sum())
        return mixed if told else None


def draw_parents(weights: Floats | None, elites: int, size: int, rng: np.random.Generator) -> Ints:
    """Rows of elites, drawn with replacement.

    Parameters
    ----------
    weights : (elites,) float64 array, optional
        None draws each alike.
    elites, size : int
        How many there are, and how many are drawn.
    rng : numpy.random.Generator
    """
    if weights is None:
        return rng.integers(elites, size=size)
    return rng.choice(elites, size=size, p=weights / weights.sum())


def retrace(listener: Listener, births: Told) -> None:
    """Tell a new selection, or contests, of the births of a search so far, as the search would have.

    Parameters
    ----------
    listener : Listener
    births : Told
        In their order; the last step need not be whole.
    """
    first = np.flatnonzero(np.diff(births.step, prepend=-1))
    for start, end in pairwise([*first.tolist(), len(births)]):
        step = int(births.step[start])
        # Initial births have no parents to be drawn.
        if step:
            listener.begin(step)
        listener.tell(births[start:end])
