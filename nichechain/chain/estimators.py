"""Estimators of T: counts in, an immutable chain out."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.lineages import fitted_law
from nichechain.chain.model import NicheChain, Transition
from nichechain.chain.operator import PooledTransition
from nichechain.chain.posterior import DirichletPosterior
from nichechain.chain.prior import fit_prior
from nichechain.core.checks import check_choice, check_positive, shown
from nichechain.core.errors import NichechainError
from nichechain.core.text import rounded

Floats = NDArray[np.float64]

Estimator = Literal["empirical-bayes", "dirichlet", "mle"]
Unvisited = Literal["self", "uniform", "base", "absorb"]
# Numbers in rows that are filled whole, above which they are kept as one row that they share.
_FILLED = 20_000_000

ESTIMATORS: tuple[str, ...] = get_args(Estimator)
"""What T can be estimated by."""
UNVISITED: tuple[str, ...] = get_args(Unvisited)
"""What a row of T can be where no child was born."""


def estimate(
    counts: TransitionCounts,
    estimator: Estimator = "empirical-bayes",
    *,
    unvisited: Unvisited | None = None,
    strength: float | str | None = None,
) -> NicheChain:
    """Estimate the chain behind births.

    Parameters
    ----------
    counts : TransitionCounts
    estimator : {"empirical-bayes", "dirichlet", "mle"}
        ``empirical-bayes``: a Dirichlet posterior for every row around a base measure pooled over
        all rows, with children of one elite counted as related, and lineages as births of lineages
        show them where there are any (:mod:`nichechain.chain.lineages`). ``dirichlet``: the same around
        the uniform distribution, every birth counting in full. ``mle``: row-normalised counts,
        the paper's literal T.
    unvisited : {"self", "uniform", "base", "absorb"}, optional
        For ``mle`` only, what a row without births does: stay (default), go anywhere, go where
        children land in general, or leave for good to the outside state.
    strength : float or {"jeffreys", "1/n"}, optional
        How many births the base measure is worth. For ``empirical-bayes`` a number; by default
        that which makes the births most likely. For ``dirichlet`` a number, ``jeffreys`` for half
        a birth in every state, or ``1/n`` (default) for one birth in all.

    Returns
    -------
    NicheChain

    Raises
    ------
    NichechainError
        If an argument is unknown or belongs to another estimator.
    """
    if not isinstance(counts, TransitionCounts):
        raise NichechainError(
            f"counts is of type {type(counts).__name__}, but must be TransitionCounts: "
            "TransitionCounts.from_matrix makes them of a matrix of counts, "
            "and NicheChain(T) takes a matrix of probabilities"
        )
    check_choice("estimator", estimator, ESTIMATORS)
    if estimator == "mle":
        if strength is not None:
            raise NichechainError("strength belongs to empirical-bayes and dirichlet, not to mle")
        return _mle(counts, "self" if unvisited is None else unvisited)
    if unvisited is not None:
        raise NichechainError(f"unvisited belongs to mle: {estimator} has a posterior for every row")
    if estimator == "dirichlet":
        return _dirichlet(counts, "1/n" if strength is None else strength)
    if isinstance(strength, str):
        raise NichechainError(f"strength is {shown(strength)}, but must be a number for empirical-bayes")
    return _empirical_bayes(counts, strength)


def _mle(counts: TransitionCounts, unvisited: str) -> NicheChain:
    check_choice("unvisited", unvisited, UNVISITED)
    states = counts.niches.states
    has_outside = states > len(counts.niches)
    if unvisited == "absorb" and not has_outside:
        raise NichechainError("unvisited is 'absorb', but these niches have no outside state to go to")
    births = counts.births.astype(np.float64)
    empty = np.flatnonzero(births == 0)
    if counts.niches.outside == "absorb":
        empty = empty[empty < states - 1]
    per_row: Floats = np.divide(1.0, births, out=np.zeros(states), where=births > 0)
    if counts.niches.outside == "absorb":
        per_row[states - 1] = 0.0
    observed = sparse.diags_array(per_row) @ counts.matrix
    filler = sparse.lil_array((states, states))
    shared = np.zeros(states)
    match unvisited:
        case "self":
            filler[empty, empty] = 1.0
        case "absorb":
            filler[empty, states - 1] = 1.0
        case "uniform":
            shared[:] = 1.0 / states
        case "base":
            landed = np.bincount(counts.matrix.indices, counts.matrix.data, states)
            if not landed.sum():
                raise NichechainError("unvisited is 'base', but no birth says where children land")
            shared = landed / landed.sum()
    whole = shared.any() and empty.size * states <= _FILLED
    if whole:
        filler[empty] = shared
    if counts.niches.outside == "absorb":
        filler[states - 1, states - 1] = 1.0
    transition: Transition = (observed + filler.tocsr()).tocsr()
    if shared.any() and not whole:
        share = np.zeros(states)
        share[empty] = 1.0
        transition = PooledTransition.shared(transition, share, shared)
    return NicheChain(
        transition,
        niches=counts.niches,
        outside=states - 1 if has_outside else None,
        counts=counts,
        estimator=f"mle, unvisited rows: {unvisited}",
    )


def _dirichlet(counts: TransitionCounts, strength: float | str) -> NicheChain:
    states = counts.niches.states
    if isinstance(strength, str):
        if strength not in ("jeffreys", "1/n"):
            raise NichechainError(
                f"strength is {shown(strength)}, but must be a positive number, jeffreys or 1/n"
            )
        # Half a birth, or an n-th of one, in every state.
        size = states / 2.0 if strength == "jeffreys" else 1.0
    else:
        size = _positive(strength)
    base = BaseMeasure.pooled(counts, np.array([0.0, 0.0, 1.0]))
    posterior = DirichletPosterior(counts, base, size, np.ones(states))
    return with_posterior(counts, posterior, f"dirichlet, uniform base, strength {rounded(size)}")


def _empirical_bayes(counts: TransitionCounts, strength: float | None) -> NicheChain:
    prior = fit_prior(counts, None if strength is None else _positive(strength))
    effect = prior.design_effect
    posterior = DirichletPosterior.of(counts, prior)
    posterior = replace(posterior, law=fitted_law(posterior))
    births = counts.births
    typical = (births * effect).sum() / max(1, births.sum())
    related = f", {typical:.2g} births count as one" if typical >= 1.05 else ""
    law = posterior.law
    checked = (
        "" if law is None else f", calibrated on lineages of {law.broods} elite{'s' * (law.broods != 1)}"
    )
    name = f"empirical-bayes, strength {rounded(prior.strength)}{related}{checked}"
    return with_posterior(counts, posterior, name)


def refitted(posterior: DirichletPosterior, counts: TransitionCounts) -> DirichletPosterior:
    """The same strength, design effect and weights for other counts, and the base that these give."""
    assert posterior.prior is not None
    base = fit_prior(counts, posterior.strength, posterior.prior.weights).base
    return replace(posterior, counts=counts, base=base, prior=None)


def with_posterior(counts: TransitionCounts, posterior: DirichletPosterior, name: str) -> NicheChain:
    """The chain of counts and of a posterior for T, under the estimator's name."""
    states = counts.niches.states
    return NicheChain(
        posterior=posterior,
        niches=counts.niches,
        outside=states - 1 if states > len(counts.niches) else None,
        counts=counts,
        estimator=name,
    )


def _positive(strength: float) -> float:
    check_positive(strength=strength)
    return float(strength)
