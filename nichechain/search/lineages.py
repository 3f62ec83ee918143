"""Unselected lineages among the births of a search.

A search draws its parents from the elites. So it hardly ever makes a parent of what lineages mostly are:
late births in the niches that lineages fall into and stay in. To see what those do, a share of the
births has another parent: the latest birth of a lineage, elite or not, whatever became of it.

A lineage begins at an elite that is drawn as all parents are. Its first birth is therefore a birth like
any; those after it are flagged in the column ``lineage`` of the births. After some generations, or where
a birth can be nobody's parent because it failed or because outside is never left, the next lineage
begins in its place. A birth of a lineage enters the archive by the rule that all births enter by.

Lineages come in broods, of several that begin at the same elite in the same step and go on side by side.
So births show not only where lineages go, but how much those of one elite have in common: how many niches
they reach together depends on both.

Which births of a step belong to which lineage follows from the number of the step alone, so there is
nothing to draw, and nothing to remember but the latest birth of each lineage under way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
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
    brood : int
        Lineages that begin at the same elite, if so many fit in a step: their births of a generation
        are in one step.
    """

    first_step: int
    first_uid: int
    batch: int
    share: float
    length: int
    brood: int

    @classmethod
    def of_build(cls, config: BuildConfig) -> Stretch:
        """All steps of a build but that of the initial births."""
        return cls(
            1,
            config.initial,
            config.batch,
            config.lineage_share,
            config.lineage_length,
            config.lineage_brood,
        )

    def uid(self, step: int) -> int:
        """Number of the first birth of a step."""
        return self.first_uid + (step - self.first_step) * self.batch

    def uids(self, step: int) -> tuple[int, int]:
        """Number of the first birth of a step, and the number after that of its last.

        Step 0 of a build has its initial births.
        """
        return 0 if step == 0 else self.uid(step), self.uid(step + 1)

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
        size, due = self._broods
        turn = step - self.first_step
        # A generation of a brood has one number, and broods take turns.
        number = np.arange(int(due * turn), int(due * (turn + 1)))
        if number.size:
            sets = ceil(due)
            own = number.size * size
            slot[-own:] = np.add.outer(number % sets * size, np.arange(size)).ravel()
            goes_on[-own:] = np.repeat(number // sets % self.length > 0, size)
        return slot, goes_on

    def drawing(self, step: int) -> Ints:
        """Which birth of a step draws the elite that each begins at: where a brood begins, its first.

        Returns
        -------
        (batch,) int64 array
            Places within the step.
        """
        slot, goes_on = self.slots(step)
        place = np.arange(self.batch)
        return np.where((slot == NONE) | goes_on, place, place - slot % self._broods[0])

    @cached_property
    def _broods(self) -> tuple[int, float]:
        """Lineages of a brood, and of how many broods a step has a generation, on average.

        Broods are smaller than asked for where so many whole ones do not fit in a step.
        """
        for size in range(min(self.brood, self.batch), 1, -1):
            due = round(self.share * self.batch / size, _DIGITS)
            if ceil(due) * size <= self.batch:
                return size, due
        return 1, round(self.share * self.batch, _DIGITS)


@dataclass(frozen=True)
class Calibration:
    """Lineage births that were added to a finished build, see :mod:`nichechain.archive.calibrating`.

    Parameters
    ----------
    first_step, first_uid : int
        Where they begin.
    births : int
        How many were asked for.
    brood : int
        Lineages that begin at the same elite, or fewer where so many do not fit.
    """

    first_step: int
    first_uid: int
    births: int
    brood: int

    @property
    def end(self) -> int:
        """Births of the run once it is done."""
        return self.first_uid + self.births

    def stretch(self, config: BuildConfig) -> Stretch:
        """Its steps: broods side by side, at most a batch, and no lineage cut short that need not be."""
        length = config.lineage_length
        lineages = ceil(self.births / length)
        largest = min(self.brood, config.batch)
        broods = ceil(lineages / largest)
        rounds = ceil(broods / (config.batch // largest))
        abreast = ceil(broods / rounds)
        # Where lineages do not make whole broods, all are a little smaller rather than one the rest.
        brood = ceil(lineages / (rounds * abreast))
        return Stretch(self.first_step, self.first_uid, abreast * brood, 1.0, length, brood)
