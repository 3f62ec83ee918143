"""Parents by information: where one more birth would narrow l-evolvability most."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nichechain.niches import Niches
from nichechain.search.selection import Told
from nichechain.steering.evolvable import spread
from nichechain.steering.online import OnlineChain

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_TARGETS = 64
"""Niches that l-evolvability counts here, evenly spread over all: it only has to tell rows of T apart."""


class InformedParents:
    """Elites in proportion to how much a birth more of their niche is expected to narrow l-evolvability.

    What is to be narrowed is the variance of the mean l-evolvability of all niches that were born in. It
    is computed whenever the chain's prior is fitted again, see :class:`OnlineChain`; in between, births
    lower what those of their niche can still tell.

    Parameters
    ----------
    niches : Niches
    l, lineages : int

    Notes
    -----
    As :func:`nichechain.evolvability.where_to_sample.where_to_sample`: with g the derivative of
    l-evolvability by row i of T and α the row's births, those that the prior is worth among them, the row
    contributes Var(g) / (α + 1), of which one birth with a design effect of e takes away 1 / (1 + e α).
    """

    def __init__(self, niches: Niches, l: int, lineages: int) -> None:
        self._l, self._lineages = l, lineages
        self._chain = OnlineChain(niches)
        self._targets = spread(len(niches), _TARGETS)
        self._born = np.zeros(niches.states, bool)
        self._spread: Floats | None = None
        self._narrowing: Floats | None = None

    def tell(self, births: Told) -> None:
        """What became of some births."""
        self._chain.tell(births)
        self._born[births.child_niche[births.child_niche >= 0]] = True

    def begin(self, step: int) -> None:  # noqa: ARG002
        """Take in births; compute derivatives again, if the chain has changed by much."""
        if not self._chain.births:
            return
        if self._chain.settle():
            roots = np.flatnonzero(self._born[: len(self._chain.niches)])
            self._spread = derivative_spread(self._chain, self._targets, roots, self._l, self._lineages)
        assert self._spread is not None
        total = self._chain.total
        self._narrowing = self._spread / (total + 1.0) / (1.0 + self._chain.design_effect * total)

    def weights(self, niche: Ints, uid: Ints) -> Floats | None:  # noqa: ARG002
        """Weight of each of some elites, (K,); None before there are births, and where all is known."""
        if self._narrowing is None:
            return None
        weights = self._narrowing[niche]
        return weights if weights.max() > 0.0 else None


def derivative_spread(chain: OnlineChain, targets: Ints, roots: Ints, l: int, lineages: int) -> Floats:
    """Variance over where a child lands of the derivative of l-evolvability by each row of T, (S,).

    Parameters
    ----------
    chain : OnlineChain
    targets : (c,) int64 array
        Niches that count.
    roots : (m,) int64 array
        Whose l-evolvability is averaged.
    l, lineages : int

    Notes
    -----
    The adjoint of H_k = T · H_{k−1} with ones on the targets, run backwards for all targets at once.
    Memory and time are those of dense (S, S) matrices, once for each fit.
    """
    states = chain.niches.states
    on_target = targets, np.arange(targets.size)
    hits = [np.zeros((states, targets.size))]
    hits[0][on_target] = 1.0
    for _ in range(l - 1):
        onward = chain @ hits[-1]
        onward[on_target] = 1.0
        hits.append(onward)
    visit = np.minimum(chain @ hits[-1], 1.0)
    weight = np.zeros(states)
    weight[roots] = 1.0 / max(1, roots.size)
    pull = weight[:, None] * lineages * (1.0 - visit) ** (lineages - 1)
    slope = pull @ hits[-1].T
    for earlier in reversed(hits[:-1]):
        pull = chain.backwards(pull)
        # Whatever T says, a lineage on its target has visited it.
        pull[on_target] = 0.0
        slope += pull @ earlier.T
    rows = chain @ np.eye(states)
    mean = (rows * slope).sum(axis=1)
    spread_: Floats = np.maximum((rows * slope**2).sum(axis=1) - mean**2, 0.0)
    return spread_
