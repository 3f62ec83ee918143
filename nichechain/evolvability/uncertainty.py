"""What else leaves a niche's l-evolvability open: the prior, and which elites there happened to be.

Posterior draws tell what births leave open once the prior is chosen and elites are taken for a fair
sample of their niche. A band over priors questions the first, a bootstrap over elites the second.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from nichechain.births.families import elites_of, redrawn
from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.estimators import estimate, refitted, with_posterior
from nichechain.chain.families import counts_of_families, families_of
from nichechain.chain.model import NicheChain
from nichechain.chain.posterior import DirichletPosterior
from nichechain.core.checks import check_at_least, check_fits, check_numbers
from nichechain.core.errors import NichechainError
from nichechain.core.intervals import drawn_interval
from nichechain.core.randomness import Purpose, keyed
from nichechain.core.text import rounded
from nichechain.evolvability.niches import answer_for_niches
from nichechain.evolvability.question import DRAWS, Convention, Question, told

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RESAMPLES = 50
"""Of a bootstrap over elites, unless told otherwise."""

BandKind = Literal["prior sensitivity", "bootstrap over elites"]


@dataclass(frozen=True)
class NicheBand:
    """l-evolvability of every niche between two bounds, and what these are bounds of.

    Parameters
    ----------
    kind : {"prior sensitivity", "bootstrap over elites"}
    value : (n_niches,) float64 array
        Posterior mean under the fitted prior, in niches.
    low, high : (n_niches,) float64 arrays
        Smallest and largest value over the fits, or the 90 % interval of the bootstrap.
    fits : tuple of str
        The priors tried, the fitted one among them; empty for the bootstrap.
    """

    kind: BandKind
    value: Floats
    low: Floats
    high: Floats
    fits: tuple[str, ...] = ()


def prior_sensitivity(
    counts: TransitionCounts,
    *,
    l: int = 5,
    lineages: int = 100,
    convention: Convention = "definition",
    draws: int = 20,
    seed: int = 0,
    factor: float = 4.0,
    on_done: Callable[[int], None] | None = None,
) -> NicheBand:
    """How far l-evolvability moves if the empirical-Bayes prior had been another.

    Parameters
    ----------
    counts : TransitionCounts
    l, lineages, convention
        As in :func:`l_evolvability`.
    draws : int
        Posterior draws of T for each fit.
    seed : int
        Of the draws, which have the same keys under every fit.
    factor : float
        The strength is divided and multiplied by this, greater than 1.
    on_done : callable, optional
        Told how many more of the five fits are done.

    Returns
    -------
    NicheBand
        Of kind ``prior sensitivity``: smallest and largest value over five fits. These have a
        smaller, the fitted and a larger strength; and the fitted strength with all that the mixture
        gives to destination and displacement moved to the one or to the other.

    Raises
    ------
    NichechainError
        If an argument is out of range.

    Notes
    -----
    Source: robust Bayesian analysis over a class of priors, Berger (1985), Statistical Decision
    Theory and Bayesian Analysis, section 4.7. The band is no interval of a given probability. It
    contains the error of the draws, which :attr:`NicheEvolvability.standard_error` tells.
    """
    question = Question(l, lineages, convention, draws=draws, seed=seed)
    check_numbers(factor=factor)
    if not (math.isfinite(factor) and factor > 1):
        raise NichechainError(f"factor is {factor:g}, but must be a number greater than 1")
    fitted = estimate(counts).posterior
    assert fitted is not None
    # The others are given as they are: no draw has a base and a strength of its own.
    given = replace(fitted, prior=None)
    base, strength = fitted.base, fitted.strength
    rest = float(base.weights[2])
    priors = {
        "fitted": fitted,
        f"strength / {factor:g}": replace(given, strength=strength / factor),
        f"strength x {factor:g}": replace(given, strength=strength * factor),
        "all destination": replace(given, base=_only(base, np.array([1.0 - rest, 0.0, rest]))),
        "all displacement": replace(given, base=_only(base, np.array([0.0, 1.0 - rest, rest]))),
    }
    chain = _chain(fitted)
    question.warn_if_long(chain, chain.n_niches, len(priors) * question.draws)
    fits = told((_chain(posterior) for posterior in priors.values()), on_done)
    values = np.array([answer_for_niches(fit, question, announced=True).value for fit in fits])
    return NicheBand("prior sensitivity", values[0], values.min(axis=0), values.max(axis=0), tuple(priors))


def bootstrap_elites(
    counts: TransitionCounts,
    *,
    resamples: int = RESAMPLES,
    l: int = 5,
    lineages: int = 100,
    convention: Convention = "definition",
    draws: int = 5,
    seed: int = 0,
    on_done: Callable[[int], None] | None = None,
) -> NicheBand:
    """How far l-evolvability moves if each niche had had other elites.

    Parameters
    ----------
    counts : TransitionCounts
        With families, which tell whose children they are.
    resamples : int
        At least 2.
    l, lineages, convention
        As in :func:`l_evolvability`.
    draws : int
        Posterior draws of T for each resample.
    seed : int
        Of resamples and draws.
    on_done : callable, optional
        Told how many more resamples are done.

    Returns
    -------
    NicheBand
        Of kind ``bootstrap over elites``.

    Raises
    ------
    NichechainError
        If an argument is out of range or births do not say whose children they are.

    Notes
    -----
    The elites of each niche are drawn with replacement, each with all its children: Efron and
    Tibshirani (1993), An Introduction to the Bootstrap, and for clusters Field and Welsh (2007),
    Journal of the Royal Statistical Society B 69, 369-390. Births that do not say whose they are
    count as elites of one child. Strength and design effect stay as all births gave them, the base
    measure is fitted again.

    Resamples hold fewer different births, which lowers every value: only their spread is used. The
    interval is the value plus the 5 % and 95 % quantiles of the resamples less their median. In a
    niche of m elites the spread is short by √((m − 1)/m), so a niche of one elite adds none.
    What the few draws of each resample leave open adds to the spread.
    """
    question = Question(l, lineages, convention, draws=draws, seed=seed)
    check_at_least(2, resamples=resamples)
    check_fits(resamples=resamples)
    if not len(counts.families):
        raise NichechainError(
            "these births do not say whose children they are, so elites cannot be resampled"
        )
    fitted = estimate(counts).posterior
    assert fitted is not None

    chain = _chain(fitted)
    question.warn_if_long(chain, chain.n_niches, DRAWS + int(resamples) * question.draws)
    value = answer_for_niches(chain, replace(question, draws=DRAWS), announced=True).value
    families = families_of(counts)
    elite = elites_of(families)

    def again_with(rng: np.random.Generator) -> Floats:
        others = counts_of_families(redrawn(families, elite, rng), counts)
        return answer_for_niches(_chain(refitted(fitted, others)), question, announced=True).value

    numbers = told(range(resamples), on_done)
    again = np.array([again_with(keyed(seed, Purpose.RESAMPLING, number)) for number in numbers])
    ends = drawn_interval(again)
    low, high = (value + end - np.median(again, axis=0) for end in ends)
    niches = len(counts.niches)
    return NicheBand("bootstrap over elites", value, np.maximum(low, 0.0), np.minimum(high, niches))


def _only(base: BaseMeasure, weights: Floats) -> BaseMeasure:
    """The base measure of its pools alone, with these weights."""
    return replace(base, weights=weights, near=None)


def _chain(posterior: DirichletPosterior) -> NicheChain:
    name = f"empirical-bayes, strength {rounded(posterior.strength)}"
    return with_posterior(posterior.counts, posterior, name)
