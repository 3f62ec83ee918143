"""Metrics of the niches that lineages visit, by simulation: the paper's procedure to the letter."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.chain.model import NicheChain, Transition
from nichechain.core.checks import as_floats
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.coverage import simulated_lineages
from nichechain.evolvability.question import DRAWS, Convention, Question, Root
from nichechain.niches import Niche

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Cells of the table (repeats, states) and walks in flight that are kept at once.
_CELLS = 4_000_000


class Estimate(NamedTuple):
    """A mean over simulations, with the standard error that their finite number leaves."""

    value: float
    standard_error: float


@dataclass(frozen=True)
class VisitMetrics:
    """What U lineages of a root make of the niches, on average over repeats.

    Parameters
    ----------
    coverage : Estimate
        Niches visited at least once.
    uniformity : Estimate
        1 − Jensen-Shannon distance, base 2, between the visits and the uniform distribution over
        all niches: 1 where all are visited alike.
    uniformity_occupied : Estimate
        The same over the visited niches only.
    entropy : Estimate
        Of the distribution of visits over niches, in bits.
    distance : Estimate
        Length of a lineage's way from centre to centre of its niches, in units of behavior; NaN
        where the chain has no niches with centres. A step into or out of the outside state,
        which is nowhere, adds nothing.
    inside : float
        Share of repeats with a visit to any niche; the others, spent outside altogether, count
        for coverage and distance only.
    l, lineages, repeats : int
        Generations, number U of lineages, and simulations.
    convention, estimator : str
        What was counted, where T came from.
    """

    coverage: Estimate
    uniformity: Estimate
    uniformity_occupied: Estimate
    entropy: Estimate
    distance: Estimate
    inside: float
    l: int
    lineages: int
    repeats: int
    convention: str
    estimator: str


def visit_metrics(
    chain: NicheChain,
    *,
    niche: Niche | None = None,
    offspring: ArrayLike | None = None,
    l: int = 5,
    lineages: int = 100,
    convention: Convention = "definition",
    repeats: int = 100,
    draws: int = DRAWS,
    seed: int = 0,
) -> VisitMetrics:
    """Coverage, uniformity, entropy and distance of the niches that lineages of a root visit.

    Parameters
    ----------
    chain, niche, offspring, l, lineages, convention, draws, seed
        As in :func:`nichechain.evolvability.reach.reach`.
    repeats : int
        Simulations of all U lineages, at least 1; shared among the draws where T is estimated.

    Returns
    -------
    VisitMetrics

    Raises
    ------
    NichechainError
        If an argument is out of range, or not exactly one root is given.

    Notes
    -----
    Steps 5 to 7 of the paper's procedure. D″ is the distribution of the l·U descendants over
    niches (under ``procedure``, of the U roots as well); uniformity as in Doncieux et al. (2020),
    "Novelty search makes evolvability inevitable". Few descendants in many niches are never quite
    uniform: compare uniformity and entropy at equal l and U only.
    """
    question = Question(l, lineages, convention, repeats=repeats, draws=draws, seed=seed)
    lineages = question.lineages
    root = Root(chain, niche=niche, offspring=offspring)
    size = question.repeats_of_each(chain)
    replace(question, method="monte-carlo").warn_if_long(chain)
    own = root.visited(question)
    steps = question.drawn_steps(own)
    samples = []
    for number, drawn in enumerate(question.samples(chain)):
        rng = keyed(seed, Purpose.WALKS, number)
        walks = _walks(drawn.onward, root, root.children(drawn), own, steps, lineages, size, rng, chain)
        samples.append(np.concatenate(list(walks), axis=1))
    found = np.stack(samples)
    coverage, uniformity, occupied, entropy, distance = (_estimate(found[:, k]) for k in range(5))
    return VisitMetrics(
        coverage,
        uniformity,
        occupied,
        entropy,
        distance,
        float(np.mean(found[:, 0] > 0)),
        l,
        lineages,
        size * len(found),
        convention,
        chain.estimator,
    )


def uniformity(visits: ArrayLike, *, occupied: bool = False) -> Floats:
    """1 − Jensen-Shannon distance, base 2, between visits and the uniform distribution.

    Parameters
    ----------
    visits : (..., n) array
        Visits to each niche, counts or shares.
    occupied : bool
        Whether the uniform distribution is that over the visited niches, not over all.

    Returns
    -------
    (...) float64 array
        1 for visits that are all alike, NaN without visits.

    Notes
    -----
    The distance is the square root of the divergence (Lin 1991; Endres and Schindelin 2003).
    """
    shares = _shares(_visits(visits))
    even = np.ones_like(shares)
    if occupied:
        even = (shares > 0).astype(np.float64)
    even = even / np.maximum(even.sum(axis=-1, keepdims=True), 1.0)
    middle = 0.5 * (shares + even)
    divergence = _bits(middle) - 0.5 * (_bits(shares) + _bits(even))
    # Rounding may leave a divergence of zero a little below it.
    close: Floats = 1.0 - np.sqrt(np.maximum(divergence, 0.0))
    return close


def visit_entropy(visits: ArrayLike) -> Floats:
    """Entropy of visits (..., n) over niches, in bits; NaN without visits."""
    return _bits(_shares(_visits(visits)))


def _visits(visits: ArrayLike) -> Floats:
    numbers = as_floats("visits", visits)
    if not numbers.ndim or not numbers.shape[-1]:
        raise NichechainError(
            f"visits has shape {numbers.shape}, but must be (..., n) with a number per niche"
        )
    if not np.isfinite(numbers).all() or (numbers < 0).any():
        raise NichechainError("visits has values that are negative or not finite, but counts visits")
    return numbers


def _shares(visits: Floats) -> Floats:
    total = visits.sum(axis=-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        shares: Floats = visits / total
    return shares


def _bits(shares: Floats) -> Floats:
    logarithm = np.log2(shares, out=np.zeros_like(shares), where=shares > 0)
    bits: Floats = -(shares * logarithm).sum(axis=-1)
    return np.where(np.isnan(shares).any(axis=-1), np.nan, bits)


def _walks(
    transition: Transition,
    root: Root,
    first: Floats,
    own: int | None,
    steps: int,
    lineages: int,
    repeats: int,
    rng: np.random.Generator,
    chain: NicheChain,
) -> Iterator[Floats]:
    """Metrics of simulated repeats, (5, r) at a time, in the order of the fields."""
    centers = _centers(chain)
    for repeat, walks in simulated_lineages(transition, first, steps, lineages, repeats, rng, _CELLS):
        size = repeat[-1] + 1
        visits = np.zeros(size * chain.states, np.int64)
        length = np.zeros(repeat.size)
        before = None if root.state is None else np.full(repeat.size, root.state)
        for here in walks:
            if before is not None:
                length += _apart(centers, before, here)
            visits += np.bincount(repeat * chain.states + here, minlength=visits.size)
            before = here
        counts = visits.reshape(size, chain.states)[:, : chain.n_niches]
        if own is not None and own < chain.n_niches:
            counts[:, own] += lineages
        yield np.stack(
            [
                np.count_nonzero(counts, axis=1),
                uniformity(counts),
                uniformity(counts, occupied=True),
                visit_entropy(counts),
                length.reshape(size, lineages).mean(axis=1),
            ]
        )


def _centers(chain: NicheChain) -> Floats:
    """Where each state is, (S, B); NaN where it is nowhere."""
    if chain.niches is None:
        return np.full((chain.states, 1), np.nan)
    centers = np.full((chain.states, chain.niches.centers.shape[1]), np.nan)
    centers[: chain.n_niches] = chain.niches.centers
    return centers


def _apart(centers: Floats, start: Ints, end: Ints) -> Floats:
    """Distance between centres; a step into or out of the outside has none."""
    distance: Floats = np.linalg.norm(centers[end] - centers[start], axis=1)
    return np.where(np.isnan(distance), 0.0, distance) if not np.isnan(centers).all() else distance


def _estimate(found: Floats) -> Estimate:
    """Mean of simulations (draws, repeats) and its standard error."""
    kept = ~np.isnan(found)
    if not kept.any():
        return Estimate(math.nan, math.nan)
    if len(found) == 1:
        single = found[0, kept[0]]
        error = single.std(ddof=1) / math.sqrt(single.size) if single.size > 1 else math.nan
        return Estimate(float(single.mean()), float(error))
    # The spread of the draws' means has both sources of error in it.
    means = np.array([row[mask].mean() for row, mask in zip(found, kept, strict=True) if mask.any()])
    error = means.std(ddof=1) / math.sqrt(means.size) if means.size > 1 else math.nan
    return Estimate(float(means.mean()), float(error))
