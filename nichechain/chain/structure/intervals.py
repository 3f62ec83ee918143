"""How sure an answer is: the same question asked of many chains that births allow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.chain.model import NicheChain
from nichechain.core.checks import as_floats, check_at_least, check_numbers, check_seed, shown
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PosteriorInterval:
    """An answer over posterior draws of T, each array in the shape of the answer.

    Parameters
    ----------
    mean, low, high : float64 arrays
        Mean over the draws, and the bounds of the central interval. Infinite where too many draws
        have no finite answer.
    level : float
        Posterior probability that the interval holds the answer, one number at a time.
    draws : int
        The draws that this comes from.
    """

    mean: Floats
    low: Floats
    high: Floats
    level: float
    draws: int


def posterior_interval(
    chain: NicheChain,
    question: Callable[[NicheChain], ArrayLike],
    *,
    draws: int = 100,
    level: float = 0.9,
    seed: int = 0,
) -> PosteriorInterval:
    """Ask a question of draws of T from its posterior, and say between which bounds answers lie.

    Parameters
    ----------
    chain : NicheChain
        Estimated with a posterior.
    question : callable
        Takes a NicheChain whose T is given and returns a number, or an array that has the same shape
        for every draw. Any function of this package will do, with its other arguments filled in:
        ``lambda c: mean_first_passage_times(c, 17)``.
    draws : int
        At least 2. A draw in 20 lies beyond each end of a 90 % interval, so take 40 or more.
    level : float
        Above 0 and below 1.
    seed : int
        Draw k comes from ``keyed(seed, Purpose.POSTERIOR, k)``, as those of l-evolvability do.

    Returns
    -------
    PosteriorInterval

    Raises
    ------
    NichechainError
        If the chain has no posterior, an argument is out of range, or answers differ in shape.

    Notes
    -----
    Draws of T and what follows from each are draws from the posterior of the answer (Gelman et al.,
    Bayesian Data Analysis, section 1.9). The k-th smallest of n draws estimates the quantile
    k / (n + 1) (Weibull 1939), which makes the interval hold its level also for few draws. The
    interval says what births leave open if the estimator's model is right.
    """
    if not callable(question):
        raise NichechainError(f"question is {shown(question)}, but must be a function of a chain")
    check_at_least(2, draws=draws)
    check_numbers(level=level)
    if not 0.0 < level < 1.0:
        raise NichechainError(f"level is {level}, but must be above 0 and below 1")
    check_seed(seed)
    if chain.posterior is None:
        raise NichechainError(
            f"an interval needs a chain with a posterior, but this one is {chain.estimator}: "
            "estimate it with empirical-bayes or dirichlet"
        )
    answers: list[Floats] = []
    for number in range(draws):
        drawn = NicheChain(
            chain.posterior.draw(keyed(seed, Purpose.POSTERIOR, number)),
            niches=chain.niches,
            outside=chain.outside,
            estimator=f"draw {number} of {chain.estimator}",
        )
        answer = as_floats("the answer", question(drawn))
        if answers and answer.shape != answers[0].shape:
            raise NichechainError(
                f"the answer has shape {answer.shape} for draw {number} and {answers[0].shape} for "
                "the first, but must have one shape: ask about one root, or one target"
            )
        answers.append(answer)
    ordered = np.sort(answers, axis=0)
    tail = 0.5 * (1.0 - level)
    return PosteriorInterval(
        ordered.mean(axis=0), _quantile(ordered, tail), _quantile(ordered, 1.0 - tail), level, draws
    )


def _quantile(ordered: Floats, share: float) -> Floats:
    """Quantile of sorted draws (n, ...), some of which may be infinite."""
    place = min(max(share * (len(ordered) + 1) - 1.0, 0.0), len(ordered) - 1.0)
    below, above = ordered[int(np.floor(place))], ordered[int(np.ceil(place))]
    with np.errstate(invalid="ignore"):
        # Between two infinite draws there is nothing to interpolate.
        between: Floats = np.where(below == above, below, below + (place % 1.0) * (above - below))
    return np.where(np.isnan(ordered).any(axis=0), np.nan, between)
