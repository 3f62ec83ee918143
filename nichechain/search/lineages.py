"""Unselected lineages among the births of a search.

A search draws its parents from the elites. So it hardly ever makes a parent of what lineages mostly are:
late births in the niches that lineages fall into and stay in. To see what those do, a share of the
births has another parent: the latest birth of a lineage, elite or not, whatever became of it.

A lineage begins at an elite that is drawn as all parents are. Its first birth is therefore a birth like
any; those after it are flagged in the column ``lineage`` of the births. After some generations, or where
a birth can be nobody's parent because it failed or because outside is never left, the next lineage
begins in its place. A birth of a lineage enters the archive by the rule that all births enter by.

Which births of a step belong to which lineage follows from the number of the step alone, so there is
nothing to draw, and nothing to remember but the latest birth of each lineage under way.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.core.columns import Columnar
from nichechain.search.config import BuildConfig

Ints = NDArray[np.int64]

_DIGITS = 9
"""Decimals of a share of a batch: 7 % of 100 are 7, not 7.000000000000001."""


@dataclass(frozen=True)
class UnderWay(Columnar):
    """The latest birth of each lineage under way.

    Parameters
    ----------
    slot : (K,) int64 array
        Sorted: lineages take turns, and one follows another in its slot.
    genotype : (K, P) float32 array
    uid, niche, depth : (K,) int64 arrays
    """

    slot: Ints
    genotype: NDArray[np.float32]
    uid: Ints
    niche: Ints
    depth: Ints

    @classmethod
    def none(cls, length: int) -> UnderWay:
        """No lineage, of genotypes of that length."""
        none = np.empty(0, np.int64)
        return cls(none, np.empty((0, length), np.float32), none, none, none)

    def rows(self, slot: Ints) -> Ints:
        """Row of each of some slots, ``NONE`` where no lineage is under way."""
        if not len(self):
            return np.full(len(slot), NONE, np.int64)
        at = np.minimum(np.searchsorted(self.slot, slot), len(self) - 1)
        return np.where(self.slot[at] == slot, at, NONE)

    def after(self, births: UnderWay, ended: Ints) -> UnderWay:
        """The lineages after these births in their slots, and after those in ``ended`` came to nothing."""
        kept = ~np.isin(self.slot, np.concatenate([births.slot, ended]))
        both = UnderWay.concatenate([self[kept], births])
        return both[np.argsort(both.slot)]


@dataclass(frozen=True)
class Stretch:
    """Steps of a search that are alike, and which of their births are of lineages.

    Parameters
    ----------
    first_step, first_uid : int
        Where they begin.
    batch : int
        Births of a step.
    share : float
        How many of them are of lineages, from 0 to 1: the last ones of each step.
    length : int
        Births of a lineage, the first among them.
    """

    first_step: int
    first_uid: int
    batch: int
    share: float
    length: int

    @classmethod
    def of_build(cls, config: BuildConfig) -> Stretch:
        """All steps of a build but that of the initial births."""
        return cls(1, config.initial, config.batch, config.lineage_share, config.lineage_length)

    def uid(self, step: int) -> int:
        """Number of the first birth of a step."""
        return self.first_uid + (step - self.first_step) * self.batch

    def slots(self, step: int) -> tuple[Ints, NDArray[np.bool_]]:
        """The slot of each birth of a step, and whether a lineage goes on there if one is under way.

        Returns
        -------
        (batch,) int64 array
            ``NONE`` for births that are of no lineage.
        (batch,) bool array
        """
        slot = np.full(self.batch, NONE, np.int64)
        goes_on = np.zeros(self.batch, bool)
        due = round(self.share * self.batch, _DIGITS)
        turn = step - self.first_step
        number = np.arange(int(due * turn), int(due * (turn + 1)))
        if number.size:
            slots = ceil(due)
            slot[-number.size :] = number % slots
            goes_on[-number.size :] = number // slots % self.length > 0
        return slot, goes_on


@dataclass(frozen=True)
class Calibration:
    """Lineage births that were added to a finished build, see :mod:`nichechain.archive.calibrating`.

    Parameters
    ----------
    first_step, first_uid : int
        Where they begin.
    births : int
        How many were asked for.
    """

    first_step: int
    first_uid: int
    births: int

    @property
    def end(self) -> int:
        """Births of the run once it is done."""
        return self.first_uid + self.births

    def stretch(self, config: BuildConfig) -> Stretch:
        """Its steps: at most a batch of lineages side by side, and none cut short that need not be."""
        length = config.lineage_length
        lineages = ceil(self.births / length)
        batch = ceil(lineages / ceil(lineages / config.batch))
        return Stretch(self.first_step, self.first_uid, batch, 1.0, length)
