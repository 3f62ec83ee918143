"""One root at a time: averages over draws of what births leave unknown."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain, Transition
from nichechain.core.intervals import drawn_interval, no_interval
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.coverage import at_least_once, expected_coverage, sampled_coverage
from nichechain.evolvability.question import MOST_EXACT, Question
from nichechain.evolvability.reach import visit_probability
from nichechain.evolvability.results import Evolvability

Floats = NDArray[np.float64]
Sample: TypeAlias = tuple[Transition, Floats]

# Lineages without end: what they visit in expectation is all that can be visited.
ENDLESS = 10**9
SATURATED = 0.95
# Share of entries, and steps, up to which one root is followed through a sparse T of many states.
_SPARSE, _FEW_STEPS = 0.02, 100


def one_root(
    chain: NicheChain, samples: Iterator[Sample], question: Question, repeats: int, own: int | None = None
) -> Evolvability:
    """Evolvability of one root over samples of T and of generation 1, (S,), and of where it stands itself."""
    n, steps = chain.n_niches, question.drawn_steps(own)
    stands = None if own is None else np.array([own])
    means, errors, saturated = [], [], False
    for number, (matrix, first) in enumerate(samples):
        if question.method != "monte-carlo":
            if own is None and _is_sparse(matrix) and steps <= _FEW_STEPS:
                # From one root few states are seen: cost follows them, not all that there are.
                visit, _ = visit_probability(matrix, first, steps)
                some = at_least_once(visit[:n], [question.lineages, ENDLESS])
                covered, endless = (float(each.sum()) for each in some)
            else:
                covered, endless = expected_coverage(
                    matrix, first[None, :], steps, [question.lineages, ENDLESS], counted=n, own=stands
                )[0]
            saturated |= bool(covered > SATURATED * endless)
            means.append(covered)
            errors.append(0.0)
        else:
            rng = keyed(question.seed, Purpose.WALKS, number)
            sampled = sampled_coverage(
                matrix, first, steps, question.lineages, repeats, rng, counted=n, own=own
            )
            means.append(sampled.mean())
            errors.append(standard_error(sampled))
    figures = summary(np.array(means), np.array(errors), spread_of(chain), n)
    value, error, low, high = (float(x) for x in figures)
    return Evolvability(
        value,
        error,
        low,
        high,
        question.l,
        question.lineages,
        "exact" if question.method == "auto" else question.method,
        question.convention,
        chain.estimator,
        None,
        saturated,
    )


def _is_sparse(matrix: Transition) -> bool:
    """Whether T is a sparse matrix of many states, each of which leads to few."""
    if not isinstance(matrix, sparse.csr_array) or matrix.shape[0] <= MOST_EXACT:
        return False
    return bool(matrix.nnz <= _SPARSE * matrix.shape[0] ** 2)


def standard_error(sampled: NDArray[np.int64]) -> float:
    """Of the mean of simulations; NaN for a single one."""
    size = sampled.size
    return float(sampled.std(ddof=1) / math.sqrt(size)) if size > 1 else math.nan


def spread_of(chain: NicheChain) -> float:
    """How many times wider elites differ than draws do, see :class:`nichechain.chain.lineages.LineageLaw`."""
    law = None if chain.posterior is None else chain.posterior.law
    return 1.0 if law is None else law.spread


def widened(mean: Floats, low: Floats, high: Floats, spread: float, most: int) -> tuple[Floats, Floats]:
    """An interval around a mean made so many times wider, within 0 and ``most`` niches."""
    if spread == 1.0:
        return low, high
    return np.maximum(mean - spread * (mean - low), 0.0), np.minimum(mean + spread * (high - mean), most)


def summary(
    means: Floats, errors: Floats, spread: float = 1.0, most: int = 0
) -> tuple[Floats, Floats, Floats, Floats]:
    """Mean over the draws along axis 0, its standard error, and the interval, see :func:`widened`."""
    size = len(means)
    if size == 1:
        return means[0], errors[0], *no_interval(means[0])
    low, high = widened(means.mean(axis=0), *drawn_interval(means), spread, most)
    # The spread of the draws' means already has the simulations' error in it.
    return means.mean(axis=0), means.std(axis=0, ddof=1) / math.sqrt(size), low, high
