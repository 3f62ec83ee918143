"""l-evolvability of niches, from the chain alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.chain.model import NicheChain
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.averaging import (
    ENDLESS,
    SATURATED,
    Sample,
    one_root,
    spread_of,
    standard_error,
    summary,
    widened,
)
from nichechain.evolvability.coverage import expected_coverage, sampled_coverage
from nichechain.evolvability.question import DRAWS, Convention, Method, Question, Root, dense
from nichechain.evolvability.results import Evolvability, NicheEvolvability
from nichechain.evolvability.urns import Record, Simulated, best_coverage, simulated_coverage
from nichechain.execution.side_by_side import side_by_side
from nichechain.niches import Niche

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

URNS = "urns"


def l_evolvability(
    chain: NicheChain,
    *,
    niche: Niche | None = None,
    offspring: ArrayLike | None = None,
    l: int = 5,
    lineages: int = 100,
    method: Method = "auto",
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
    method : {"auto", "exact", "monte-carlo"}
        Closed form, the paper's simulation, or whichever of closed form and
        :mod:`urns <nichechain.evolvability.urns>` suits the number of states.
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
    The interval tells what births leave open of T. It is not that of one elite of the niche, which has
    a distribution of its own: see :func:`nichechain.evolvability.genotype_evolvability`.

    Source: the paper's section "Towards better evolvability definitions".
    """
    question = Question(l, lineages, convention, method, repeats, draws, seed)
    return answer(chain, Root(chain, niche=niche, offspring=offspring), question)


def answer(
    chain: NicheChain, root: Root, question: Question, on_done: Callable[[int], None] | None = None
) -> Evolvability:
    """What :func:`l_evolvability` answers to a question that has been checked.

    Parameters
    ----------
    chain : NicheChain
    root : Root
    question : Question
    on_done : callable, optional
        Told how many more draws of T are done.
    """
    question.warn_if_long(chain)
    if question.by_urns(chain):
        return replace(one_by_urns(chain, root, question, on_done=on_done), births=root.births)
    own = root.visited(question)

    def sample(number: int) -> Sample:
        drawn = question.sample(chain, number)
        return drawn.onward, root.children(drawn)

    size = question.number_of_samples(chain)
    result = one_root(chain, sample, size, question, question.repeats_of_each(chain), own, on_done)
    return replace(result, births=root.births)


def niche_evolvability(
    chain: NicheChain,
    *,
    l: int = 5,
    lineages: int = 100,
    method: Method = "auto",
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


def answer_for_niches(
    chain: NicheChain,
    question: Question,
    *,
    roots: Ints | None = None,
    best: int | None = None,
    announced: bool = False,
    on_done: Callable[[int], None] | None = None,
) -> NicheEvolvability:
    """What :func:`niche_evolvability` answers to a question that has been checked.

    Parameters
    ----------
    chain : NicheChain
    question : Question
    roots : (m,) int64 array, optional
        The niches that are asked for, where not all: others have NaN.
    best : int, optional
        How many of the best are wanted, where not all: others may have NaN.
    announced : bool
        Whether it was said already how long it could take, as of one of many questions.
    on_done : callable, optional
        Told how many more draws of T are done.
    """
    n, lineages = chain.n_niches, question.lineages
    asked = np.arange(n) if roots is None else roots
    if not announced:
        question.warn_if_long(chain, asked.size)
    if question.by_urns(chain):
        return _by_urns(chain, question, asked, best, on_done)
    size = question.repeats_of_each(chain)
    own = asked if question.root_counts else None

    def on_draw(number: int) -> tuple[Floats, Floats, bool]:
        drawn = question.sample(chain, number)
        first = drawn.children(asked)
        if question.method != "monte-carlo":
            covered = expected_coverage(
                drawn.onward, first, question.l, [lineages, ENDLESS], counted=n, own=own
            )
            share = covered[:, 0] / np.maximum(covered[:, 1], 1e-300)
            return covered[:, 0], np.zeros(asked.size), bool(np.median(share) > SATURATED)
        rng = keyed(question.seed, Purpose.WALKS, number)
        sampled = [
            sampled_coverage(
                drawn.onward,
                start,
                question.l,
                lineages,
                size,
                rng,
                counted=n,
                own=int(niche) if question.root_counts else None,
            )
            for niche, start in zip(asked, dense(first), strict=True)
        ]
        return np.mean(sampled, axis=1), np.array([standard_error(walks) for walks in sampled]), False

    found = side_by_side(on_draw, range(question.number_of_samples(chain)), on_done)
    means, errors, full = zip(*found, strict=True)
    saturated = any(full)
    figures = summary(np.array(means), np.array(errors), spread_of(chain), n)
    method = "exact" if question.method == "auto" else question.method
    return _of_all(chain, question, asked, figures, method, saturated)


def _of_all(
    chain: NicheChain,
    question: Question,
    asked: Ints,
    figures: tuple[Floats, Floats, Floats, Floats],
    method: str,
    saturated: bool,
) -> NicheEvolvability:
    """The answer for all niches, NaN where they were not asked for."""
    whole = np.full((4, chain.n_niches), np.nan)
    whole[:, asked] = figures
    births = None if chain.births is None else chain.births[: chain.n_niches]
    value, error, low, high = whole
    return NicheEvolvability(
        value,
        error,
        low,
        high,
        births,
        question.l,
        question.lineages,
        method,
        question.convention,
        chain.estimator,
        saturated,
    )


def _by_urns(
    chain: NicheChain,
    question: Question,
    asked: Ints,
    best: int | None,
    on_done: Callable[[int], None] | None,
) -> NicheEvolvability:
    assert chain.posterior is not None
    if best is None:
        size = [question.lineages]
        found = simulated_coverage(chain.posterior, question, size, roots=asked, on_done=on_done)
    else:
        left, found = best_coverage(chain.posterior, question, asked, best, on_done)
        asked = asked[left]
    figures = figures_of(chain, found)
    # Where nothing is impossible, lineages without end visit every niche.
    saturated = bool(np.median(figures[0]) > SATURATED * chain.n_niches)
    return _of_all(chain, question, asked, figures, URNS, saturated)


def figures_of(chain: NicheChain, found: Simulated) -> tuple[Floats, Floats, Floats, Floats]:
    """Mean, standard error and bounds of simulated coverage, of elites of the chain's niches, (m,) each."""
    value, error, low, high = found.summary()
    return value, error, *widened(value, low, high, spread_of(chain), chain.n_niches)


def one_by_urns(
    chain: NicheChain,
    root: Root,
    question: Question,
    *,
    record: Record | None = None,
    on_done: Callable[[int], None] | None = None,
) -> Evolvability:
    """The answer for one root of a chain of many states, or for a genotype in its niche with a record."""
    assert chain.posterior is not None
    start = {"offspring": root.distribution} if root.state is None else {"roots": np.array([root.state])}
    found = simulated_coverage(
        chain.posterior, question, [question.lineages], **start, record=record, on_done=on_done
    )
    value, error, low, high = (float(figure[0]) for figure in figures_of(chain, found))
    return Evolvability(
        value,
        error,
        low,
        high,
        question.l,
        question.lineages,
        URNS,
        question.convention,
        chain.estimator,
        None,
        value > SATURATED * chain.n_niches,
    )
