"""Which states lead to one another, where lineages end, and in what rhythm they move there.

All functions take the transition matrix ``chain.T``, which for an estimated chain is the
posterior mean. A posterior mean has no zeros: every state can follow every other, nothing
absorbs, and all states form one class. Structure is a question for a given T, for the literal
estimator ``mle``, or for a threshold on probabilities. Under ``mle`` with ``unvisited="self"`` a
niche without births is absorbing by decree: compare with ``chain.births``.

States keep their numbers, the outside state is one of them, and none is ever left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, connected_components

from nichechain.chain.model import NicheChain
from nichechain.chain.structure.transitions import entries_above, graph_of, reachable, rows_of
from nichechain.core.checks import check_numbers
from nichechain.core.errors import NichechainError

Ints = NDArray[np.int64]


def communicating_classes(chain: NicheChain, *, threshold: float = 0.0) -> list[Ints]:
    """Sets of states that all lead to one another.

    Parameters
    ----------
    chain : NicheChain
    threshold : float
        Only transitions of a larger probability count, at least 0 and below 1.

    Returns
    -------
    list of (c,) int64 arrays
        Each state is in exactly one class. Sorted, by the smallest state of each.

    Raises
    ------
    NichechainError
        If the threshold is out of range.

    Notes
    -----
    The strongly connected components of the graph of transitions (Kemeny and Snell 1960).
    """
    return classes_of(_above(chain, threshold), chain.states)


def recurrent_classes(chain: NicheChain, *, threshold: float = 0.0) -> list[Ints]:
    """Communicating classes that no lineage leaves: it ends in one of them and stays.

    Parameters
    ----------
    chain, threshold
        As in :func:`communicating_classes`; transitions at or below the threshold count as
        impossible.

    Returns
    -------
    list of (c,) int64 arrays
        At least one class. States in none of them are transient.

    Raises
    ------
    NichechainError
        If the threshold is out of range.
    """
    return closed_classes_of(_above(chain, threshold), chain.states)


def absorbing_niches(chain: NicheChain) -> Ints:
    """States whose children never leave them, (a,): T_ii = 1. The outside state can be one."""
    alone = [states[0] for states in recurrent_classes(chain) if states.size == 1]
    return np.array(alone, np.int64)


def period(chain: NicheChain) -> Ints:
    """Numbers of generations that a lineage takes from a state back to it have this common divisor.

    Returns
    -------
    (k,) int64 array
        One period for each of the recurrent classes, in their order: 1 for a class without a
        rhythm, 2 where lineages alternate between two halves of it, and so on.

    Notes
    -----
    The greatest common divisor of level(i) + 1 − level(j) over all transitions i → j, where a level
    is the distance from one state of the class (Denardo 1977, "Periods of connected networks").
    """
    graph = graph_of(rows_of(chain), chain)
    classes = closed_classes_of(graph, chain.states)
    return np.array([_period(graph, states, chain.states) for states in classes], np.int64)


def classes_of(graph: sparse.csr_array, states: int) -> list[Ints]:
    """Strongly connected parts of the first ``states`` nodes, sorted by their smallest state."""
    number, label = connected_components(graph, directed=True, connection="strong")
    return _sorted_parts(label[:states], np.ones(number, bool))


def closed_classes_of(graph: sparse.csr_array, states: int) -> list[Ints]:
    """Those parts that no transition leads out of."""
    number, label = connected_components(graph, directed=True, connection="strong")
    entries = graph.tocoo()
    start, end = label[entries.coords[0]], label[entries.coords[1]]
    closed = np.ones(number, bool)
    closed[start[start != end]] = False
    return _sorted_parts(label[:states], closed)


def _above(chain: NicheChain, threshold: float) -> sparse.csr_array:
    check_numbers(threshold=threshold)
    if not 0.0 <= threshold < 1.0:
        raise NichechainError(f"threshold is {threshold}, but must be at least 0 and below 1")
    if threshold == 0.0:
        return graph_of(rows_of(chain), chain)
    return entries_above(chain, threshold)


def _sorted_parts(label: NDArray[np.int32], kept: NDArray[np.bool_]) -> list[Ints]:
    """States of each label that is kept, sorted by the smallest."""
    states = np.flatnonzero(kept[label])
    order = states[np.argsort(label[states], kind="stable")].astype(np.int64)
    ends = np.cumsum(np.bincount(label[states], minlength=kept.size)[kept])[:-1]
    # A label that only stands for parts of T has no states.
    parts = [part for part in np.split(order, ends) if part.size]
    return sorted(parts, key=lambda part: int(part[0]))


def _period(graph: sparse.csr_array, states: Ints, size: int) -> int:
    """Period of a closed class; nodes from ``size`` on are half-way between two generations."""
    if states.size == 1:
        return 1
    # Nothing leads out of the class, so all that is reached from it belongs to it.
    nodes = reachable(graph, states[:1], graph.shape[0])
    inner = graph[nodes][:, nodes].tocsr()
    half = np.where(nodes < size, 1, 0)
    order, before = breadth_first_order(inner, 0, directed=True)
    level = np.zeros(nodes.size, np.int64)
    for node in order[1:]:
        level[node] = level[before[node]] + _halves(half, before[node], node)
    start, end = inner.tocoo().coords
    return int(np.gcd.reduce(np.abs(level[start] + _halves(half, start, end) - level[end]))) // 2


def _halves(state: Ints, start: Ints, end: Ints) -> Ints:
    """Half generations of a transition: two between states, one into or out of another node."""
    return np.asarray(state[start] + state[end])
