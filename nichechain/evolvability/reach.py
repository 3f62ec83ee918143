"""Which niches descendants of one root reach: a map behind the number that is l-evolvability."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain, Transition
from nichechain.chain.operator import PooledTransition
from nichechain.core.intervals import drawn_interval, no_interval
from nichechain.evolvability.coverage import at_least_once, visit_probabilities
from nichechain.evolvability.question import DRAWS, Convention, Question, Root
from nichechain.evolvability.urn_reach import simulated_reach
from nichechain.niches import Niche

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]

# Share of possible transitions from which on walks of a few steps see most states.
_DENSE = 0.05
# Longer walks are not kept step by step, and end where no probability changes by more than rounding.
_LONGEST, _SETTLED, _NOTHING = 1_000, 1e-14, 1e-13

MOST_POWERS = 12
"""Steps up to which returns in a matrix that is not sparse are those of its powers."""


@dataclass(frozen=True)
class Reach:
    """Niches that lineages of one root visit, as (n_niches,) arrays.

    Parameters
    ----------
    visit : (n,) float64 array
        h_j, the probability that one lineage visits niche j.
    at_least_one : (n,) float64 array
        Probability that at least one of the U lineages does; they sum to the l-evolvability.
    expected_visits : (n,) float64 array
        Descendants in niche j in expectation, of all U lineages.
    low, high : (n,) float64 arrays
        5 % and 95 % quantiles of ``at_least_one`` over posterior draws of T; NaN where T is
        not drawn.
    l, lineages : int
        Generations, and number U of lineages.
    convention, estimator : str
        What was counted, where T came from.
    births : int, optional
        Births behind the root's row of T; None where T is given or the root has no row.
    """

    visit: Floats
    at_least_one: Floats
    expected_visits: Floats
    low: Floats
    high: Floats
    l: int
    lineages: int
    convention: str
    estimator: str
    births: int | None

    @property
    def evolvability(self) -> float:
        """Expected number of niches visited: l-evolvability."""
        return float(self.at_least_one.sum())

    def to_frame(self, chain: NicheChain) -> pd.DataFrame:
        """One row per niche, with its label, the surest first."""
        import pandas as pd

        frame = pd.DataFrame(
            {
                "niche": np.arange(self.visit.size),
                "index": [chain.label(niche) for niche in range(self.visit.size)],
                "visit": self.visit,
                "at_least_one": self.at_least_one,
                "low": self.low,
                "high": self.high,
                "expected_visits": self.expected_visits,
            }
        )
        return frame.sort_values("at_least_one", ascending=False, kind="stable").reset_index(drop=True)


def reach(
    chain: NicheChain,
    *,
    niche: Niche | None = None,
    offspring: ArrayLike | None = None,
    l: int = 5,
    lineages: int = 100,
    convention: Convention = "definition",
    draws: int = DRAWS,
    seed: int = 0,
    on_done: Callable[[int], None] | None = None,
) -> Reach:
    """Niches that descendants of a root reach, and how surely.

    Parameters
    ----------
    chain : NicheChain
    niche : int or tuple of int, optional
        The root stands in this niche; generation 1 is drawn from its row of T.
    offspring : (n_niches,) or (S,) array, optional
        D: generation 1 is drawn from this distribution. Give either this or ``niche``.
    l : int
        Generations, at least 1.
    lineages : int
        Number U of independent lineages, at least 1: l·U descendants.
    convention : {"definition", "procedure"}
        Whether the root's own state counts, as in :func:`nichechain.l_evolvability`.
    draws : int
        Posterior draws of T that all figures are averaged over, where it is estimated.
    seed : int
        Of the draws, the same ones as those of :func:`nichechain.l_evolvability`.
    on_done : callable, optional
        Told how many more draws are done.

    Returns
    -------
    Reach

    Raises
    ------
    NichechainError
        If an argument is out of range, or not exactly one root is given.

    Notes
    -----
    The niches that the paper's section "Towards better evolvability definitions" counts. In closed form up to
    a thousand states; beyond, lineages are followed as in :mod:`nichechain.evolvability.urn_reach`.
    """
    question = Question(l, lineages, convention, draws=draws, seed=seed)
    root = Root(chain, niche=niche, offspring=offspring)
    n = chain.n_niches
    question.warn_if_long(chain)
    if question.by_urns(chain):
        assert chain.posterior is not None
        visit, passes, simulated = simulated_reach(
            chain.posterior, question, root.state, root.distribution, on_done
        )
        some_of_all, _, low, high = simulated.summary()
        return Reach(
            visit,
            some_of_all,
            lineages * passes,
            np.clip(low, 0.0, 1.0),
            np.clip(high, 0.0, 1.0),
            l,
            lineages,
            convention,
            chain.estimator,
            root.births,
        )
    visits, descendants = [], []
    some: list[Floats] = []
    own = root.visited(question)
    for drawn in question.samples(chain, on_done=on_done):
        visit, passes = visit_probability(drawn.onward, root.children(drawn), question.drawn_steps(own))
        if own is not None:
            visit[own], passes[own] = 1.0, passes[own] + 1.0
        visits.append(visit[:n])
        descendants.append(lineages * passes[:n])
        some.extend(at_least_once(visit[:n], [lineages]))
    low, high = drawn_interval(some) if len(some) > 1 else no_interval(some[0])
    return Reach(
        np.mean(visits, axis=0),
        np.mean(some, axis=0),
        np.mean(descendants, axis=0),
        low,
        high,
        l,
        lineages,
        convention,
        chain.estimator,
        root.births,
    )


def visit_probability(transition: Transition, first: Floats, steps: int) -> tuple[Floats, Floats]:
    """Probability that a walk visits each state, and how often it does in expectation.

    Parameters
    ----------
    transition : (S, S) row-stochastic matrix
    first : (S,) array
        Distribution of the first state of the walk.
    steps : int
        States of the walk, the first one included, at least 1.

    Returns
    -------
    (S,) float64 array and (S,) float64 array
        h and the expected numbers of visits.

    Notes
    -----
    By the renewal equation (Feller 1968, chapter XIII): the walk is in j at step k with
    probability p_k = Σ_i f_i r_{k−i}, where f_i is the probability that step i is its first visit
    and r_m that of a return after m steps. Only the returns need walks of their own: from the
    states that are reached, and only for as many steps as are left by then. In a matrix that is
    not sparse they soon see all others. Returns of few steps are there diagonals of T^m, products of two
    powers half as high; for more steps the recursion over all roots is faster. Longer walks than a thousand
    states are followed by that recursion too, and no further than where nothing changes any more.
    """
    if steps > _LONGEST:
        blocks = [h for _, h in visit_probabilities(transition, first[None, :], steps)]
        return np.minimum(np.hstack(blocks)[0], 1.0), _expected_visits(transition, first, steps)
    rows, dense = transition, True
    if not isinstance(transition, PooledTransition):
        dense = bool(np.count_nonzero(_entries(transition)) > _DENSE * first.size**2)
        if not dense:
            rows = sparse.csr_array(transition)
    present = np.zeros((steps, first.size))
    present[0] = first
    for k in range(1, steps):
        present[k] = present[k - 1] @ rows
    passes = present.sum(axis=0)
    if dense and steps <= MOST_POWERS and not isinstance(rows, PooledTransition):
        returns = _returns(rows if isinstance(rows, np.ndarray) else rows.toarray(), steps - 1)
        new = present.copy()
        for k in range(1, steps):
            new[k] = np.maximum(present[k] - (new[:k] * returns[k - 1 :: -1]).sum(axis=0), 0.0)
        return np.clip(new.sum(axis=0), 0.0, 1.0), passes
    if dense:
        blocks = [h for _, h in visit_probabilities(transition, first[None, :], steps)]
        return np.minimum(np.hstack(blocks)[0], 1.0), passes
    reached = present > 0.0
    arrival = np.where(reached.any(axis=0), np.argmax(reached, axis=0), steps)
    new = present.copy()
    # States first reached in the last step cannot be returned to.
    again = np.flatnonzero(arrival < steps - 1)
    if again.size:
        from nichechain.evolvability.returns import return_probabilities

        # Some state is occupied at once, so the longest return wanted is as long as the walk.
        assert isinstance(rows, sparse.csr_array)
        returns = return_probabilities(rows, again, steps - 1 - arrival[again])
        for k in range(1, steps):
            earlier = new[:k, again] * returns[k - 1 :: -1]
            new[k, again] = np.maximum(present[k, again] - earlier.sum(axis=0), 0.0)
    return np.clip(new.sum(axis=0), 0.0, 1.0), passes


def _expected_visits(transition: Transition, first: Floats, steps: int) -> Floats:
    """How often a walk of many steps is in each state in expectation, (S,)."""
    passes: Floats = first.copy()
    present = first
    for left in range(steps - 1, 0, -1):
        after = np.asarray(present @ transition)
        # A state that the walk leaves for good never settles, but counts for nothing in the end.
        still = (np.abs(after - present) <= _SETTLED * after) | (left * after <= _NOTHING)
        if still.all():
            passes += left * after
            return passes
        present = after
        passes += after
    return passes


def _entries(transition: Floats | sparse.csr_array) -> Floats:
    return transition if isinstance(transition, np.ndarray) else transition.data


def _returns(transition: Floats, longest: int) -> Floats:
    """Probability that a walk from each state is there again after 1 to ``longest`` steps, (longest, S)."""
    returns = np.empty((longest, len(transition)))
    returns[:1] = transition.diagonal()
    low = high = transition
    for m in range(2, longest + 1):
        # T^m is low · high.
        if m % 2:
            high = low @ transition
        else:
            low = high
        returns[m - 1] = (low * high.T).sum(axis=1)
    return returns
