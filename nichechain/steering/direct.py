"""l-evolvability of one genotype while a search goes on: by its own children, and by the chain from there.

Each of U lineages begins with another of the children that a genotype has had. For l = 1 the expected
number of niches is that of rarefaction, and unbiased. For more generations, lineages go on from the
children's niches as the chain of the births so far says: given T, it is unbiased as well.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.core.rarefaction import mean_product, niches_among
from nichechain.niches import Niches
from nichechain.search.selection import Told
from nichechain.steering.evolvable import spread
from nichechain.steering.online import OnlineChain
from nichechain.steering.reach import hits

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_TARGETS = 400
"""Niches that are counted for l above 1, evenly spread over all: what they add up to stands for the rest."""
_DIGITS = 9
"""Decimals of a value: where two are equal, rounding must not decide between them."""


class OffspringCoverage:
    """Expected number of niches that U of a genotype's children land in.

    Parameters
    ----------
    niches : Niches
    lineages : int
        U, at most as many as there are children.
    """

    def __init__(self, niches: Niches, lineages: int) -> None:
        self._niches, self._lineages = len(niches), lineages

    def tell(self, births: Told) -> None:
        """Nothing is remembered."""

    def refresh(self) -> None:
        """Nothing is to be prepared."""

    def __call__(self, children: Ints) -> float:
        """By the states of children (k,); one that failed lands in no niche."""
        return round(niches_among(children, self._niches, self._lineages), _DIGITS)


class OffspringLineages:
    """Expected number of niches that U lineages through different children of a genotype visit.

    The chain is asked whenever its prior is fitted again, see :class:`OnlineChain`.

    Parameters
    ----------
    niches : Niches
    l : int
        Generations of a lineage, the child among them; at least 2.
    lineages : int
        U, at most as many as there are children.
    """

    def __init__(self, niches: Niches, l: int, lineages: int) -> None:
        self._l, self._lineages = l, lineages
        self._chain = OnlineChain(niches)
        self._targets = spread(len(niches), _TARGETS)
        self._weight = len(niches) / self._targets.size
        self._hits = np.zeros((niches.states, self._targets.size))

    def tell(self, births: Told) -> None:
        """What became of some births."""
        self._chain.tell(births)

    def refresh(self) -> None:
        """Ask the chain again, if it has changed by much."""
        if self._chain.births and self._chain.due:
            self._chain.settle()
            self._hits = np.minimum(hits(self._chain, self._targets, self._l - 1), 1.0)

    def __call__(self, children: Ints) -> float:
        """By the states of children (k,); a lineage whose first birth failed visits nothing."""
        missed = np.ones((children.size, self._targets.size))
        born = children != NONE
        missed[born] -= self._hits[children[born]]
        value = float((1.0 - mean_product(missed, self._lineages)).sum()) * self._weight
        return round(value, _DIGITS)
