"""Chapman-Kolmogorov: whether two generations are what two transitions make of one.

On lineages without selection, k generations must distribute as T^k. On births of a search the
middle generation was selected, so T² is not what even a perfect chain shows: given the niches j
of the parents, those of the children must distribute as Σ_j w_ij T_jk, with w the share of
middle niches that were observed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.validation.lineages import Triples
from nichechain.validation.markov import PERMUTATIONS, MarkovTest, check_permutations, p_value, permuted
from nichechain.validation.rollouts import OnDone

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Beyond the tests of nichechain.validation.markov, which draw from the first few.
_BIRTHS = 10
_LINEAGES = 11


def births_test(
    triples: Triples, *, permutations: int = PERMUTATIONS, seed: int = 0, on_done: OnDone | None = None
) -> MarkovTest:
    """Children against Σ_j w_ij T_jk for each grandparent state i, on births of a search.

    The statistic is the squared distance of counts from expectation, over (i, k), divided by the
    sums of row and column as in correspondence analysis; and that over what it would be were the
    children of one middle niche drawn from one urn. T has the observed shares. Grandparents are
    permuted among the parents of one niche. Other than the lineage test it adds up what a
    grandparent's niche does over all middle niches, so that nearly all births contribute.

    Parameters
    ----------
    triples : Triples
    permutations : int
        At least 1.
    seed : int
    on_done : callable, optional
        Told how many more permutations are done.

    Raises
    ------
    NichechainError
        If ``permutations`` is below 1.
    """
    permutations = check_permutations(permutations)
    known = triples.with_grandparent
    name = "Chapman-Kolmogorov, w T"
    everything = int(np.unique(known.niche).size), len(known)
    several = np.bincount(np.unique(np.stack([known.niche, known.grandparent]), axis=1)[0], minlength=1) > 1
    used = known.of(several[known.niche])
    facts = (int(np.unique(used.niche).size), len(used), *everything)
    if not len(used):
        return MarkovTest(name, 0.0, 0.0, 1.0, permutations, *facts)
    order = np.argsort(used.niche, kind="stable")
    place = np.empty(order.size, np.int64)
    place[order] = np.arange(order.size)
    niche, grandparent = used.niche[order], used.grandparent[order]
    sums = _Sums(niche, place[used.elite], used.child)
    observed = sums.ratio(grandparent)
    rng = keyed(seed, Purpose.PERMUTATION, _BIRTHS)
    values = permuted(
        lambda: sums.ratio(grandparent[np.lexsort((rng.random(niche.size), niche))]), permutations, on_done
    )
    return MarkovTest(name, observed, float(values.mean()), p_value(observed, values), permutations, *facts)


def lineages_test(
    states: Ints, *, permutations: int = PERMUTATIONS, seed: int = 0, on_done: OnDone | None = None
) -> list[MarkovTest]:
    """Generations k = 2, 3, ... of lineages without selection, against T^k.

    The statistic is the squared distance, over all starts, of the states k generations on from
    the k-th power of the observed shares of single generations, scaled as in
    :func:`births_test`. What follows is permuted among the
    lineages that stand in one state in one generation, which leaves single generations as they
    are and makes the test exact.

    Parameters
    ----------
    states : (N, l + 1) int64 array
        Lineages from their roots on, ``NONE`` after a failed birth.
    permutations : int
        At least 1.
    seed : int
    on_done : callable, optional
        Told how many more permutations are done.

    Returns
    -------
    list of MarkovTest
        One for each k from 2 to l. ``niches`` are the states in which lineages of different
        history meet, ``births`` the visits there.

    Raises
    ------
    NichechainError
        If there are no two generations, or ``permutations`` is below 1.
    """
    permutations = check_permutations(permutations)
    states = np.asarray(states)
    if states.ndim != 2 or states.shape[1] < 3:
        raise NichechainError(f"lineages have shape {states.shape}, but must be (N, l + 1) with l at least 2")
    # A failed birth is a state like any other, which is never left.
    names, numbered = np.unique(states, return_inverse=True)
    walks = numbered.reshape(states.shape).astype(np.int64)
    n, generations = names.size, states.shape[1] - 1
    step = sparse.csr_array(_pairs(walks, 1, n), dtype=np.float64)
    leaving = np.asarray(step.sum(axis=1)).ravel()
    # A state seen in last generations only is left by no lineage that counts.
    single = sparse.diags_array(1.0 / np.maximum(leaving, 1.0)) @ step
    tables = []
    power = single
    for k in range(2, generations + 1):
        power = power @ single
        tables.append(_Distant(walks, k, power))
    observed = [table.distance(walks) for table in tables]
    rng = keyed(seed, Purpose.PERMUTATION, _LINEAGES)
    values = np.empty((permutations, len(tables)))
    for number in range(permutations):
        recombined = _recombined(walks, rng)
        values[number] = [table.distance(recombined) for table in tables]
        if on_done is not None:
            on_done(1)
    niches, births = _meetings(walks, names)
    alive = states != NONE
    facts = (niches, births, int(np.unique(states[:, 1:-1][alive[:, 1:-1]]).size), int(alive[:, 2:].sum()))
    return [
        MarkovTest(
            f"Chapman-Kolmogorov, T^{k}",
            observed[k - 2],
            float(values[:, k - 2].mean()),
            p_value(observed[k - 2], values[:, k - 2]),
            permutations,
            *facts,
        )
        for k in range(2, generations + 1)
    ]


class _Sums:
    """Distance of grandparent × child from Σ_j w_ij T_jk, over its expectation.

    Parameters
    ----------
    niche : (E,) int64 array
        State j of each parent.
    parent : (N,) int64 array
        Parent of each child.
    child : (N,) int64 array
    """

    def __init__(self, niche: Ints, parent: Ints, child: Ints) -> None:
        self._parent, self._child = parent, child
        self._middle, self._of = np.unique(niche, return_inverse=True)
        self._size = np.bincount(parent, minlength=niche.size).astype(np.float64)
        columns, column, landed = np.unique(child, return_inverse=True, return_counts=True)
        self._column, self._landed = column, landed
        shape = (self._middle.size, columns.size)
        counts = sparse.coo_array((np.ones(child.size), (self._of[parent], column)), shape=shape).tocsr()
        self._births = np.asarray(counts.sum(axis=1)).ravel()
        self._shares = (sparse.diags_array(1.0 / self._births) @ counts).tocsr()
        spread = self._shares - self._shares.multiply(self._shares)
        self._chance = spread @ (1.0 / landed)

    def ratio(self, grandparent: Ints) -> float:
        """The statistic for grandparent states (E,)."""
        rows = int(grandparent.max()) + 1
        shape = rows, self._landed.size
        pairs = grandparent[self._parent], self._column
        seen = sparse.coo_array((np.ones(self._child.size), pairs), shape=shape).tocsr()
        shape = rows, self._middle.size
        weights = sparse.coo_array((self._size, (grandparent, self._of)), shape=shape).tocsr()
        weights.eliminate_zeros()
        total = np.asarray(weights.sum(axis=1)).ravel()
        # Drawn without replacement: an urn that one grandparent's children empty leaves no chance.
        births = self._births[weights.indices]
        left = weights.data * (births - weights.data) / np.maximum(births - 1.0, 1.0)
        chance = float((left * self._chance[weights.indices] / total[_rows(weights)]).sum())
        off = (seen - weights @ self._shares).tocsr()
        # Divided by row and column sums, not by the expectation given the middle niches: a rare
        # state that one parent keeps breeding into would weigh most where it contradicts T least.
        scale = total[_rows(off)] * self._landed[off.indices]
        return float((off.data**2 / scale).sum()) / chance if chance > 1e-12 else 0.0


def _rows(matrix: sparse.csr_array) -> Ints:
    """The row of each entry."""
    return np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))


class _Distant:
    """Pairs of states k generations apart against a power of T.

    Parameters
    ----------
    walks : (N, l + 1) int64 array
    apart : int
        k.
    power : (n, n) sparse matrix
    """

    def __init__(self, walks: Ints, apart: int, power: sparse.csr_array) -> None:
        n = power.shape[0]
        self._apart = apart
        starts = np.bincount(walks[:, :-apart].ravel(), minlength=n)
        ends = np.bincount(walks[:, apart:].ravel(), minlength=n)
        scale = 1.0 / np.maximum(np.outer(starts, ends), 1)
        expected = (sparse.diags_array(starts.astype(np.float64)) @ power).toarray()
        self._scale, self._expected = scale.ravel(), expected.ravel()
        self._empty = float((self._scale * self._expected**2).sum())
        self._states = n

    def distance(self, walks: Ints) -> float:
        """Squared distance of the counts from expectation, cells divided by row and column sums."""
        start, end = walks[:, : -self._apart].ravel(), walks[:, self._apart :].ravel()
        pair, count = np.unique(start * self._states + end, return_counts=True)
        full = self._scale[pair] * count * (count - 2.0 * self._expected[pair])
        return self._empty + float(full.sum())


def _pairs(walks: Ints, apart: int, n: int) -> sparse.coo_array:
    """How often each state follows each, (n, n)."""
    start, end = walks[:, :-apart].ravel(), walks[:, apart:].ravel()
    return sparse.coo_array((np.ones(start.size), (start, end)), shape=(n, n))


def _recombined(walks: Ints, rng: np.random.Generator) -> Ints:
    """Lineages that exchange what follows wherever they stand in one state in one generation."""
    made = walks.copy()
    follows = np.arange(len(walks))
    for generation in range(1, walks.shape[1] - 1):
        here = walks[:, generation]
        # Row m of the sorted states gets another row's continuation from the same state.
        exchanged = np.empty_like(follows)
        exchanged[np.argsort(here, kind="stable")] = np.lexsort((rng.random(here.size), here))
        follows = exchanged[follows]
        made[:, generation + 1] = walks[follows, generation + 1]
    return made


def _meetings(walks: Ints, names: Ints) -> tuple[int, int]:
    """States where lineages meet that came from different states and go on differently, and visits."""
    met: set[int] = set()
    visits = 0
    for generation in range(1, walks.shape[1] - 1):
        here = walks[:, generation]
        came = np.unique(walks[:, [generation, generation - 1]], axis=0)[:, 0]
        goes = np.unique(walks[:, [generation, generation + 1]], axis=0)[:, 0]
        size = names.size
        several = (np.bincount(came, minlength=size) > 1) & (np.bincount(goes, minlength=size) > 1)
        several &= names != NONE
        met.update(np.flatnonzero(several).tolist())
        visits += int(np.count_nonzero(several[here]))
    return len(met), visits
