"""How many niches independent lineages visit: in closed form, by simulation, by rarefaction."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.core.checks import as_whole, check_at_least, check_whole
from nichechain.core.errors import NichechainError
from nichechain.core.rarefaction import distinct_among
from nichechain.core.row_sampler import RowSampler

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Cells of the table (repeats, niches) and walks in flight that a simulation keeps at once.
_CELLS = 8_000_000

# Lineages that are simulated at once, and numbers of an answer: more would take many GiB.
_MOST_WALKS, _MOST_KEPT = 10**8, 2**27

# Target niches treated together.
_COLUMNS = 128

# Every so many steps it is seen whether anything still changes by more than rounding.
_LOOK, _SETTLED = 64, 1e-15

# Above this share of nonzeros a dense product is faster than a sparse one.
_DENSE = 0.3


class LinearOperator(Protocol):
    """A matrix we only multiply with: sparse, dense, or sparse plus low rank."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Rows and columns."""
        ...

    def __matmul__(self, other: Floats, /) -> Floats: ...


def expected_coverage(
    transition: LinearOperator,
    first: LinearOperator,
    steps: int,
    lineages: ArrayLike,
    *,
    counted: int | None = None,
    own: Ints | None = None,
    columns: int = _COLUMNS,
) -> Floats:
    """Expected number of distinct niches that independent lineages visit: l-evolvability.

    Parameters
    ----------
    transition : (S, S) row-stochastic map
        ``transition[i, j]`` = P(child in state j | parent in state i).
    first : (m, S) map
        Distribution of generation 1 for each of m roots; ``transition`` itself for all states.
    steps : int
        States of a lineage that count, at least 1: its l generations.
    lineages : int or (k,) ints
        Number U of independent lineages per root, at least 1; several are answered together.
    counted : int, optional
        Only the first so many states are niches that count; by default all are.
    own : (m,) int64 array, optional
        Where each root stands, if that is visited as well.
    columns : int
        Target niches treated together. Peak memory is about ``16 * (S + m) * columns`` bytes.

    Returns
    -------
    (m,) or (m, k) array
        Niches visited at least once, in expectation.

    Raises
    ------
    NichechainError
        If ``steps`` or ``lineages`` is below 1.

    Notes
    -----
    E = Σ_j 1 − (1 − h_j)^U, where h_j is the probability that one lineage
    visits niche j.
    """
    sizes = _sizes(lineages)
    check_at_least(1, steps=steps)
    coverage = np.zeros((first.shape[0], sizes.size))
    for targets, visited in visit_probabilities(transition, first, steps, counted, columns):
        if own is not None:
            here = np.flatnonzero((own >= targets[0]) & (own <= targets[-1]))
            visited[here, own[here] - targets[0]] = 1.0
        for k, some in enumerate(at_least_once(visited, sizes)):
            coverage[:, k] += some.sum(axis=1)
    return coverage if np.ndim(lineages) else coverage[:, 0]


def visit_probabilities(
    transition: LinearOperator,
    first: LinearOperator,
    steps: int,
    counted: int | None = None,
    columns: int = _COLUMNS,
) -> Iterator[tuple[Ints, Floats]]:
    """Probabilities h that one lineage visits each niche, a block of niches at a time.

    Yields
    ------
    (c,) int64 array and (m, c) float64 array
        Some niches, and h for each of the m roots.

    Notes
    -----
    With H_k[i, j] = P(j is i or occurs within k transitions from i), conditioning on the first
    transition gives H_k = T · H_{k−1} with its diagonal set to 1, until no entry grows by more than
    rounding: the largest growth of all entries never grows again. Columns of H do not depend on
    each other, so a block of them at a time bounds the memory.
    """
    states = transition.shape[0]
    niches = _counted(counted, states)
    check_at_least(1, columns=columns)
    transition, first = _faster(transition), _faster(first)
    for start in range(0, niches, columns):
        targets = np.arange(start, min(start + columns, niches))
        hit = np.zeros((states, targets.size))
        hit[targets, targets - start] = 1.0
        for step in range(steps - 1):
            before = hit
            hit = _columns(transition, hit, targets) if step == 0 else transition @ hit
            # A lineage that stands on its target has visited it, wherever it goes next.
            hit[targets, targets - start] = 1.0
            if step % _LOOK == _LOOK - 1 and np.abs(hit - before).max() <= _SETTLED:
                break
        yield targets, first @ hit


