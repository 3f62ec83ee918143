"""Direct search for evolvability: who of two genotypes keeps a niche is decided by their own offspring.

A genotype's l-evolvability is not known at its birth: it takes children to see it. So a birth in a niche
that has an elite already *contests* it. Both then get children until each has had as many as are asked
for, and the one of more l-evolvability stays. What children an elite has had as a parent count, now and
in every contest to come, so a lucky first sample does not keep a niche for long.

Every birth is offered to the grid, those that are made to judge others too, by these rules:

- One in an empty niche becomes its elite. It is judged only if somebody contests the niche.
- One in a filled niche contests it if its parent was drawn for it, or it has none. A birth that is made to
  judge its parent does not, since to judge it would take as many births again, and so on; nor does a
  birth of an unselected lineage.
- A niche is contested by one birth at a time. Others that are born there meanwhile are passed over.
- The births of a step are first those that judge, the oldest contest first, and then children of elites
  that are drawn as in any search. Contests end before the next step draws its parents.

All this follows from births and the number of their step, as what a selection of parents remembers does.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain, repeat
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.core.columns import Columnar
from nichechain.search.elites import SearchState
from nichechain.search.lineages import Stretch
from nichechain.search.selection import Told

Ints = NDArray[np.int64]

UNJUDGED = -1.0
"""Key of an elite that nobody has contested yet: below all that judged ones can have."""


class Judge(Protocol):
    """What the l-evolvability of a genotype is, by its children and the births so far."""

    def tell(self, births: Told) -> None:
        """What became of some births."""
        ...

    def refresh(self) -> None:
        """Genotypes are judged next."""
        ...

    def __call__(self, children: Ints) -> float:
        """Expected number of niches, from the states of children (k,), ``NONE`` where one failed."""
        ...


@dataclass(frozen=True)
class Settled(Columnar):
    """Contests that ended.

    Parameters
    ----------
    niche, uid : (K,) int64 arrays
        Who keeps or gets the niche.
    value : (K,) float64 array
        Its l-evolvability.
    """

    niche: Ints
    uid: Ints
    value: NDArray[np.float64]


@dataclass(frozen=True)
class Due(Columnar):
    """Births of a step that judge their parents.

    Parameters
    ----------
    place : (k,) int64 array
        Which of the step's births they are.
    niche, parent : (k,) int64 arrays
        The contested niche, and the uid of the elite or contender.
    """

    place: Ints
    niche: Ints
    parent: Ints


class Contests:
    """The contests of a search.

    Parameters
    ----------
    stretch : Stretch
        Steps of the search: births of lineages judge nobody.
    states : int
        Those below it can be contested.
    offspring : int
        Children by which a genotype is judged.
    judge : Judge

    Attributes
    ----------
    due : Due
        Births of the present step that judge.
    """

    def __init__(self, stretch: Stretch, states: int, offspring: int, judge: Judge) -> None:
        self._stretch = stretch
        self._states = states
        self._offspring = offspring
        self._judge = judge
        self._elite: dict[int, int] = {}
        # By niche, the oldest contest first.
        self._contender: dict[int, int] = {}
        # Of elites and contenders, where their children landed.
        self._children: dict[int, list[int]] = {}
        self._judging: frozenset[int] = frozenset()
        nobody = np.empty(0, np.int64)
        self.due = Due(nobody, nobody, nobody)

    def tell(self, births: Told) -> None:
        """What became of some births."""
        self.hear(births)

    def hear(self, births: Told) -> Ints:
        """What became of some births; which rows of them contest a niche from now on, (k,)."""
        self._judge.tell(births)
        contend = []
        columns = (births.uid, births.parent_uid, births.child_niche, births.lineage)
        for row, (uid, parent, niche, lineage) in enumerate(zip(*(c.tolist() for c in columns), strict=True)):
            if parent in self._children:
                self._children[parent].append(niche)
            if niche == NONE:
                continue
            if niche not in self._elite:
                self._elite[niche] = uid
            elif (
                niche < self._states
                and niche not in self._contender
                and not lineage
                and uid not in self._judging
            ):
                self._contender[niche] = uid
                contend.append(row)
            else:
                continue
            self._children[uid] = []
        return np.array(contend, np.int64)

    def agree(self, state: SearchState) -> bool:
        """Whether elites and contenders of a search are those that its births, all told, have led to."""
        if not len(state.pending):
            self.settle()
        held, contested = (
            dict(zip(rows.niche.tolist(), rows.uid.tolist(), strict=True))
            for rows in (state.elites, state.contenders)
        )
        return self._elite == held and self._contender == contested

    def settle(self) -> Settled:
        """End the contests of which both sides have had their children, all births of a step being told."""
        self._judge.refresh()
        ready = {
            niche: uid
            for niche, uid in self._contender.items()
            if not (self._missing(uid) or self._missing(self._elite[niche]))
        }
        ended = [self._settle(niche, uid) for niche, uid in ready.items()]
        niche, uid, value = zip(*ended, strict=True) if ended else ((), (), ())
        return Settled(np.array(niche, np.int64), np.array(uid, np.int64), np.array(value))

    def begin(self, step: int) -> None:
        """Say who gets children in a step; whoever retraces births settles here what was settled then."""
        self.settle()
        free = np.flatnonzero(self._stretch.slots(step)[0] == NONE)
        asked = chain.from_iterable(
            repeat((niche, uid), self._missing(uid))
            for niche, contender in self._contender.items()
            for uid in (self._elite[niche], contender)
        )
        due = [(place, *one) for place, one in zip(free.tolist(), asked, strict=False)]
        self.due = Due(*np.array(due, np.int64).reshape(-1, 3).T)
        self._judging = frozenset((self._stretch.uid(step) + self.due.place).tolist())

    def _missing(self, uid: int) -> int:
        """Children that a genotype still has to have."""
        return max(0, self._offspring - len(self._children[uid]))

    def _settle(self, niche: int, contender: int) -> tuple[int, int, float]:
        """Niche, winner and its value; of equals, the elite stays."""
        elite = self._elite[niche]
        value, other = (self._judge(np.array(self._children[uid])) for uid in (elite, contender))
        loser = contender
        if other > value:
            value, loser = other, elite
            self._elite[niche] = contender
        del self._contender[niche]
        del self._children[loser]
        return niche, self._elite[niche], value
