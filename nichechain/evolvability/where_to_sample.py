"""Where more births would tell most: how l-evolvability depends on each row of T."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.model import Matrix, NicheChain, Transition
from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError
from nichechain.evolvability.coverage import expected_coverage
from nichechain.evolvability.question import DRAWS, Convention, Question
from nichechain.niches import Niche

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]

_COLUMNS = 128
# The derivative costs so many times what l-evolvability itself does.
_DERIVATIVE = 3
# What a derivative may keep of all generations, for one block of niches.
_MOST_BYTES = 2**30


def where_to_sample(
    chain: NicheChain,
    *,
    niche: Niche | None = None,
    l: int = 5,
    lineages: int = 100,
    convention: Convention = "definition",
    births: int = 1,
    draws: int = DRAWS,
    seed: int = 0,
) -> pd.DataFrame:
    """Rows of T, those first whose births would narrow l-evolvability most.

    Parameters
    ----------
    chain : NicheChain
        Estimated with a posterior.
    niche : int or tuple of int, optional
        The niche whose l-evolvability is asked for; by default the mean over all niches.
    l, lineages, convention
        As in :func:`nichechain.l_evolvability`.
    births : int
        How many more births of a row to judge it by, at least 1.
    draws, seed : int
        Posterior draws that tell how uncertain l-evolvability is as a whole, at least 2.

    Returns
    -------
    pandas.DataFrame
        One row for each state: ``state`` and its label ``index``; ``births`` and ``visits`` so
        far (a state without visits has no elite that could be a parent); ``sensitivity``, the
        standard deviation of the derivative over where one child lands, in niches; ``share``, the
        row's part in the posterior variance of l-evolvability; ``variance``, that part in niches
        squared; ``narrowing``, by how much so many more births of the row are expected to lower
        that variance.

    Raises
    ------
    NichechainError
        If the chain has no posterior, or an argument is out of range.

    Notes
    -----
    The delta method at the posterior mean of T tells rows apart: with g the derivative of
    l-evolvability by row i and p the row's mean, a Dirichlet row of total α contributes
    Var_p(g) / (α + 1), and rows are independent, so that their parts add up. Their sum is too
    large, twice in standard deviation on the shipped archive, because l-evolvability saturates
    where draws put a lump of probability; so the parts are scaled to the variance over posterior
    draws. Of its part, m births with a design effect of e are expected to take away a share
    m / (m + e α), as the posterior mean of a Dirichlet row is linear in what is seen. Memory and
    time are those of dense (S, S) matrices.
    """
    import pandas as pd

    check_at_least(1, births=births)
    check_at_least(2, draws=draws)
    question = Question(l, lineages, convention, draws=draws, seed=seed)
    if chain.posterior is None or chain.counts is None:
        raise NichechainError(
            f"more births narrow nothing in a chain that is {chain.estimator}: "
            "estimate it with empirical-bayes or dirichlet"
        )
    posterior = chain.posterior
    _in_closed_form(question).warn_if_long(chain, samples=_DERIVATIVE + draws)
    mean = posterior.mean()
    slope = _derivative(chain, niche, question)
    spread = np.maximum((mean * slope**2).sum(axis=1) - (mean * slope).sum(axis=1) ** 2, 0.0)
    total = np.asarray(posterior.weights.sum(axis=1)).ravel() + posterior.strength
    parts = spread / (total + 1.0)
    share = parts / parts.sum() if parts.any() else parts
    weight = _weight(chain, niche)
    values = [
        _evolvability(transition, weight, question, chain.n_niches)
        for transition in question.transitions(chain)
    ]
    variance = share * np.var(values, ddof=1)
    frame = pd.DataFrame(
        {
            "state": np.arange(chain.states),
            "index": [chain.label(state) for state in range(chain.states)],
            "births": chain.counts.births,
            "visits": chain.counts.visits,
            "sensitivity": np.sqrt(spread),
            "share": share,
            "variance": variance,
            "narrowing": variance * births / (births + posterior.design_effect * total),
        }
    )
    return frame.sort_values("narrowing", ascending=False, kind="stable").reset_index(drop=True)


def evolvability_derivative(
    chain: NicheChain,
    *,
    niche: Niche | None = None,
    l: int = 5,
    lineages: int = 100,
    convention: Convention = "definition",
) -> Floats:
    """Derivative of l-evolvability by every entry of T.

    Parameters
    ----------
    chain : NicheChain
        Its T, which is the posterior mean where it is estimated.
    niche, l, lineages, convention
        As in :func:`where_to_sample`.

    Returns
    -------
    (S, S) float64 array
        Each entry taken as free; since rows sum to 1, only differences within a row mean
        something.

    Raises
    ------
    NichechainError
        If an argument is out of range or there is no such niche.

    Notes
    -----
    The adjoint of the recursion of :func:`nichechain.evolvability.coverage.visit_probabilities`, run
    backwards for a block of target niches at a time: all S² derivatives for about three times the work of
    l-evolvability itself, and as many products of dense matrices as there are generations.
    """
    question = Question(l, lineages, convention)
    _in_closed_form(question).warn_if_long(chain, samples=_DERIVATIVE)
    return _derivative(chain, niche, question)


def _in_closed_form(question: Question) -> Question:
    """The question as it is answered here, however many states there are."""
    return replace(question, method="exact")


def _derivative(chain: NicheChain, niche: Niche | None, question: Question) -> Floats:
    states, n = chain.states, chain.n_niches
    weight = _weight(chain, niche)
    most = max(1, _MOST_BYTES // (8 * states * min(n, _COLUMNS)))
    if question.steps > most:
        raise NichechainError(
            f"l is {question.l}, but the derivative keeps what each generation visits: "
            f"of {states} states there is room for {most} generations"
        )
    matrix = chain.T
    back: Matrix = matrix.T if isinstance(matrix, np.ndarray) else sparse.csr_array(matrix.T)
    slope = np.zeros((states, states))
    for start in range(0, n, _COLUMNS):
        targets = np.arange(start, min(start + _COLUMNS, n))
        on_target = targets, targets - start
        hits = [np.zeros((states, targets.size))]
        hits[0][on_target] = 1.0
        for _ in range(question.steps - 1):
            onward = matrix @ hits[-1]
            onward[on_target] = 1.0
            hits.append(onward)
        if question.root_counts:
            pull = _pull(hits[-1], weight, question.lineages)
        else:
            # The first generation is drawn from the root's row, which is a transition as well.
            drawn = _pull(matrix @ hits[-1], weight, question.lineages)
            slope += drawn @ hits[-1].T
            pull = back @ drawn
        for earlier in reversed(hits[:-1]):
            # Whatever T says, a lineage on its target has visited it.
            pull[on_target] = 0.0
            slope += pull @ earlier.T
            pull = back @ pull
    return slope


def _weight(chain: NicheChain, niche: Niche | None) -> Floats:
    """Roots whose l-evolvability is averaged, (S,)."""
    weight = np.zeros(chain.states)
    if niche is None:
        weight[: chain.n_niches] = 1.0 / chain.n_niches
    else:
        weight[chain.state(niche)] = 1.0
    return weight


def _evolvability(transition: Transition, weight: Floats, question: Question, niches: int) -> float:
    """Weighted mean of the l-evolvability of all roots that have a weight."""
    roots = np.flatnonzero(weight)
    standing = sparse.eye_array(weight.size, format="csr")[roots]
    first = standing if question.root_counts else standing @ transition
    covered = expected_coverage(transition, first, question.steps, question.lineages, counted=niches)
    return float(weight[roots] @ covered)


def _pull(visit: Floats, weight: Floats, lineages: int) -> Floats:
    """Derivative of the weighted sum of 1 − (1 − h)^U by each h, (S, c)."""
    pull: Floats = weight[:, None] * lineages * np.maximum(1.0 - visit, 0.0) ** (lineages - 1)
    return pull
