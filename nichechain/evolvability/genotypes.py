"""l-evolvability of a genotype: its own offspring begin the lineages."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.model import NicheChain
from nichechain.core.checks import check_numbers, check_whole
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.averaging import (
    DRAWS,
    Convention,
    Method,
    Sample,
    check,
    one_root,
)
from nichechain.evolvability.coverage import rarefied_coverage
from nichechain.evolvability.results import Evolvability
from nichechain.evolvability.roots import Root, transition_draws

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive, Elite
    from nichechain.execution import Executor

FirstGeneration = Literal["posterior", "empirical"]


def genotype_evolvability(
    archive: Archive,
    elite: Elite,
    *,
    l: int = 5,  # noqa: E741
    lineages: int = 100,
    offspring: int = 30,
    first_generation: FirstGeneration = "posterior",
    strength: float | None = None,
    chain: NicheChain | None = None,
    method: Method = "exact",
    convention: Convention = "definition",
    repeats: int = 100,
    draws: int = DRAWS,
    seed: int = 0,
    executor: Executor | None = None,
) -> Evolvability:
    """l-evolvability of a genotype: its own offspring, evaluated now, say where lineages begin.

    Parameters
    ----------
    archive : Archive
        Where domain, mutation and niches come from.
    elite : Elite
        The genotype and its niche, such as ``archive.elite((7, 11))``.
    l, lineages, method, convention, repeats, draws, seed
        As in :func:`l_evolvability`.
    offspring : int
        Number m of offspring to evaluate, at least 1.
    first_generation : {"posterior", "empirical"}
        ``posterior``: D ~ Dirichlet(counts + s·(row of T of the genotype's niche)), for the
        niches that none of m offspring happened to hit; at l = 1 and U ≤ m, rarefaction of the
        observed counts instead. ``empirical``: D is the observed share, the paper's letter.
    strength : float, optional
        s, how many offspring the row of T is worth in D; by default what the base measure is
        worth to the rows of the chain, or 1 where T has no posterior.
    chain : NicheChain, optional
        By default ``archive.chain()``.
    executor : Executor, optional
        Where to evaluate the offspring; by default here.

    Returns
    -------
    Evolvability
        ``births`` are those behind the row of the genotype's niche.

    Raises
    ------
    NichechainError
        If an argument is out of range or every offspring failed.

    Notes
    -----
    Source: the paper's procedure, steps 2 to 7.
    """
    check(l, lineages, method, convention, repeats, draws)
    check_whole(offspring=offspring)
    if offspring < 1:
        raise NichechainError(f"offspring is {offspring}, but at least 1 is needed")
    if first_generation not in get_args(FirstGeneration):
        raise NichechainError(f"first_generation is {first_generation!r}, but must be posterior or empirical")
    if strength is not None:
        check_numbers(strength=strength)
    if strength is not None and not (math.isfinite(strength) and strength > 0):
        raise NichechainError(f"strength is {strength}, but must be a positive number")
    chain = archive.chain() if chain is None else chain
    counts = _offspring_counts(archive, elite, offspring, seed, executor)
    observed = int(counts.sum())
    births = None if chain.births is None else int(chain.births[elite.state])
    if first_generation == "empirical" and lineages > observed:
        warnings.warn(
            f"{lineages} lineages begin at the niches of {observed} offspring, "
            "and miss those that none of them happened to hit",
            stacklevel=2,
        )

    if strength is None:
        strength = 1.0 if chain.posterior is None else chain.posterior.strength

    root = Root(chain, niche=elite.state)

    def samples() -> Iterator[Sample]:
        matrices = transition_draws(chain, draws, seed)
        if chain.posterior is None and first_generation == "posterior":
            # T is given, but D is not.
            matrices = itertools.repeat(chain.operator, draws)
        for number, matrix in enumerate(matrices):
            if first_generation == "empirical":
                yield matrix, counts[None, :] / observed
                continue
            rng = keyed(seed, Purpose.FIRST_GENERATION, number)
            weight = rng.standard_gamma(counts + strength * root.first(matrix, "definition"))
            yield matrix, (weight / weight.sum())[None, :]

    drawn = chain.posterior is not None or first_generation == "posterior"
    size = max(1, math.ceil(repeats / draws)) if drawn else repeats
    result = one_root(chain, samples(), l, lineages, method, convention, size, seed)
    result = replace(result, births=births, offspring=observed)
    if first_generation == "posterior" and convention == "definition" and l == 1 and lineages <= observed:
        # No distribution has to be guessed: these are children, and there are enough of them.
        value = rarefied_coverage(counts, lineages, counted=chain.n_niches)
        low, high = min(result.low, value), max(result.high, value)
        return replace(result, value=value, standard_error=0.0, low=low, high=high, method="rarefaction")
    return result


def _offspring_counts(
    archive: Archive, elite: Elite, offspring: int, seed: int, executor: Executor | None
) -> NDArray[np.int64]:
    """States that fresh offspring of an elite land in, (S,)."""
    children = np.stack(
        [archive.mutate(elite.genotype, keyed(seed, Purpose.OFFSPRING, i)) for i in range(offspring)]
    )
    domain = archive.domain
    evaluation = domain.evaluate(children) if executor is None else executor.evaluate(domain, children)
    if evaluation.failed.all():
        raise NichechainError(f"all {offspring} offspring failed, the first with: {evaluation.reasons[0]}")
    landed = archive.niches.of(evaluation.behavior[~evaluation.failed])
    return np.bincount(landed, minlength=archive.niches.states)
