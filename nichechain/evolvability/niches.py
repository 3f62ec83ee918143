"""l-evolvability of niches, from the chain alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.chain.model import Matrix, NicheChain
from nichechain.coverage import expected_coverage, sampled_coverage
from nichechain.errors import NichechainError
from nichechain.evolvability.averaging import (
    DRAWS,
    ENDLESS,
    SATURATED,
    Convention,
    Method,
    check,
    one_root,
    repeats_per_draw,
    row_of,
    standard_error,
    states_counted,
    summary,
    transitions,
)
from nichechain.evolvability.results import Evolvability, NicheEvolvability
from nichechain.niches import Niche
from nichechain.randomness import Purpose, keyed

Floats = NDArray[np.float64]


def l_evolvability(
    chain: NicheChain,
    *,
    niche: Niche | None = None,
    offspring: ArrayLike | None = None,
    l: int = 5,  # noqa: E741
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
    check(l, lineages, method, convention, repeats, draws)
    if (niche is None) == (offspring is None):
        raise NichechainError("give either a niche or the distribution of the offspring, and only one")
    size = repeats_per_draw(repeats, chain, draws)
    if niche is None:
        first = _distribution(offspring, chain)
        samples = ((matrix, first) for matrix in transitions(chain, draws, seed))
        return one_root(chain, samples, l, lineages, method, convention, size, seed)
    state = chain.state(niche)
    standing = np.zeros((1, chain.states))
    standing[0, state] = 1.0
    samples = (
        (matrix, standing if convention == "procedure" else row_of(matrix, state))
        for matrix in transitions(chain, draws, seed)
    )
    result = one_root(chain, samples, l, lineages, method, convention, size, seed)
    return replace(result, births=None if chain.births is None else int(chain.births[state]))


def niche_evolvability(
    chain: NicheChain,
    *,
    l: int = 5,  # noqa: E741
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
    check(l, lineages, method, convention, repeats, draws)
    n = chain.n_niches
    generations = states_counted(l, convention)
    size = repeats_per_draw(repeats, chain, draws)
    standing = sparse.eye_array(chain.states, format="csr")
    means, errors, saturated = [], [], False
    for number, matrix in enumerate(transitions(chain, draws, seed)):
        first: Matrix = standing if convention == "procedure" else matrix
        if method == "exact":
            covered = expected_coverage(matrix, first, generations, [lineages, ENDLESS], counted=n)[:n]
            saturated |= bool(np.median(covered[:, 0] / np.maximum(covered[:, 1], 1e-300)) > SATURATED)
            means.append(covered[:, 0])
            errors.append(np.zeros(n))
        else:
            rng = keyed(seed, Purpose.WALKS, number)
            sampled = [
                sampled_coverage(matrix, row_of(first, i)[0], generations, lineages, size, rng, counted=n)
                for i in range(n)
            ]
            means.append(np.mean(sampled, axis=1))
            errors.append(np.array([standard_error(walks) for walks in sampled]))
    value, error, low, high = summary(np.array(means), np.array(errors))
    births = None if chain.births is None else chain.births[:n]
    return NicheEvolvability(
        value, error, low, high, births, l, lineages, method, convention, chain.estimator, saturated
    )


def _distribution(offspring: ArrayLike | None, chain: NicheChain) -> Floats:
    """D as a row (1, S)."""
    given = np.asarray(offspring, np.float64)
    if given.shape not in ((chain.n_niches,), (chain.states,)):
        raise NichechainError(
            f"offspring has shape {given.shape}, but must be ({chain.n_niches},), one share per niche"
        )
    if not np.isfinite(given).all() or (given < 0).any() or abs(given.sum() - 1.0) > 1e-8:
        raise NichechainError(
            f"offspring sums to {given.sum():.9g}, but must be shares that are not negative and sum to 1"
        )
    row = np.zeros((1, chain.states))
    row[0, : given.size] = given
    return row
