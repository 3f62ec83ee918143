"""l-evolvability of niches, from the chain alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.chain.model import Matrix, NicheChain
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.averaging import (
    DRAWS,
    ENDLESS,
    SATURATED,
    Convention,
    Method,
    check,
    one_root,
    repeats_per_draw,
    standard_error,
    summary,
)
from nichechain.evolvability.coverage import expected_coverage, sampled_coverage
from nichechain.evolvability.results import Evolvability, NicheEvolvability
from nichechain.evolvability.roots import Root, generations, transition_draws
from nichechain.niches import Niche

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
    root = Root(chain, niche=niche, offspring=offspring)
    samples = (
        (matrix, root.first(matrix, convention)[None, :]) for matrix in transition_draws(chain, draws, seed)
    )
    size = repeats_per_draw(repeats, chain, draws)
    result = one_root(chain, samples, l, lineages, method, convention, size, seed)
    known = root.state is not None and chain.births is not None
    return replace(result, births=int(chain.births[root.state]) if known else None)  # type: ignore[index]


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
    states_counted = generations(l, convention)
    size = repeats_per_draw(repeats, chain, draws)
    standing = sparse.eye_array(chain.states, format="csr")
    means, errors, saturated = [], [], False
    for number, matrix in enumerate(transition_draws(chain, draws, seed)):
        first: Matrix = standing if convention == "procedure" else matrix
        if method == "exact":
            covered = expected_coverage(matrix, first, states_counted, [lineages, ENDLESS], counted=n)[:n]
            saturated |= bool(np.median(covered[:, 0] / np.maximum(covered[:, 1], 1e-300)) > SATURATED)
            means.append(covered[:, 0])
            errors.append(np.zeros(n))
        else:
            rng = keyed(seed, Purpose.WALKS, number)
            roots = (Root(chain, niche=niche).first(matrix, convention) for niche in range(n))
            sampled = [
                sampled_coverage(matrix, root, states_counted, lineages, size, rng, counted=n)
                for root in roots
            ]
            means.append(np.mean(sampled, axis=1))
            errors.append(np.array([standard_error(walks) for walks in sampled]))
    value, error, low, high = summary(np.array(means), np.array(errors))
    births = None if chain.births is None else chain.births[:n]
    return NicheEvolvability(
        value, error, low, high, births, l, lineages, method, convention, chain.estimator, saturated
    )