def coverage_by_generation(
    transition: LinearOperator,
    roots: ArrayLike,
    longest: int,
    lineages: ArrayLike,
    counted: int,
    *,
    first: Floats | None = None,
) -> Floats:
    """Expected niches that lineages of roots visit, for every length up to the longest.

    Parameters
    ----------
    transition : (S, S) row-stochastic matrix
    roots : (m,) ints
        States that the roots stand in; generation 1 is drawn from their rows.
    longest : int
        Generations l of the longest lineage, at least 1.
    lineages : (k,) ints
        Numbers U of lineages, each at least 1.
    counted : int
        Only the first so many states are niches that count.
    first : (m, S) array, optional
        What generation 1 is drawn from, where that is not the rows of T.

    Returns
    -------
    (m, longest, k) float64 array
        Entry [i, g − 1, u] is what :func:`expected_coverage` gives for g
        generations.

    Notes
    -----
    With first rows out of T itself, T · H_{g−1} is at once the answer for g generations and, its
    diagonal set to 1, the H_g of the next: all lengths cost no more than the longest.
    """
    states = as_whole("roots", roots)
    size = transition.shape[0]
    if states.ndim != 1 or ((states < 0) | (states >= size)).any():
        raise NichechainError(f"roots are {states.tolist()}, but must be states from 0 to {size - 1}")
    counted = _counted(counted, size)
    sizes = _sizes(lineages)
    check_at_least(1, longest=longest)
    most = _MOST_KEPT // max(1, states.size * sizes.size)
    if longest > most:
        raise NichechainError(f"longest is {longest}, but must be at most {most}: every length is kept")
    transition, longest = _faster(transition), int(longest)
    found = np.zeros((states.size, longest, sizes.size))
    for start in range(0, counted, _COLUMNS):
        targets = np.arange(start, min(start + _COLUMNS, counted))
        hit = np.zeros((transition.shape[0], targets.size))
        hit[targets, targets - start] = 1.0
        for step in range(longest):
            begun = None if first is None else first @ hit
            hit = _columns(transition, hit, targets) if step == 0 else transition @ hit
            for k, some in enumerate(at_least_once(hit[states] if begun is None else begun, sizes)):
                found[:, step, k] += some.sum(axis=1)
            # A lineage that stands on its target has visited it, wherever it goes next.
            hit[targets, targets - start] = 1.0
    return found


def at_least_once(probability: Floats, trials: Iterable[int]) -> Iterator[Floats]:
    """P(an event of this probability happens in at least one trial), for each number of trials."""
    # log1p and expm1 keep the digits of a tiny probability, which 1 - (1 - h)**U rounds away.
    with np.errstate(divide="ignore"):
        missed = np.log1p(-np.minimum(probability, 1.0))
    for number in trials:
        yield -np.expm1(number * missed)


def sampled_coverage(
    transition: LinearOperator,
    first: Floats,
    steps: int,
    lineages: int,
    repeats: int,
    rng: np.random.Generator,
    *,
    counted: int | None = None,
    own: int | None = None,
) -> Ints:
    """Numbers of niches visited in simulations: the paper's procedure, steps 5 to 7.

    Parameters
    ----------
    transition : (S, S) row-stochastic matrix
    first : (S,) array
        Distribution of generation 1.
    steps, lineages : int
        Length and number of the walks of one repeat, at least 1.
    repeats : int
        How often to repeat, at least 1.
    rng : numpy.random.Generator
    counted : int, optional
        Only the first so many states are niches that count; by default all are.
    own : int, optional
        Where the root stands, if that is visited as well.

    Returns
    -------
    (repeats,) int64 array

    Raises
    ------
    NichechainError
        If a number is below 1, or T has too many entries to walk by.
    """
    check_at_least(1, steps=steps, lineages=lineages, repeats=repeats)
    states = transition.shape[0]
    niches = _counted(counted, states)
    found = []
    for repeat, walks in simulated_lineages(transition, first, steps, lineages, repeats, rng, _CELLS):
        seen = np.zeros((repeat[-1] + 1, states), bool)
        for here in walks:
            seen[repeat, here] = True
        if own is not None:
            seen[:, own] = True
        found.append(np.count_nonzero(seen[:, :niches], axis=1))
    return np.concatenate(found)


