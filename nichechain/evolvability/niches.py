"""l-evolvability of niches, from the chain alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain, Transition
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.averaging import ENDLESS, SATURATED, one_root, standard_error, summary
from nichechain.evolvability.coverage import expected_coverage, sampled_coverage
from nichechain.evolvability.question import DRAWS, Convention, Method, Question, Root
from nichechain.evolvability.results import Evolvability, NicheEvolvability
from nichechain.niches import Niche

Floats = NDArray[np.float64]


def l_evolvability(
    chain: NicheChain,
    *,
    niche: Niche | None = None,
    offspring: ArrayLike | None = None,
    l: int = 5,
    lineages: int = 100,
    method: Method = "exact",
    convention: Convention = "definition",
    repeats: int = 100,
    draws: int = DRAWS,
    seed: int = 0,
) -> Evolvability:
    """l-evolvability of a niche, or of whatever has offspring with a given distribution.

    Parameters
    ----------
    chain : NicheChain
    niche : int or tuple of int, optional
        The root stands in this niche; generation 1 is drawn from its row of T.
    offspring : (n_niches,) or (S,) array, optional
        D: generation 1 is drawn from this distribution. Give either this or ``niche``.
    l : int
        Generations, at least 1.
    lineages : int
        Number U of independent lineages, at least 1: l·U descendants.
    method : {"exact", "monte-carlo"}
        Closed form, or the paper's simulation.
    convention : {"definition", "procedure"}
        Whether the root's own state counts, see the module.
    repeats : int
        Simulations, for ``monte-carlo``.
    draws : int
        Posterior draws of T, where it is estimated.
    seed : int
        Of draws and simulations.

    Returns
    -------
    Evolvability

    Raises
    ------
    NichechainError
        If an argument is out of range, or not exactly one root is given.

    Notes
    -----
    Source: the paper's section "Towards better evolvability definitions".
    """
    question = Question(l, lineages, convention, method, repeats, draws, seed)
    return answer(chain, Root(chain, niche=niche, offspring=offspring), question)


def answer(chain: NicheChain, root: Root, question: Question) -> Evolvability:
    """What :func:`l_evolvability` answers to a question that has been checked."""
    samples = ((matrix, root.first(matrix, question)) for matrix in question.transitions(chain))
    result = one_root(chain, samples, question, question.repeats_of_each(chain))
    return replace(result, births=root.births)


def niche_evolvability(
    chain: NicheChain,
    *,
    l: int = 5,
    lineages: int = 100,
    method: Method = "exact",
    convention: Convention = "definition",
    repeats: int = 100,
    draws: int = DRAWS,
    seed: int = 0,
) -> NicheEvolvability:
    """l-evolvability of every niche.

    Parameters
    ----------
    chain, l, lineages, method, convention, repeats, draws, seed
        As in :func:`l_evolvability`.

    Returns
    -------
    NicheEvolvability

    Raises
    ------
    NichechainError
        If an argument is out of range.
    """
    return answer_for_niches(chain, Question(l, lineages, convention, method, repeats, draws, seed))


def answer_for_niches(chain: NicheChain, question: Question) -> NicheEvolvability:
    """What :func:`niche_evolvability` answers to a question that has been checked."""
    n, steps, lineages = chain.n_niches, question.steps, question.lineages
    size = question.repeats_of_each(chain)
    standing = sparse.eye_array(chain.states, format="csr")
    means, errors, saturated = [], [], False
    for number, matrix in enumerate(question.transitions(chain)):
        first: Transition = standing if question.root_counts else matrix
        if question.method == "exact":
            covered = expected_coverage(matrix, first, steps, [lineages, ENDLESS], counted=n)[:n]
            saturated |= bool(np.median(covered[:, 0] / np.maximum(covered[:, 1], 1e-300)) > SATURATED)
            means.append(covered[:, 0])
            errors.append(np.zeros(n))
        else:
            rng = keyed(question.seed, Purpose.WALKS, number)
            roots = (Root(chain, niche=niche).first(matrix, question) for niche in range(n))
            sampled = [
                sampled_coverage(matrix, root, steps, lineages, size, rng, counted=n) for root in roots
            ]
            means.append(np.mean(sampled, axis=1))
            errors.append(np.array([standard_error(walks) for walks in sampled]))
    value, error, low, high = summary(np.array(means), np.array(errors))
    births = None if chain.births is None else chain.births[:n]
    return NicheEvolvability(
        value,
        error,
        low,
        high,
        births,
        question.l,
        lineages,
        question.method,
        question.convention,
        chain.estimator,
        saturated,
    )
