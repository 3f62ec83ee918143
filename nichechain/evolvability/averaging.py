"""One root at a time: averages over draws of what births leave unknown."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.model import NicheChain, Transition
from nichechain.core.intervals import drawn_interval
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.coverage import expected_coverage, sampled_coverage
from nichechain.evolvability.question import Question
from nichechain.evolvability.results import Evolvability

Floats = NDArray[np.float64]
Sample: TypeAlias = tuple[Transition, Floats]

# Lineages without end: what they visit in expectation is all that can be visited.
ENDLESS = 10**9
SATURATED = 0.95


def one_root(chain: NicheChain, samples: Iterator[Sample], question: Question, repeats: int) -> Evolvability:
    """Evolvability of one root over samples of T and of the first state that counts, (S,)."""
    n = chain.n_niches
    means, errors, saturated = [], [], False
    for number, (matrix, first) in enumerate(samples):
        if question.method != "monte-carlo":
            covered, endless = expected_coverage(
                matrix, first[None, :], question.steps, [question.lineages, ENDLESS], counted=n
            )[0]
            saturated |= bool(covered > SATURATED * endless)
            means.append(covered)
            errors.append(0.0)
        else:
            rng = keyed(question.seed, Purpose.WALKS, number)
            sampled = sampled_coverage(
                matrix, first, question.steps, question.lineages, repeats, rng, counted=n
            )
            means.append(sampled.mean())
            errors.append(standard_error(sampled))
    value, error, low, high = (float(x) for x in summary(np.array(means), np.array(errors)))
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


def standard_error(sampled: NDArray[np.int64]) -> float:
    """Of the mean of simulations; NaN for a single one."""
    size = sampled.size
    return float(sampled.std(ddof=1) / math.sqrt(size)) if size > 1 else math.nan


def summary(means: Floats, errors: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Mean over the draws along axis 0, its standard error, and the interval."""
    size = len(means)
    low, high = drawn_interval(means)
    if size == 1:
        return means[0], errors[0], low, high
    # The spread of the draws' means already has the simulations' error in it.
    return means.mean(axis=0), means.std(axis=0, ddof=1) / math.sqrt(size), low, high
