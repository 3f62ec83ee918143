"""Whether and when lineages get somewhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain
from nichechain.chain.structure.inside import Inside
from nichechain.chain.structure.targets import Target, states_of
from nichechain.chain.structure.transitions import graph_of, reachable, rows_of
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# What rounding, or the proven error of an iteration, may add to a probability of 1.
_ABOVE_ONE = 1e-6


def hitting_probabilities(chain: NicheChain, target: Target) -> Floats:
    """Probability that a lineage ever gets into the target.

    Parameters
    ----------
    chain : NicheChain
    target : niche, or sequence of niches

    Returns
    -------
    (S,) float64 array
        For a root in each state, the root itself included: 1 on the target. Exactly 0 where no
        path leads there, exactly 1 where no path leads past it.

    Raises
    ------
    NichechainError
        If there is no such niche, the target is empty, or the chain is so large that no method comes
        close enough.

    Notes
    -----
    The least solution of h = T h with h = 1 on the target (Norris 1997, theorem 1.3.2). How exact it
    is, see :class:`nichechain.chain.structure.inside.Inside`.
    """
    wanted = states_of(chain, target)
    rows = rows_of(chain)
    possible, sure = reaching(graph_of(rows, chain), wanted, chain.states)
    found = sure.astype(np.float64)
    open_ = np.flatnonzero(possible & ~sure)
    if open_.size:
        found[open_] = probabilities(Inside.of(rows, open_).solve((rows @ found)[open_]))
    return found


def mean_first_passage_times(chain: NicheChain, target: Target) -> Floats:
    """Expected number of generations until a lineage first gets into the target.

    Parameters
    ----------
    chain : NicheChain
    target : niche, or sequence of niches

    Returns
    -------
    (S,) float64 array
        For a root in each state; 0 on the target. Infinite where the lineage may never get there:
        the expectation of a time that is infinite with some probability is infinite, however
        small that probability. Where :func:`hitting_probabilities` is below 1, that is.

    Raises
    ------
    NichechainError
        If there is no such niche, the target is empty, a time is beyond 1e308, or the chain is so
        large that no method comes close enough.

    Notes
    -----
    m = 1 + T m off the target (Norris 1997, theorem 1.3.5), of ``chain.T``; for the times that a
    posterior allows see :func:`nichechain.chain.structure.intervals.posterior_interval`. Each time
    is within the share 1e-6 of itself, and nearly exact where states are eliminated, see
    :class:`nichechain.chain.structure.inside.Inside`.
    """
    wanted = states_of(chain, target)
    rows = rows_of(chain)
    _, sure = reaching(graph_of(rows, chain), wanted, chain.states)
    found = np.where(sure, 0.0, np.inf)
    sure[wanted] = False
    way = np.flatnonzero(sure)
    # States on the way lead only to each other and to the target, else they were not sure.
    found[way] = _times(Inside.of(rows, way).times)
    return found


def reaching(graph: sparse.csr_array, wanted: Ints, states: int) -> tuple[Bools, Bools]:
    """Which states may reach the wanted ones, and which surely do, (S,) each."""
    possible = np.zeros(states, bool)
    possible[reachable(graph.T.tocsr(), wanted, states)] = True
    lost = np.flatnonzero(~possible)
    sure = np.ones(states, bool)
    if lost.size:
        # A lineage may miss the target if it can get to a lost state without passing it.
        going = np.ones(graph.shape[0])
        going[wanted] = 0.0
        past = (sparse.diags_array(going) @ graph).tocsr()
        past.eliminate_zeros()
        sure[reachable(past.T.tocsr(), lost, states)] = False
    return possible, sure


def probabilities(found: Floats) -> Floats:
    """Probabilities as they were computed, none of them above 1.

    Raises
    ------
    NichechainError
        If one is further from [0, 1] than rounding explains.
    """
    if not (found.min(initial=0.0) >= 0.0 and found.max(initial=0.0) <= 1.0 + _ABOVE_ONE):
        raise NichechainError(
            f"a probability of {found.max():.9g} came out for this chain, which rounding does not explain: "
            "do its rows sum to 1?"
        )
    return np.minimum(found, 1.0)


def _times(found: Floats) -> Floats:
    """Times of at least one generation."""
    if found.size and not found.min() >= 1.0 - _ABOVE_ONE:
        raise NichechainError(
            f"a passage time of {found.min():.9g} generations came out for this chain, "
            "which rounding does not explain: do its rows sum to 1?"
        )
    return np.maximum(found, 1.0)
