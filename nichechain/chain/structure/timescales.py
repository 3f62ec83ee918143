"""How fast a chain forgets where it began."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain
from nichechain.chain.structure.classes import classes_of, period, recurrent_classes
from nichechain.chain.structure.elimination import Dense
from nichechain.chain.structure.inside import Inside
from nichechain.chain.structure.stationary import stationary_of
from nichechain.chain.structure.transitions import leaving_alone
from nichechain.core.checks import check_whole
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]

# All eigenvalues, or all pairs of states, of more states would take minutes.
_MOST_STATES = 3_000
# An eigenvalue this near to 1 loses digits that its timescale needs.
_NEAR_ONE = 1e-3


def kemeny_constant(chain: NicheChain) -> Floats:
    """Generations that a lineage needs to a state drawn by the stationary distribution.

    Returns
    -------
    (k,) float64 array
        One constant for each of the recurrent classes, in their order: the same from wherever in the
        class the lineage begins. A state that it stands in already takes 0 generations.

    Raises
    ------
    NichechainError
        If a class has more than 3,000 states.

    Notes
    -----
    K = Σ_j π_j m_ij, with m the mean first passage times (Kemeny and Snell 1960, theorem 4.4.10), here
    without the 1 that their m_jj adds: also Σ 1 / (1 − λ) over all other eigenvalues λ than the 1.
    """
    classes = recurrent_classes(chain)
    _check_size(max(states.size for states in classes), "a recurrent class")
    rows = _entries(chain)
    found = []
    for states in classes:
        if states.size == 1:
            found.append(0.0)
            continue
        share = stationary_of(rows, states)
        times = passage_between_all(rows[states][:, states].toarray(), np.ones(states.size))
        # From the most visited state, whose row has the smallest numbers.
        found.append(float(times[int(np.argmax(share))] @ share))
    return np.array(found)


def implied_timescales(chain: NicheChain, k: int = 10) -> Floats:
    """How many generations it takes until slow differences between roots have shrunk to 1/e.

    Parameters
    ----------
    chain : NicheChain
    k : int
        How many timescales, at least 1.

    Returns
    -------
    (k,) float64 array
        In generations, the slowest first; fewer where there are not so many states. Infinite for
        differences that stay: of lineages in several recurrent classes, or in step with a period.

    Raises
    ------
    NichechainError
        If ``k`` is out of range, or a class has more than 3,000 states.

    Notes
    -----
    −1 / log|λ| for the eigenvalues λ of T, largest |λ| first, without one that is 1 (Swope, Pitera and
    Suits 2004). T is triangular by classes, so these are the eigenvalues of its classes. Those near 1
    are found as eigenvalues 1 / (1 − λ) of the class's fundamental matrix, which elimination gives, so
    that a timescale of 1e15 generations is exact as well.
    """
    check_whole(k=k)
    if k < 1:
        raise NichechainError(f"k is {k}, but at least 1 is needed")
    rows = _entries(chain)
    closed = {
        int(states[0]): lasting
        for states, lasting in zip(recurrent_classes(chain), period(chain), strict=True)
    }
    classes = classes_of(rows, chain.states)
    _check_size(max(states.size for states in classes), "a class")
    decay = []
    for states in classes:
        lasting = closed.get(int(states[0]), 0)
        gap = gaps(rows, states, closed=lasting > 0)
        with np.errstate(divide="ignore"):
            # −log|1 − g|, exact for a tiny gap g as well.
            shrinking = np.sort(-0.5 * np.log1p(np.maximum(np.abs(gap) ** 2 - 2.0 * gap.real, -1.0)))
        # As many eigenvalues as the class has generations in its period are of size 1.
        shrinking[:lasting] = 0.0
        decay.append(shrinking)
    with np.errstate(divide="ignore"):
        times = 1.0 / np.maximum(np.concatenate(decay), 0.0)
    # One of the eigenvalues 1 is what all chains have.
    slowest: Floats = np.sort(times)[::-1][1 : k + 1]
    return slowest


def gaps(rows: sparse.csr_array, states: Ints, *, closed: bool) -> Complexes:
    """1 − λ for the eigenvalues λ of T within a class, those of the smallest size first.

    Parameters
    ----------
    rows : (S, S) scipy.sparse.csr_array
        T.
    states : (c,) int64 array
        All of which lead to one another.
    closed : bool
        Whether nothing leads out of them, so that the first λ is 1.

    Returns
    -------
    (c,) complex128 array
    """
    if states.size == 1:
        return np.array([0.0 if closed else leaving_alone(rows, int(states[0]))], np.complex128)
    inner = rows[states][:, states].toarray()
    gap = np.linalg.eigvals(np.eye(states.size) - inner).astype(np.complex128)
    gap = gap[np.argsort(np.abs(gap), kind="stable")]
    first = int(closed)
    gap[:first] = 0.0
    if (np.abs(gap[first:]) < _NEAR_ONE).any():
        inverse = _deviation(rows, states) if closed else _expected_visits(rows, states)
        near = np.linalg.eigvals(inverse).astype(np.complex128)
        near = near[np.argsort(-np.abs(near), kind="stable")][: states.size - first]
        small = int(np.count_nonzero(np.abs(near) > 1.0 / _NEAR_ONE))
        gap[first : first + small] = 1.0 / near[:small]
    return gap


def passage_between_all(onward: Floats, lasting: Floats) -> Floats:
    """Mean time from every state of a closed class to every other, (c, c); 0 on the diagonal.

    Parameters
    ----------
    onward : (c, c) float64 array
        Probabilities from state to state; the diagonal is ignored.
    lasting : (c,) float64 array
        How long a step from each state lasts.

    Notes
    -----
    To reach each other, states of one half must do so by themselves once the ways through the other
    half are steps that last longer. So each half is eliminated in turn, which leaves two problems of
    half the size. No number is subtracted. A variant of Hunter (2016), "Accurate calculations of
    stationary distributions and mean first passage times in Markov renewal processes and Markov chains".
    """
    size = lasting.size
    if size == 1:
        return np.zeros((1, 1))
    halves = np.arange(size // 2), np.arange(size // 2, size)
    found = np.empty((size, size))
    for kept, gone in (halves, halves[::-1]):
        back = onward[np.ix_(gone, kept)]
        through = Dense.of(onward[np.ix_(gone, gone)], back.sum(axis=1))
        # Where lineages from eliminated states first get among the kept ones, and when.
        entry, time = through.solve(back), through.solve(lasting[gone])
        away = onward[np.ix_(kept, gone)]
        among = passage_between_all(onward[np.ix_(kept, kept)] + away @ entry, lasting[kept] + away @ time)
        found[np.ix_(kept, kept)] = among
        found[np.ix_(gone, kept)] = time[:, None] + entry @ among
    return found


def _deviation(rows: sparse.csr_array, states: Ints) -> Floats:
    """Σ over generations t of T^t less its limit, within a closed class."""
    times = passage_between_all(rows[states][:, states].toarray(), np.ones(states.size))
    share = stationary_of(rows, states)
    return share * (share @ times - times)


def _expected_visits(rows: sparse.csr_array, states: Ints) -> Floats:
    """(I − Q)⁻¹ of a class that is left."""
    inside = Inside.of(rows, states)
    assert isinstance(inside.onward, sparse.csr_array)
    return Dense.of(inside.onward.toarray(), inside.leaving).solve(np.eye(states.size))


def _entries(chain: NicheChain) -> sparse.csr_array:
    entries = sparse.csr_array(chain.T, copy=True)
    entries.eliminate_zeros()
    return entries


def _check_size(size: int, what: str) -> None:
    if size > _MOST_STATES:
        raise NichechainError(
            f"{what} of {size} states is too large: all its eigenvalues or pairs of states would take "
            f"too long beyond {_MOST_STATES}"
        )
