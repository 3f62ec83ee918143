"""l-evolvability: the number of niches that descendants will reach.

A niche is more *l-evolvable* than another if U lineages of l generations from it visit more
niches in expectation. Two conventions give the paper's "walks of length l + 1" a meaning. Under
``definition`` the root is not its own descendant, so l = 1 is the coverage of the children, as
the paper demands. Under ``procedure`` the root's state counts, as its steps say literally.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeAlias, get_args

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.chain.model import Matrix, NicheChain
from nichechain.coverage import check_lengths, expected_coverage, rarefied_coverage, sampled_coverage
from nichechain.errors import NichechainError
from nichechain.niches import Niche
from nichechain.randomness import Purpose, keyed

if TYPE_CHECKING:
    from nichechain.archive import Archive, Elite
    from nichechain.execution import Executor

Floats = NDArray[np.float64]
Method = Literal["exact", "monte-carlo"]
Sample: TypeAlias = tuple[Matrix, Floats]
Convention = Literal["definition", "procedure"]
FirstGeneration = Literal["posterior", "empirical"]

DRAWS = 50
"""Posterior draws of T that a value is averaged over."""
_INTERVAL = (0.05, 0.95)
# Lineages without end: what they visit in expectation is all that can be visited.
_ENDLESS = 10**9
_SATURATED = 0.95


@dataclass(frozen=True)
class Evolvability:
    """l-evolvability of one root, with what it rests on.

    Parameters
    ----------
    value : float
        Expected number of niches visited: exact where T is given, the mean over posterior draws
        of T (and of D) where they are estimated.
    standard_error : float
        Of ``value``, from the finite number of draws and simulations.
    low, high : float
        5 % and 95 % quantiles over the draws: what births leave open. Equal to ``value`` where T
        is given.
    l, lineages : int
        Generations, and number U of lineages.
    method, convention, estimator : str
        How it was computed, what was counted, where T came from.
    births : int, optional
        Births behind the root's row of T; None where T is given or the root has no row.
    saturated : bool
        Whether the lineages see nearly all that endlessly many would: fewer tell roots apart
        better.
    offspring : int, optional
        Offspring whose niches gave D, for a genotype.
    """

    value: float
    standard_error: float
    low: float
    high: float
    l: int  # noqa: E741  # the paper's name
    lineages: int
    method: str
    convention: str
    estimator: str
    births: int | None
    saturated: bool
    offspring: int | None = None

    def __str__(self) -> str:
        return (
            f"{self.value:.2f} niches ({self.low:.2f} to {self.high:.2f}; l = {self.l}, "
            f"{self.lineages} lineages, {self.convention}, {self.estimator}, {self.method})"
        )


@dataclass(frozen=True)
class NicheEvolvability:
    """l-evolvability of every niche, as arrays (n_niches,); the fields of :class:`Evolvability`."""

    value: Floats
    standard_error: Floats
    low: Floats
    high: Floats
    births: NDArray[np.int64] | None
    l: int  # noqa: E741
    lineages: int
    method: str
    convention: str
    estimator: str
    saturated: bool

    def to_frame(self, chain: NicheChain) -> pd.DataFrame:
        """One row per niche, with its label."""
        columns = {
            "niche": np.arange(self.value.size),
            "index": [chain.label(niche) for niche in range(self.value.size)],
            "value": self.value,
            "low": self.low,
            "high": self.high,
            "standard_error": self.standard_error,
        }
        if self.births is not None:
            columns["births"] = self.births
        return pd.DataFrame(columns)

    def ranking(self, chain: NicheChain, *, min_births: int = 20) -> pd.DataFrame:
        """Rows of :meth:`to_frame`, the largest value first, without niches of fewer births.

        A niche that births say little about would rank by its prior.
        """
        frame = self.to_frame(chain)
        if self.births is not None:
            frame = frame[frame["births"] >= min_births]
        return frame.sort_values("value", ascending=False, kind="stable").reset_index(drop=True)


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
    _check(l, lineages, method, convention, repeats, draws)
    if (niche is None) == (offspring is None):
        raise NichechainError("give either a niche or the distribution of the offspring, and only one")
    if niche is None:
        first = _distribution(offspring, chain)
        samples = ((matrix, first) for matrix in _transitions(chain, draws, seed))
        return _one_root(chain, samples, l, lineages, method, convention, repeats, draws, seed)
    state = chain.state(niche)
    standing = np.zeros((1, chain.states))
    standing[0, state] = 1.0
    samples = (
        (matrix, standing if convention == "procedure" else _row(matrix, state))
        for matrix in _transitions(chain, draws, seed)
    )
    result = _one_root(chain, samples, l, lineages, method, convention, repeats, draws, seed)
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
    _check(l, lineages, method, convention, repeats, draws)
    n = chain.n_niches
    generations = _generations(l, convention)
    size = _repeats_per_draw(repeats, chain, draws)
    standing = sparse.eye_array(chain.states, format="csr")
    means, errors, saturated = [], [], False
    for number, matrix in enumerate(_transitions(chain, draws, seed)):
        first: Matrix = standing if convention == "procedure" else matrix
        if method == "exact":
            covered = expected_coverage(matrix, first, generations, [lineages, _ENDLESS], counted=n)[:n]
            saturated |= bool(np.median(covered[:, 0] / np.maximum(covered[:, 1], 1e-300)) > _SATURATED)
            means.append(covered[:, 0])
            errors.append(np.zeros(n))
        else:
            rng = keyed(seed, Purpose.WALKS, number)
            sampled = [
                sampled_coverage(matrix, _row(first, i)[0], generations, lineages, size, rng, counted=n)
                for i in range(n)
            ]
            means.append(np.mean(sampled, axis=1))
            errors.append(np.array([_standard_error(walks) for walks in sampled]))
    value, error, low, high = _summary(np.array(means), np.array(errors))
    births = None if chain.births is None else chain.births[:n]
    return NicheEvolvability(
        value, error, low, high, births, l, lineages, method, convention, chain.estimator, saturated
    )


def genotype_evolvability(
    archive: Archive,
    elite: Elite,
    *,
    l: int = 5,  # noqa: E741
    lineages: int = 100,
    offspring: int = 30,
    first_generation: FirstGeneration = "posterior",
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
    _check(l, lineages, method, convention, repeats, draws)
    if offspring < 1:
        raise NichechainError(f"offspring is {offspring}, but at least 1 is needed")
    if first_generation not in get_args(FirstGeneration):
        raise NichechainError(f"first_generation is {first_generation!r}, but must be posterior or empirical")
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

    def samples() -> Iterator[Sample]:
        strength = 1.0 if chain.posterior is None else chain.posterior.strength
        for number, matrix in enumerate(_transitions(chain, draws, seed)):
            if first_generation == "empirical":
                yield matrix, counts[None, :] / observed
                continue
            rng = keyed(seed, Purpose.FIRST_GENERATION, number)
            weight = rng.standard_gamma(counts + strength * _row(matrix, elite.state))
            yield matrix, weight / weight.sum()

    result = _one_root(chain, samples(), l, lineages, method, convention, repeats, draws, seed)
    result = replace(result, births=births, offspring=observed)
    if first_generation == "posterior" and convention == "definition" and l == 1 and lineages <= observed:
        # No distribution has to be guessed: these are children, and there are enough of them.
        value = rarefied_coverage(counts, lineages, counted=chain.n_niches)
        return replace(result, value=value, standard_error=0.0, method="rarefaction")
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


def _one_root(
    chain: NicheChain,
    samples: Iterator[Sample],
    l: int,  # noqa: E741
    lineages: int,
    method: str,
    convention: str,
    repeats: int,
    draws: int,
    seed: int,
) -> Evolvability:
    """Evolvability of one root over samples of T and of the distribution of generation 1."""
    generations = _generations(l, convention)
    n = chain.n_niches
    size = _repeats_per_draw(repeats, chain, draws)
    means, errors, saturated = [], [], False
    for number, (matrix, first) in enumerate(samples):
        if method == "exact":
            covered, endless = expected_coverage(matrix, first, generations, [lineages, _ENDLESS], counted=n)[
                0
            ]
            saturated |= bool(covered > _SATURATED * endless)
            means.append(covered)
            errors.append(0.0)
        else:
            rng = keyed(seed, Purpose.WALKS, number)
            sampled = sampled_coverage(matrix, first[0], generations, lineages, size, rng, counted=n)
            means.append(sampled.mean())
            errors.append(_standard_error(sampled))
    value, error, low, high = (float(x) for x in _summary(np.array(means), np.array(errors)))
    return Evolvability(
        value, error, low, high, l, lineages, method, convention, chain.estimator, None, saturated
    )


def _standard_error(sampled: NDArray[np.int64]) -> float:
    size = sampled.size
    return float(sampled.std(ddof=1) / math.sqrt(size)) if size > 1 else math.nan


def _row(matrix: Matrix, state: int) -> Floats:
    """Row of T as (1, S)."""
    row: Floats = matrix[[state]] if isinstance(matrix, np.ndarray) else matrix[[state]].toarray()
    return row


def _summary(means: Floats, errors: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Mean over the draws along axis 0, its standard error, and the interval."""
    size = len(means)
    low, high = np.quantile(means, _INTERVAL, axis=0)
    if size == 1:
        return means[0], errors[0], low, high
    # The spread of the draws' means already has the simulations' error in it.
    return means.mean(axis=0), means.std(axis=0, ddof=1) / math.sqrt(size), low, high


