"""On the way: whether and when lineages get somewhere, and where those are that still wander."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, connected_components

from nichechain.chain.model import NicheChain
from nichechain.chain.structure.classes import recurrent_classes, transition_entries
from nichechain.chain.structure.linear import solve_substochastic
from nichechain.core.errors import NichechainError
from nichechain.niches import Niche

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

Target: TypeAlias = Niche | Sequence[Niche] | NDArray[np.int64]
"""A niche, as flat id or as grid index (a tuple), or a list or array of them. The outside state
goes by its number."""

_DENSE = 300
# Perron roots nearer to one another than this are taken for equal.
_EQUAL = 1e-9
_MOST_STEPS = 60
_CONVERGED = 1e-11


@dataclass(frozen=True)
class QuasiStationary:
    """Where lineages are that have stayed within a set of states for long.

    Parameters
    ----------
    distribution : (S,) float64 array
        Zero outside the set; all NaN where there is no such distribution, see ``reason``.
    survival : float
        Probability that a lineage distributed like this is still in the set a generation later;
        NaN for an empty set.
    reason : str
        Why there is no distribution, empty where there is one.
    """

    distribution: Floats
    survival: float
    reason: str = ""


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
        If there is no such niche, or the target is empty.

    Notes
    -----
    The least solution of h = T h with h = 1 on the target (Norris 1997, theorem 1.3.2).
    """
    entries = transition_entries(chain)
    wanted = _states(chain, target)
    possible, sure = _reaching(entries, wanted)
    found = sure.astype(np.float64)
    open_ = np.flatnonzero(possible & ~sure)
    rows = entries[open_]
    solved = solve_substochastic(rows[:, open_], rows @ found)
    found[open_] = np.clip(solved, 0.0, 1.0)
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
        If there is no such niche, or the target is empty.

    Notes
    -----
    m = 1 + T m off the target (Norris 1997, theorem 1.3.5), of ``chain.T``; not the posterior
    mean of the times where T is estimated.
    """
    entries = transition_entries(chain)
    wanted = _states(chain, target)
    _, sure = _reaching(entries, wanted)
    found = np.where(sure, 0.0, np.inf)
    sure[wanted] = False
    way = np.flatnonzero(sure)
    # States on the way lead only to each other and to the target, else they were not sure.
    found[way] = solve_substochastic(entries[way][:, way], np.ones(way.size))
    return found


def quasi_stationary_distribution(chain: NicheChain, states: Target | None = None) -> QuasiStationary:
    """Where a lineage is, given that it has not left a set of states for a long time.

    Parameters
    ----------
    chain : NicheChain
    states : sequence of niches, optional
        By default all transient states: those in no recurrent class.

    Returns
    -------
    QuasiStationary
        Without a distribution where the set is empty, where every lineage leaves it within a few
        generations, or where two parts of it are left equally slowly, so that the distribution
        depends on where lineages began.

    Raises
    ------
    NichechainError
        If there is no such niche.

    Notes
    -----
    The left eigenvector of T within the set that belongs to its largest eigenvalue, the survival
    (Darroch and Seneta 1965).
    """
    nowhere = np.full(chain.states, np.nan)
    if states is None:
        within = np.setdiff1d(np.arange(chain.states), np.concatenate(recurrent_classes(chain)))
        if not within.size:
            return QuasiStationary(nowhere, np.nan, "no state is transient")
    else:
        within = _states(chain, states)
    entries = transition_entries(chain)
    inner = entries[within][:, within].tocsr()
    number, label = connected_components(inner, directed=True, connection="strong")
    members = [np.flatnonzero(label == k) for k in range(number)]
    roots = [_perron(inner[part][:, part]) for part in members]
    survival = max(root for root, _ in roots)
    slowest = [k for k, (root, _) in enumerate(roots) if root >= survival * (1.0 - _EQUAL)]
    if survival == 0.0:
        return QuasiStationary(nowhere, 0.0, "every lineage leaves these states within a few generations")
    if len(slowest) > 1:
        return QuasiStationary(
            nowhere, survival, f"{len(slowest)} parts of these states are left equally slowly"
        )
    share = np.zeros(within.size)
    part = members[slowest[0]]
    share[part] = roots[slowest[0]][1]
    after = np.setdiff1d(_reachable(inner, part), part)
    # Downstream lineages come in from the slowest part faster than they leave.
    share[after] = solve_substochastic(
        inner[after][:, after].T.tocsr() / survival, share[part] @ inner[part][:, after] / survival
    )
    distribution = np.zeros(chain.states)
    distribution[within] = np.maximum(share, 0.0) / np.maximum(share, 0.0).sum()
    return QuasiStationary(distribution, survival)


def _states(chain: NicheChain, target: Target) -> Ints:
    """Sorted states of a target."""
    if isinstance(target, (list, np.ndarray)) or (
        isinstance(target, Sequence) and not isinstance(target, (tuple, str))
    ):
        several = list(target)
    else:
        # A tuple is the index of one niche; what is no niche at all is for the chain to refuse.
        several = [target]
    if not several:
        raise NichechainError("the target is empty, but must have at least one niche")
    return np.unique([_state(chain, niche) for niche in several])


def _state(chain: NicheChain, niche: Niche) -> int:
    if chain.outside is not None and isinstance(niche, (int, np.integer)) and niche == chain.outside:
        return chain.outside
    return chain.state(niche)


def _reaching(entries: sparse.csr_array, wanted: Ints) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which states may reach the wanted ones, and which surely do, (S,) each."""
    size = entries.shape[0]
    possible = np.zeros(size, bool)
    possible[_reachable(entries.T.tocsr(), wanted)] = True
    lost = np.flatnonzero(~possible)
    sure = np.ones(size, bool)
    if lost.size:
        # A lineage may miss the target if it can get to a lost state without passing it.
        going = np.ones(size)
        going[wanted] = 0.0
        past = (sparse.diags_array(going) @ entries).tocsr()
        past.eliminate_zeros()
        sure[_reachable(past.T.tocsr(), lost)] = False
    return possible, sure


