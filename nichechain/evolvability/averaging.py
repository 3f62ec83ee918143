"""One root, or a matrix, at a time: averages over draws of what births leave unknown."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.model import Matrix, NicheChain
from nichechain.core.checks import check_whole
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.coverage import check_lengths, expected_coverage, sampled_coverage
from nichechain.evolvability.results import Evolvability
from nichechain.evolvability.roots import generations

Floats = NDArray[np.float64]
Sample: TypeAlias = tuple[Matrix, Floats]
Method = Literal["exact", "monte-carlo"]
Convention = Literal["definition", "procedure"]

DRAWS = 50
"""Posterior draws of T that a value is averaged over."""
_INTERVAL = (0.05, 0.95)
# Lineages without end: what they visit in expectation is all that can be visited.
ENDLESS = 10**9
SATURATED = 0.95


def one_root(
    chain: NicheChain,
    samples: Iterator[Sample],
    l: int,  # noqa: E741
    lineages: int,
    method: str,
    convention: str,
    repeats: int,
    seed: int,
) -> Evolvability:
    """Evolvability of one root over samples of T and of the distribution of generation 1."""
    states_counted = generations(l, convention)
    n = chain.n_niches
    means, errors, saturated = [], [], False
    for number, (matrix, first) in enumerate(samples):
        if method == "exact":
            covered, endless = expected_coverage(
                matrix, first, states_counted, [lineages, ENDLESS], counted=n
            )[0]
            saturated |= bool(covered > SATURATED * endless)
            means.append(covered)
            errors.append(0.0)
        else:
            rng = keyed(seed, Purpose.WALKS, number)
            sampled = sampled_coverage(matrix, first[0], states_counted, lineages, repeats, rng, counted=n)
            means.append(sampled.mean())
            errors.append(standard_error(sampled))
    value, error, low, high = (float(x) for x in summary(np.array(means), np.array(errors)))
    return Evolvability(
        value, error, low, high, l, lineages, method, convention, chain.estimator, None, saturated
    )


def standard_error(sampled: NDArray[np.int64]) -> float:
    """Of the mean of simulations; NaN for a single one."""
    size = sampled.size
    return float(sampled.std(ddof=1) / math.sqrt(size)) if size > 1 else math.nan


def summary(means: Floats, errors: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Mean over the draws along axis 0, its standard error, and the interval."""
    size = len(means)
    low, high = np.quantile(means, _INTERVAL, axis=0)
    if size == 1:
        return means[0], errors[0], low, high
    # The spread of the draws' means already has the simulations' error in it.
    return means.mean(axis=0), means.std(axis=0, ddof=1) / math.sqrt(size), low, high


def repeats_per_draw(repeats: int, chain: NicheChain, draws: int) -> int:
    """Simulations on each draw of T, so that all draws together have as many as asked for."""
    return repeats if chain.posterior is None else max(1, math.ceil(repeats / draws))


def check(
    l: int,  # noqa: E741
    lineages: int,
    method: str,
    convention: str,
    repeats: int,
    draws: int,
) -> None:
    """Refuse numbers out of range and unknown names."""
    check_lengths(l, lineages)
    for name, value, allowed in (
        ("method", method, get_args(Method)),
        ("convention", convention, get_args(Convention)),
    ):
        if value not in allowed:
            raise NichechainError(f"{name} is {value!r}, but must be one of {', '.join(allowed)}")
    check_whole(repeats=repeats, draws=draws)
    for name, number in (("repeats", repeats), ("draws", draws)):
        if number < 1:
            raise NichechainError(f"{name} is {number}, but at least 1 is needed")