def simulated_lineages(
    transition: LinearOperator,
    first: Floats,
    steps: int,
    lineages: int,
    repeats: int,
    rng: np.random.Generator,
    cells: int,
) -> Iterator[tuple[Ints, Iterator[Ints]]]:
    """Lineages of one root, some repeats at a time.

    Parameters
    ----------
    transition, first, steps, lineages, repeats, rng
        As in :func:`sampled_coverage`.
    cells : int
        Cells of a table (repeats, states), and lineages, that are simulated at once.

    Yields
    ------
    (N,) int64 array
        The repeat that each lineage belongs to, counted from 0 again each time.
    iterator of (N,) int64 arrays
        Their states, step after step: to be exhausted before the next repeats are asked for.
    """
    if lineages > _MOST_WALKS:
        raise NichechainError(f"lineages is {lineages}, but must be at most {_MOST_WALKS} to be simulated")
    steps, lineages, repeats = int(steps), int(lineages), int(repeats)
    onward, begin = RowSampler(entries(transition)), RowSampler(first[None, :])
    at_once = max(1, cells // max(transition.shape[0], lineages))
    for done in range(0, repeats, at_once):
        repeat = np.repeat(np.arange(min(at_once, repeats - done)), lineages)
        start = begin.draw(np.zeros(repeat.size, np.int64), rng)
        yield repeat, onward.walk(start, steps, rng)


def entries(transition: LinearOperator) -> sparse.csr_array:
    """The entries of a matrix, to walk by.

    Raises
    ------
    NichechainError
        If it is neither an array nor sparse.
    """
    if not (isinstance(transition, np.ndarray) or sparse.issparse(transition)):
        raise NichechainError(
            f"T has {transition.shape[0]} states and too many entries to simulate walks: "
            "ask for the exact value, or for fewer niches"
        )
    return sparse.csr_array(transition)


def rarefied_coverage(counts: ArrayLike, size: int, *, counted: int | None = None) -> float:
    """Expected number of niches among ``size`` of the offspring, drawn without replacement.

    Parameters
    ----------
    counts : (S,) ints
        Offspring observed in each state.
    size : int
        Between 1 and their sum.
    counted : int, optional
        Only the first so many states are niches that count; by default all are.

    Returns
    -------
    float
        The observed number of niches, exactly, where ``size`` is the sum.

    Raises
    ------
    NichechainError
        If ``size`` is out of range.

    Notes
    -----
    E = Σ_j 1 − C(m − c_j, U) / C(m, U); Hurlbert (1971), "The nonconcept of species diversity".
    """
    check_whole(size=size)
    observed = as_whole("counts", counts)
    if observed.ndim != 1 or (observed < 0).any():
        raise NichechainError("counts must be one number per state, none of them negative")
    total = int(observed.sum())
    if not 1 <= size <= total:
        raise NichechainError(f"size is {size}, but must be between 1 and the {total} offspring observed")
    return distinct_among(observed[: _counted(counted, observed.size)], total, size)


def _sizes(lineages: ArrayLike) -> Ints:
    """Numbers of lineages, (k,); a single one must be whole by its type, as steps must."""
    if np.ndim(lineages) == 0:
        check_whole(lineages=lineages)
    sizes = np.atleast_1d(as_whole("lineages", lineages))
    if sizes.ndim != 1 or not sizes.size:
        raise NichechainError(f"lineages has shape {sizes.shape}, but must be one or more numbers")
    check_at_least(1, lineages=int(sizes.min()))
    return sizes


def _counted(counted: int | None, states: int) -> int:
    """How many of the first states are niches that count."""
    if counted is None:
        return states
    check_whole(counted=counted)
    if not 0 <= counted <= states:
        raise NichechainError(f"counted is {counted}, but must be from 0 to the number of states, {states}")
    return counted


def _columns(transition: LinearOperator, unit: Floats, targets: Ints) -> Floats:
    """Neighbouring columns of T, (S, c): its product with the unit vectors of these targets."""
    if isinstance(transition, np.ndarray):
        return transition[:, targets[0] : targets[-1] + 1].copy()
    return transition @ unit


def _faster(transition: LinearOperator) -> LinearOperator:
    """The matrix in the form that multiplies faster."""
    if sparse.issparse(transition) and transition.nnz > _DENSE * math.prod(transition.shape):  # type: ignore[attr-defined]
        dense: Floats = transition.toarray()  # type: ignore[attr-defined]
        return dense
    return transition
