"""Parents by reach: whose descendants would fill niches that nobody has filled yet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.niches import Niches
from nichechain.search.selection import Told
from nichechain.steering.online import OnlineChain

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_REFRESHED = 256
"""Births after which the chain is asked again. Asking at every step made no difference to what was filled."""
_BELIEF = 1.0
"""Niches that an elite must have been expected to find for its own record to count as much as the chain."""
_COLUMNS = 128


class ReachParents:
    """Elites in proportion to the niches not yet filled that lineages from them would visit.

    The chain foretells it for the elite's niche, and the elite's own children correct it: where e of
    them should have been the first in their niche, and f were, the elite gets (f + 1) / (e + 1) times
    the forecast. That is the posterior mean of a factor of its own on a Poisson rate, a priori
    Gamma(1, 1).

    Parameters
    ----------
    niches : Niches
    batch : int
        Births of a step.
    l : int
        Generations of the lineages.
    lineages : int
        How many. For one lineage the cost is that of l products of T with a vector, and a niche that is
        left and entered again counts anew, which takes three generations. For more it is that of l
        products with a column for each niche that is not filled.
    """

    def __init__(self, niches: Niches, batch: int, l: int = 1, lineages: int = 1) -> None:
        self._l, self._lineages = l, lineages
        self._every = max(1, _REFRESHED // batch)
        self._chain = OnlineChain(niches)
        self._filled = np.zeros(niches.states, bool)
        # Outside is no niche that could be filled.
        self._filled[len(niches) :] = True
        self._forecast: Floats | None = None
        self._next: Floats = np.zeros(niches.states)
        # Of each parent, by its number.
        self._expected: Floats = np.zeros(0)
        self._found: Floats = np.zeros(0)

    def tell(self, births: Told) -> None:
        """What became of some births."""
        self._chain.tell(births)
        landed = np.flatnonzero(births.child_niche != NONE)
        niches, first = np.unique(births.child_niche[landed], return_index=True)
        new = np.zeros(len(births), bool)
        new[landed[first]] = ~self._filled[niches]
        self._filled[niches] = True
        born = births.parent_uid != NONE
        parent = births.parent_uid[born]
        self._grow(parent.max(initial=-1) + 1)
        np.add.at(self._expected, parent, self._next[births.parent_niche[born]])
        np.add.at(self._found, parent, new[born])

    def begin(self, step: int) -> None:
        """Ask the chain again, if it is time to."""
        if not self._chain.births or (self._forecast is not None and step % self._every):
            return
        self._chain.settle()
        open_ = (~self._filled).astype(np.float64)
        self._next = self._chain @ open_
        if self._lineages == 1:
            self._forecast = one_lineage(self._chain, open_, self._next, self._l)
        else:
            self._forecast = many_lineages(self._chain, np.flatnonzero(open_), self._l, self._lineages)

    def weights(self, niche: Ints, uid: Ints) -> Floats | None:
        """Weight of each of some elites, (K,); None before there are births, and once all is filled."""
        if self._forecast is None:
            return None
        self._grow(uid.max(initial=-1) + 1)
        weights = self._forecast[niche] * (self._found[uid] + _BELIEF) / (self._expected[uid] + _BELIEF)
        return weights if weights.max() > 0.0 else None

    def _grow(self, parents: int) -> None:
        """Room for parents of numbers below that."""
        missing = parents - self._found.size
        if missing > 0:
            # By half at least, so that it is seldom.
            more = np.zeros(missing + self._found.size // 2)
            self._found, self._expected = (np.append(old, more) for old in (self._found, self._expected))


def one_lineage(chain: OnlineChain, open_: Floats, entered: Floats, l: int) -> Floats:
    """Niches not yet filled that a lineage from each state enters in l generations, in expectation, (S,).

    Parameters
    ----------
    chain : OnlineChain
    open_ : (S,) float64 array
        1 for niches that are not filled, 0 for other states.
    entered : (S,) float64 array
        T · open_.
    l : int

    Notes
    -----
    Σ_k T^k (T u − diag(T) u) for k = 0 ... l − 1, with u = open_: a child in its parent's niche does not
    enter it. Of niches that nobody was born in, T_jj is what the base says.
    """
    if l == 1:
        return entered
    steps = np.maximum(entered - open_ * chain.staying(), 0.0)
    whole = steps.copy()
    for _ in range(l - 1):
        steps = chain @ steps
        whole += steps
    return whole


def many_lineages(chain: OnlineChain, targets: Ints, l: int, lineages: int) -> Floats:
    """Σ_j 1 − (1 − h_j)^lineages over some niches j, for lineages from each state, (S,).

    Parameters
    ----------
    chain : OnlineChain
    targets : (c,) int64 array
    l, lineages : int
    """
    whole = np.zeros(chain.niches.states)
    for start in range(0, targets.size, _COLUMNS):
        some = targets[start : start + _COLUMNS]
        visit = np.minimum(chain @ hits(chain, some, l - 1), 1.0)
        with np.errstate(divide="ignore"):
            whole += -np.expm1(lineages * np.log1p(-visit)).sum(axis=1)
    return whole


def hits(chain: OnlineChain, targets: Ints, steps: int) -> Floats:
    """Probability that a lineage stands on each of some niches, or enters it within so many steps, (S, c).

    Parameters
    ----------
    chain : OnlineChain
    targets : (c,) int64 array
    steps : int
    """
    on_target = targets, np.arange(targets.size)
    visit = np.zeros((chain.niches.states, targets.size))
    visit[on_target] = 1.0
    for _ in range(steps):
        visit = chain @ visit
        # A lineage that stands on its target has visited it, wherever it goes next.
        visit[on_target] = 1.0
    return visit
