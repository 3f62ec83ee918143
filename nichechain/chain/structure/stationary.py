"""Where lineages are in the long run."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain
from nichechain.chain.structure.classes import closed_classes_of
from nichechain.chain.structure.inside import Inside
from nichechain.chain.structure.targets import Target, states_of
from nichechain.chain.structure.transitions import Rows, graph_of, reachable, rows_of
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_WARM_UP = 50
# Numbers in an answer with a row for each class: 1 GiB.
_MOST_CELLS = 2**27


def stationary_distribution(chain: NicheChain) -> Floats:
    """Share of time that a lineage spends in each state in the end.

    Parameters
    ----------
    chain : NicheChain

    Returns
    -------
    (k, S) float64 array
        One distribution for each of the recurrent classes, in their order: zero outside the
        class. Any mixture of them is stationary too; the one that a given root ends in is
        :func:`long_run_distribution`.

    Raises
    ------
    NichechainError
        If k · S numbers would take more than 1 GiB.

    Notes
    -----
    π = π T (Norris 1997, section 1.7), by elimination of states: right in every entry, also in one
    of 1e-200, up to 2,000 states and for narrow bands of any length; beyond that within 1e-6.
    """
    rows = rows_of(chain)
    classes = closed_classes_of(graph_of(rows, chain), chain.states)
    if len(classes) * chain.states > _MOST_CELLS:
        raise NichechainError(
            f"{len(classes)} recurrent classes of a chain of {chain.states} states would take "
            f"{8 * len(classes) * chain.states / 2**30:.0f} GiB: "
            "ask for the long_run_distribution of one root, or of some"
        )
    found = np.zeros((len(classes), chain.states))
    for row, states in zip(found, classes, strict=True):
        row[states] = stationary_of(rows, states)
    return found


def long_run_distribution(chain: NicheChain, root: Target) -> Floats:
    """Share of time that lineages of a root spend in each state in the end.

    Parameters
    ----------
    chain : NicheChain
    root : niche, or sequence of niches
        Where lineages begin; of several, in each alike.

    Returns
    -------
    (S,) float64 array
        The stationary distributions of the recurrent classes, each with the probability that the
        lineage ends in that class.

    Raises
    ------
    NichechainError
        If there is no such niche.
    """
    start = states_of(chain, root, "root")
    first = np.zeros(chain.states)
    first[start] = 1.0 / start.size
    rows = rows_of(chain)
    graph = graph_of(rows, chain)
    near = np.zeros(chain.states, bool)
    near[reachable(graph, start, chain.states)] = True
    classes = [states for states in closed_classes_of(graph, chain.states) if near[states[0]]]
    near[np.concatenate(classes)] = False
    passing = np.flatnonzero(near)
    ends = first.copy()
    if passing.size:
        visits = Inside.of(rows, passing).solve_transposed(first[passing])
        everywhere = np.zeros(chain.states)
        everywhere[passing] = visits
        ends += everywhere @ rows
    found = np.zeros(chain.states)
    for states in classes:
        found[states] = ends[states].sum() * stationary_of(rows, states)
    # Every lineage ends somewhere.
    shares: Floats = found / found.sum()
    return shares


def entropy_rate(chain: NicheChain) -> Floats:
    """Bits of surprise in the niche of the next child, in the end.

    Returns
    -------
    (k,) float64 array
        One rate for each of the recurrent classes, in their order, in bits per generation.

    Raises
    ------
    NichechainError
        If T would have to be whole and is too large for that.

    Notes
    -----
    H = −Σ_i π_i Σ_j T_ij log2 T_ij (Shannon 1948).
    """
    rows = rows_of(chain)
    classes = closed_classes_of(graph_of(rows, chain), chain.states)
    surprise = sparse.csr_array(chain.T, copy=True)
    surprise.eliminate_zeros()
    surprise.data = -surprise.data * np.log2(surprise.data)
    of_state = np.asarray(surprise.sum(axis=1)).ravel()
    return np.array([stationary_of(rows, states) @ of_state[states] for states in classes])


def stationary_of(rows: Rows, states: Ints) -> Floats:
    """Stationary distribution of a closed class of T, (c,)."""
    if states.size == 1:
        return np.ones(1)
    whole = Inside.of(rows, states)
    # By rounding of rows that are kept in parts, a class may seem to be left.
    visits = Inside(whole.onward, np.zeros(states.size), states).visits()
    if visits is None:
        visits = _relative_to_one(rows, states)
    distribution: Floats = visits / visits.sum()
    return distribution


def _relative_to_one(rows: Rows, states: Ints) -> Floats:
    """Visits to each state of a large class between two visits to one of them."""
    share = np.zeros(rows.shape[0])
    share[states] = 1.0 / states.size
    for _ in range(_WARM_UP):
        share = 0.5 * (share + share @ rows)
    # Relative to a state that is often visited, all visits are numbers of moderate size.
    pivot = int(np.argmax(share[states]))
    rest = np.delete(states, pivot)
    once = np.zeros(rows.shape[0])
    once[states[pivot]] = 1.0
    visits = np.ones(states.size)
    away = Inside.of(rows, rest).solve_transposed(np.maximum((once @ rows)[rest], 0.0))
    visits[np.arange(states.size) != pivot] = away
    return visits
