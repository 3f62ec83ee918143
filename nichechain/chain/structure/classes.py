"""What a chain does in the long run: its classes, where lineages settle, how they get about.

All functions take the transition matrix ``chain.T``, which for an estimated chain is the
posterior mean. A posterior mean has no zeros: every state can follow every other, nothing
absorbs, and all states form one class. Structure is a question for a given T, for the literal
estimator ``mle``, or for a threshold on probabilities. Under ``mle`` with ``unvisited="self"`` a
niche without births is absorbing by decree: compare with ``chain.births``.

States keep their numbers, the outside state is one of them, and none is ever left out.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from nichechain.chain.model import NicheChain
from nichechain.chain.structure.linear import solve_substochastic
from nichechain.core.checks import check_numbers
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_WARM_UP = 50
# Two-step paths of probability 1 would have no length, and paths of no length no number.
_SHORTEST = 1e-12


def transition_entries(chain: NicheChain) -> sparse.csr_array:
    """T as a sparse matrix (S, S) whose entries are exactly the transitions that can happen."""
    entries = sparse.csr_array(chain.T, copy=True)
    entries.eliminate_zeros()
    return entries


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
    return _classes(_above(chain, threshold))


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
    entries = _above(chain, threshold)
    return [states for states in _classes(entries) if _closed(entries, states)]


def absorbing_niches(chain: NicheChain) -> Ints:
    """States whose children never leave them, (a,): T_ii = 1. The outside state can be one."""
    entries = transition_entries(chain)
    alone = np.diff(entries.indptr) == 1
    absorbing: Ints = np.flatnonzero(alone & (entries.diagonal() > 0)).astype(np.int64)
    return absorbing


def stationary_distribution(chain: NicheChain) -> Floats:
    """Share of time that a lineage spends in each state in the end.

    Parameters
    ----------
    chain : NicheChain

    Returns
    -------
    (k, S) float64 array
        One distribution for each of the recurrent classes, in their order: zero outside the
        class. Any mixture of them is stationary too; from a given start it is weighted by
        :func:`nichechain.chain.structure.passage.hitting_probabilities` of the classes.
    """
    entries = transition_entries(chain)
    classes = [states for states in _classes(entries) if _closed(entries, states)]
    found = np.zeros((len(classes), chain.states))
    for row, states in zip(found, classes, strict=True):
        row[states] = _stationary(entries[states][:, states])
    return found


def entropy_rate(chain: NicheChain) -> Floats:
    """Bits of surprise in the niche of the next child, in the end.

    Returns
    -------
    (k,) float64 array
        One rate for each of the recurrent classes, in their order, in bits per generation.

    Notes
    -----
    H = −Σ_i π_i Σ_j T_ij log2 T_ij (Shannon 1948).
    """
    entries = transition_entries(chain)
    surprise = entries.copy()
    surprise.data = -entries.data * np.log2(entries.data)
    rates: Floats = stationary_distribution(chain) @ np.asarray(surprise.sum(axis=1)).ravel()
    return rates


def betweenness(chain: NicheChain, *, threshold: float = 0.01) -> Floats:
    """How often a niche lies on the most probable path between two others.

    Parameters
    ----------
    chain : NicheChain
    threshold : float
        Only transitions at least this probable count, in [0, 1]. Time grows with S times the
        transitions that are left.

    Returns
    -------
    (S,) float64 array
        Share of ordered pairs of other states whose most probable path passes through, 0 to 1;
        equally probable paths share a pair. A state that the graph leaves out, or that no path
        passes through, has 0.

    Raises
    ------
    NichechainError
        If the threshold is not a probability.

    Notes
    -----
    Betweenness centrality (Freeman 1977; Brandes 2001) of :meth:`NicheChain.graph` with edges
    of length −log T_ij, which makes the shortest path the most probable one. Rows without births
    have no edges there.
    """
    import networkx as nx

    graph = chain.graph(threshold)
    for _, _, edge in graph.edges(data=True):
        edge["length"] = max(-np.log(edge["probability"]), _SHORTEST)
    found = np.zeros(chain.states)
    for state, share in nx.betweenness_centrality(graph, weight="length", normalized=False).items():
        found[state] = share
    others = chain.states - 1
    # All states are counted, those that the graph leaves out too.
    return found / (others * (others - 1)) if others > 1 else found


def to_deeptime(chain: NicheChain) -> Any:
    """The chain as a model of the library deeptime, for all else that is known of Markov chains.

    Returns
    -------
    deeptime.markov.msm.MarkovStateModel
        All states, the outside state last where there is one. Much of deeptime refuses a chain of
        more than one class: hand it a class, or use the functions of this package.

    Raises
    ------
    NichechainError
        If deeptime is not installed.
    """
    try:
        model = importlib.import_module("deeptime.markov.msm").MarkovStateModel
    except ImportError:
        raise NichechainError(
            "deeptime is not installed, but to_deeptime needs it: pip install deeptime"
        ) from None
    matrix = chain.T.copy() if isinstance(chain.T, np.ndarray) else sparse.csr_matrix(chain.T, copy=True)
    return model(matrix)


def _above(chain: NicheChain, threshold: float) -> sparse.csr_array:
    check_numbers(threshold=threshold)
    if not 0.0 <= threshold < 1.0:
        raise NichechainError(f"threshold is {threshold}, but must be at least 0 and below 1")
    entries = transition_entries(chain)
    entries.data = np.where(entries.data > threshold, entries.data, 0.0)
    entries.eliminate_zeros()
    return entries


def _classes(entries: sparse.csr_array) -> list[Ints]:
    """Strongly connected components, sorted by their smallest state."""
    number, label = connected_components(entries, directed=True, connection="strong")
    order = np.argsort(label, kind="stable").astype(np.int64)
    parts = np.split(order, np.cumsum(np.bincount(label, minlength=number))[:-1])
    return sorted(parts, key=lambda states: int(states[0]))


def _closed(entries: sparse.csr_array, states: Ints) -> bool:
    """Whether no transition leads out of these states."""
    return bool(np.isin(entries[states].indices, states).all())


def _stationary(inner: sparse.csr_array) -> Floats:
    """Stationary distribution of an irreducible T, (c,)."""
    size = inner.shape[0]
    if size == 1:
        return np.ones(1)
    share = np.full(size, 1.0 / size)
    for _ in range(_WARM_UP):
        share = 0.5 * (share + share @ inner)
    # Relative to a state that is often visited, all visits are numbers of moderate size.
    pivot = int(np.argmax(share))
    rest = np.delete(np.arange(size), pivot)
    between = inner[rest][:, rest].T.tocsr()
    visits = np.ones(size)
    visits[rest] = np.maximum(solve_substochastic(between, inner[[pivot]].toarray()[0, rest]), 0.0)
    distribution: Floats = visits / visits.sum()
    return distribution
