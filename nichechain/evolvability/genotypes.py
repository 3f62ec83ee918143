"""l-evolvability of a genotype: its own offspring begin the lineages."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.model import NicheChain
from nichechain.core.checks import check_at_least, check_choice, check_positive
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.averaging import Sample, one_root
from nichechain.evolvability.coverage import rarefied_coverage
from nichechain.evolvability.question import DRAWS, Convention, Method, Question, Root
from nichechain.evolvability.results import Evolvability

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive, Elite
    from nichechain.execution import Executor

FirstGeneration = Literal["posterior", "empirical"]


def genotype_evolvability(
    archive: Archive,
    elite: Elite,
    *,
    l: int = 5,
    lineages: int = 100,
    offspring: int = 30,
    first_generation: FirstGeneration = "posterior",
    strength: float | None = None,
    chain: NicheChain | None = None,
    method: Method = "auto",
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
        s, how many offspring the row of T is worth in D; by default as many as make children of one
        elite foretell each other best, see :func:`nichechain.chain.elites.elite_concentration`, or
        1 where T has no posterior.
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
    question = Question(l, lineages, convention, method, repeats, draws, seed)
    check_at_least(1, offspring=offspring)
    check_choice("first_generation", first_generation, get_args(FirstGeneration))
    if strength is not None:
        check_positive(strength=strength)
    chain = archive.chain() if chain is None else chain
    counts = _offspring_counts(archive, elite, offspring, seed, executor)
    observed = int(counts.sum())
    if first_generation == "empirical" and lineages > observed:
        warnings.warn(
            f"{lineages} lineages begin at the niches of {observed} offspring, "
            "and miss those that none of them happened to hit",
            stacklevel=2,
        )

    root = Root(chain, niche=elite.state)
    guessed = first_generation == "posterior"

    def samples() -> Iterator[Sample]:
        # Where T is given, D is not, if it has to be guessed.
        for number, matrix in enumerate(question.transitions(chain, redraw=guessed)):
            if guessed:
                rng = keyed(seed, Purpose.FIRST_GENERATION, number)
                yield matrix, draw_children(chain, counts, root.children(matrix), rng, strength)
            else:
                yield matrix, counts / observed

    result = one_root(chain, samples(), question, question.repeats_of_each(chain, redraw=guessed))
    result = replace(result, births=root.births, offspring=observed)
    if guessed and question.steps == 1 and lineages <= observed:
        # No distribution has to be guessed: these are children, and there are enough of them.
        value = rarefied_coverage(counts, lineages, counted=chain.n_niches)
        low, high = min(result.low, value), max(result.high, value)
        return replace(result, value=value, standard_error=0.0, low=low, high=high, method="rarefaction")
    return result


def draw_children(
    chain: NicheChain,
    counts: NDArray[np.int64],
    row: NDArray[np.float64],
    rng: np.random.Generator,
    strength: float | None = None,
) -> NDArray[np.float64]:
    """D of genotypes, (..., S), drawn given the states of their offspring and their niche's row of T."""
    if strength is None:
        strength = 1.0 if chain.posterior is None else chain.posterior.elite_concentration
    weight: NDArray[np.float64] = rng.standard_gamma(counts + strength * row)
    weight /= weight.sum(axis=-1, keepdims=True)
    return weight


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
