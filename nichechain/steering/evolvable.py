"""Parents by l-evolvability: whose descendants would visit many niches, filled or not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nichechain.niches import Niches
from nichechain.search.selection import Told
from nichechain.steering.online import OnlineChain
from nichechain.steering.reach import many_lineages

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_TARGETS = 200
"""Niches that l-evolvability counts here, evenly spread over all: it only has to tell elites apart."""


class EvolvableParents:
    """Elites in proportion to the l-evolvability of their niche, by the chain of the births so far.

    It is computed whenever the chain's prior is fitted again, see :class:`OnlineChain`.

    Parameters
    ----------
    niches : Niches
    l, lineages : int
    """

    def __init__(self, niches: Niches, l: int, lineages: int) -> None:
        self._l, self._lineages = l, lineages
        self._chain = OnlineChain(niches)
        self._targets = spread(len(niches), _TARGETS)
        self._values: Floats | None = None

    def tell(self, births: Told) -> None:
        """What became of some births."""
        self._chain.tell(births)

    def begin(self, step: int) -> None:  # noqa: ARG002
        """Compute l-evolvability again, if the chain has changed by much."""
        if self._chain.births and self._chain.due:
            self._chain.settle()
            self._values = many_lineages(self._chain, self._targets, self._l, self._lineages)

    def weights(self, niche: Ints, uid: Ints) -> Floats | None:  # noqa: ARG002
        """Weight of each of some elites, (K,); None before there are births."""
        return None if self._values is None else self._values[niche]


def spread(niches: int, number: int) -> Ints:
    """At most so many niches, evenly spread over all."""
    return np.unique(np.linspace(0, niches - 1, min(number, niches)).astype(np.int64))
