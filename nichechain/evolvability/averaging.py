"""One root at a time: averages over draws of what births leave unknown."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain, Transition
from nichechain.core.intervals import drawn_interval, no_interval
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.coverage import at_least_once, expected_coverage, sampled_coverage
from nichechain.evolvability.question import MOST_EXACT, Question
from nichechain.evolvability.reach import MOST_POWERS, visit_probability
from nichechain.evolvability.results import Evolvability
from nichechain.execution.side_by_side import side_by_side

Floats = NDArray[np.float64]
Sample: TypeAlias = tuple[Transition, Floats]

# Lineages without end: what they visit in expectation is all that can be visited.
ENDLESS = 10**9
SATURATED = 0.95
# Share of entries, and steps, up to which one root is followed through a sparse T of many states.
_SPARSE, _FEW_STEPS = 0.02, 100


def one_root(
    chain: NicheChain,
    sample: Callable[[int], Sample],
    samples: int,
    question: Question,
    repeats: int,
    own: int | None = None,
    on_done: Callable[[int], None] | None = None,
) -> Evolvability:
    """Evolvability of one root over samples of T and of generation 1, (S,), and of where it stands itself."""
    n, steps = chain.n_niches, question.drawn_steps(own)
    stands = None if own is None else np.array([own])

    def on_sample(number: int) -> tuple[float, float, bool]:
        matrix, first = sample(number)
        if question.method == "monte-carlo":
            rng = keyed(question.seed, Purpose.WALKS, number)
            sampled = sampled_coverage(
                matrix, first, steps, question.lineages, repeats, rng, counted=n, own=own
            )
            return float(sampled.mean()), standard_error(sampled), False
        if own is None and _is_quick(matrix, steps):
            visit, _ = visit_probability(matrix, first, steps)
            some = at_least_once(visit[:n], [question.lineages, ENDLESS])
            covered, endless = (float(each.sum()) for each in some)
        else:
            covered, endless = expected_coverage(
                matrix, first[None, :], steps, [question.lineages, ENDLESS], counted=n, own=stands
            )[0]
        return float(covered), 0.0, bool(covered > SATURATED * endless)

    found = side_by_side(on_sample, range(samples), on_done)
    means, errors, full = zip(*found, strict=True)
    saturated = any(full)
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


def _is_quick(matrix: Transition, steps: int) -> bool:
    """Whether one root is followed with fewer operations than all are.

    In a sparse T of many states cost follows those that are seen; in a whole one half the products suffice.
    """
    if isinstance(matrix, np.ndarray):
        return steps <= MOST_POWERS
    if not isinstance(matrix, sparse.csr_array) or matrix.shape[0] <= MOST_EXACT:
        return False
    return steps <= _FEW_STEPS and bool(matrix.nnz <= _SPARSE * matrix.shape[0] ** 2)


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