def _reachable(entries: sparse.csr_array, start: Ints) -> Ints:
    """States that paths from the starting ones lead to, these included, sorted."""
    size = entries.shape[0]
    # One more state, from which the search sets out to all starting ones.
    door = sparse.csr_array((np.ones(start.size), (np.zeros(start.size, int), start)), shape=(1, size))
    graph = sparse.block_array([[entries, None], [door, sparse.csr_array((1, 1))]], format="csr")
    order = breadth_first_order(graph, size, directed=True, return_predecessors=False)
    return np.sort(order[order < size]).astype(np.int64)


def _perron(inner: sparse.csr_array) -> tuple[float, Floats]:
    """Largest eigenvalue of an irreducible substochastic matrix and its left eigenvector."""
    size = inner.shape[0]
    if size == 1:
        return float(inner.diagonal()[0]), np.ones(1)
    if size <= _DENSE:
        # The largest root is the only one with the largest real part, also where T is periodic.
        values, vectors = np.linalg.eig(inner.toarray().T)
        best = int(np.argmax(values.real))
        positive = np.abs(vectors[:, best].real)
        return float(values[best].real), positive / positive.sum()
    return _noda(inner.T.tocsr())


def _noda(matrix: sparse.csr_array) -> tuple[float, Floats]:
    """Perron root and vector of a large irreducible matrix.

    Notes
    -----
    Inverse iteration whose shift is the upper bound of Collatz and Wielandt on the root: it stays
    positive and converges quadratically (Noda 1971), also where the roots lie close together.
    """
    vector = np.full(matrix.shape[0], 1.0 / matrix.shape[0])
    for _ in range(_MOST_STEPS):
        ratio = (matrix @ vector) / vector
        low, high = float(ratio.min()), float(ratio.max())
        if high - low <= _CONVERGED * high:
            return high, vector
        # A shift a hair above the bound keeps the system regular to the end.
        shift = high * (1.0 + _CONVERGED)
        vector = np.maximum(solve_substochastic(matrix / shift, vector), np.finfo(float).tiny)
        vector /= vector.sum()
    raise NichechainError(
        f"the quasi-stationary distribution of {vector.size} states does not converge: "
        f"survival is between {low:.9g} and {high:.9g}"
    )