def _transitions(chain: NicheChain, draws: int, seed: int) -> Iterator[Matrix]:
    """T itself where it is given, draws from its posterior where it is estimated with one."""
    if chain.posterior is None:
        yield chain.T
    else:
        for number in range(draws):
            yield chain.posterior.draw(keyed(seed, Purpose.POSTERIOR, number))


def _generations(l: int, convention: str) -> int:  # noqa: E741
    """States of a walk that count. Under ``procedure`` the root's own state is one of them."""
    return l + 1 if convention == "procedure" else l


def _repeats_per_draw(repeats: int, chain: NicheChain, draws: int) -> int:
    return repeats if chain.posterior is None else max(1, math.ceil(repeats / draws))


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


def _check(
    l: int,  # noqa: E741
    lineages: int,
    method: str,
    convention: str,
    repeats: int,
    draws: int,
) -> None:
    check_lengths(l, lineages)
    for name, value, allowed in (
        ("method", method, get_args(Method)),
        ("convention", convention, get_args(Convention)),
    ):
        if value not in allowed:
            raise NichechainError(f"{name} is {value!r}, but must be one of {', '.join(allowed)}")
    for name, number in (("repeats", repeats), ("draws", draws)):
        if number < 1:
            raise NichechainError(f"{name} is {number}, but at least 1 is needed")
