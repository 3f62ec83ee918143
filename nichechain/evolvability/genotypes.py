"""l-evolvability of a genotype: its own children, recorded or evaluated now, begin the lineages."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain
from nichechain.core.checks import check_at_least, check_choice, check_positive
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.averaging import Sample, one_root
from nichechain.evolvability.coverage import rarefied_coverage
from nichechain.evolvability.niches import one_by_urns
from nichechain.evolvability.question import DRAWS, Convention, Method, Question, Root
from nichechain.evolvability.record import draw_children, own_strength, recorded_children
from nichechain.evolvability.results import Evolvability
from nichechain.evolvability.urns import Record
from nichechain.variation.unborn import litters

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive, Elite
    from nichechain.execution import Executor

FirstGeneration = Literal["posterior", "empirical"]
"""What the first generation of a genotype's lineages is drawn from."""


def genotype_evolvability(
    archive: Archive,
    elite: Elite,
    *,
    l: int = 5,
    lineages: int = 100,
    offspring: int = 0,
    record: bool = True,
    first_generation: FirstGeneration = "posterior",
    strength: float | None = None,
    chain: NicheChain | None = None,
    method: Method = "auto",
    convention: Convention = "definition",
    repeats: int = 100,
    draws: int = DRAWS,
    seed: int = 0,
    executor: Executor | None = None,
    on_done: Callable[[int], None] | None = None,
) -> Evolvability:
    """l-evolvability of a genotype: its own children say where lineages begin.

    Parameters
    ----------
    archive : Archive
        Where domain, mutation and niches come from.
    elite : Elite
        The genotype and its niche, such as ``archive.elite((7, 11))``.
    l, lineages, method, convention, repeats, draws, seed
        As in :func:`l_evolvability`.
    offspring : int
        Number m of offspring to evaluate now, besides those that are recorded; by default none.
    record : bool
        Whether the children that the archive has recorded of the elite count. The paper's letter
        is ``record=False`` with ``offspring=30``.
    first_generation : {"posterior", "empirical"}
        ``posterior``: D is drawn given the children and the row of T of the genotype's niche,
        which speaks for the niches that none of few children happened to hit; without any children,
        D is that row. For l = 1 and U ≤ m, and where only fresh offspring count, rarefaction of them
        instead. ``empirical``: D is the observed share, the paper's letter.
    strength : float, optional
        α, how many children the row of T is worth in D; by default as many as make children of one
        elite foretell each other best, see :func:`nichechain.chain.elites.elite_concentration`, or
        1 where T has no posterior.
    chain : NicheChain, optional
        By default ``archive.chain()``.
    executor : Executor, optional
        Where to evaluate the offspring; by default here.
    on_done : callable, optional
        Told how many more draws of T are done.

    Returns
    -------
    Evolvability
        ``births`` are those behind the row of the genotype's niche, ``recorded`` and ``offspring``
        the children that count.

    Raises
    ------
    NichechainError
        If an argument is out of range, every offspring failed, or there are no children to take the
        share of.

    Notes
    -----
    Source: the paper's procedure, steps 2 to 7, and :func:`nichechain.evolvability.record.draw_children`.
    Recorded children are also among the births behind the row.
    """
    question = Question(l, lineages, convention, method, repeats, draws, seed)
    check_at_least(0, offspring=offspring)
    check_choice("first_generation", first_generation, get_args(FirstGeneration))
    if strength is not None:
        check_positive(strength=strength)
    if not record and not offspring:
        raise NichechainError("offspring is 0, but must be at least 1 where the record does not count")
    chain = archive.chain() if chain is None else chain
    counts = np.zeros(archive.niches.states, np.int64)
    if record:
        counts += recorded_children(archive, np.array([elite.uid])).toarray()[0]
    recorded = int(counts.sum())
    if offspring:
        counts += _offspring_counts(archive, elite, offspring, seed, executor)
    observed = int(counts.sum())
    guessed = first_generation == "posterior"
    if not guessed and not observed:
        raise NichechainError("the elite has no recorded children to take the share of: ask for offspring")
    if not guessed and lineages > observed:
        warnings.warn(
            f"{lineages} lineages begin at the niches of {observed} offspring, "
            "and miss those that none of them happened to hit",
            stacklevel=2,
        )

    root = Root(chain, niche=elite.state)
    strength = own_strength(chain) if strength is None else strength
    question.warn_if_long(chain, samples=question.number_of_samples(chain, redraw=True))
    if question.by_urns(chain):
        own = sparse.csr_array(counts[None])
        if guessed:
            result = one_by_urns(chain, root, question, record=Record(own, strength), on_done=on_done)
        else:
            begun = Root(chain, offspring=counts / observed)
            result = one_by_urns(chain, begun, question, on_done=on_done)
    else:
        result = _one_in_closed_form(chain, root, question, counts, strength if guessed else None, on_done)
    result = replace(result, births=root.births, recorded=recorded, offspring=observed - recorded)
    if guessed and question.steps == 1 and not recorded and lineages <= observed:
        # No distribution has to be guessed: these are children, and there are enough of them.
        value = rarefied_coverage(counts, lineages, counted=chain.n_niches)
        low, high = np.fmin(result.low, value), np.fmax(result.high, value)
        result = replace(result, low=float(low), high=float(high))
        return replace(result, value=value, standard_error=0.0, method="rarefaction")
    return result


def _one_in_closed_form(
    chain: NicheChain,
    root: Root,
    question: Question,
    counts: NDArray[np.int64],
    strength: float | None,
    on_done: Callable[[int], None] | None,
) -> Evolvability:
    """The answer for a genotype with such children: D is drawn where α is given, else their share."""

    def sample(number: int) -> Sample:
        drawn = question.sample(chain, number)
        if strength is None:
            return drawn.onward, counts / counts.sum()
        rng = keyed(question.seed, Purpose.FIRST_GENERATION, number)
        return drawn.onward, draw_children(counts, root.children(drawn), rng, strength)

    # Where T is given, D is not, if it has to be guessed.
    guessed = strength is not None
    size = question.number_of_samples(chain, redraw=guessed)
    repeats = question.repeats_of_each(chain, redraw=guessed)
    return one_root(chain, sample, size, question, repeats, on_done=on_done)


def _offspring_counts(
    archive: Archive, elite: Elite, offspring: int, seed: int, executor: Executor | None
) -> NDArray[np.int64]:
    """States that fresh offspring of an elite land in, (S,)."""
    parent = np.asarray(elite.genotype)[None]
    children = litters(archive.mutate, Purpose.OFFSPRING, parent, seed, offspring)
    domain = archive.domain
    evaluation = domain.evaluate(children.grow()) if executor is None else executor.evaluate(domain, children)
    if evaluation.failed.all():
        raise NichechainError(f"all {offspring} offspring failed, the first with: {evaluation.reasons[0]}")
    landed = archive.niches.of(evaluation.behavior[~evaluation.failed])
    return np.bincount(landed, minlength=archive.niches.states)
