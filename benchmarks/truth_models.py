"""What ``benchmarks/truth.py`` asks of an estimator, and those that it knows by name.

An estimator is any callable from births and niches to a :class:`Model`, so a prototype is scored by
adding a line to :data:`ESTIMATORS`, or with ``--prototype MODULE:FUNCTION``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pyarrow as pa
from scipy import sparse

from nichechain import NicheChain, Niches, TransitionCounts, estimate
from nichechain.births import NONE
from nichechain.core.row_sampler import RowSampler
from nichechain.evolvability.averaging import spread_of
from nichechain.evolvability.question import Question, dense
from nichechain.evolvability.record import draw_children
from nichechain.validation.rollouts import niches_reached

DRAWS, CHECKS = 50, 200
"""Draws of what births leave unknown, and simulated checks on all of them together."""

STARTS = ("niche", "elite", "genotype")


@dataclass(frozen=True)
class Roots:
    """Elites that lineages begin with.

    Parameters
    ----------
    niche, uid : (R,) int64 arrays
        Where they stand, and which births they are; the birth need not be among those that the
        estimator was given.
    offspring : (R, m) int64 array
        Where m fresh children of each landed, ``NONE`` where they failed: for a genotype start.
    """

    niche: np.ndarray
    uid: np.ndarray
    offspring: np.ndarray


@dataclass(frozen=True)
class Steps:
    """Births whose child is to be foretold.

    Parameters
    ----------
    child : (N,) int64 array
        State it landed in.
    history : (N, H) int64 array
        States of its parent, its parent's parent and so on, ``NONE`` beyond what is known.
    recorded : (N,) int64 array
        uid of the nearest ancestor that is a birth of the archive, ``NONE`` where it is not known.
    since : (N,) int64 array
        Which ancestor that is: 0 for the parent itself, 1 for its parent, and so on.
    depth : (N,) int64 array
        Of the parent.
    """

    child: np.ndarray
    history: np.ndarray
    recorded: np.ndarray
    since: np.ndarray
    depth: np.ndarray

    def __len__(self) -> int:
        return len(self.child)


@dataclass(frozen=True)
class Forecast:
    """Niches that lineages reach, as a model has it.

    Parameters
    ----------
    draws : (D, R, l) float64 array
        Expected number of niches up to each generation, in each draw of all that births leave
        unknown; a single one where the model has no such thing.
    simulated : (R, l, K) float64 array
        Numbers of K simulated checks on those draws: what is unknown and the chance of so few
        lineages are both in their spread.
    """

    draws: np.ndarray
    simulated: np.ndarray

    @property
    def value(self) -> np.ndarray:
        """Expected number, (R, l)."""
        return self.draws.mean(axis=0)


class Model(Protocol):
    """What an estimator makes of births."""

    def forecast(self, roots: Roots, generations: int, lineages: int, seed: int) -> dict[str, Forecast]:
        """Forecasts by start: those of :data:`STARTS` that the model has."""
        ...

    def log_probability(self, steps: Steps) -> np.ndarray:
        """Logarithm of the probability of each child, (N,)."""
        ...


Estimator = Callable[[pa.Table, Niches], Model]
"""Births have the columns of :mod:`nichechain.births`, and ``lineage``: whether the parent is the
latest birth of a lineage without selection. A parent need not be among the births."""


class PlainChain:
    """A chain over niches, with a posterior for T or without."""

    def __init__(self, births: pa.Table, niches: Niches, estimator: str) -> None:
        elite, child = (
            births[name].fill_null(NONE).to_numpy().astype(np.int64) for name in ("parent_uid", "child_niche")
        )
        counts = TransitionCounts.from_births(births, niches)
        self.chain: NicheChain = estimate(counts, estimator)  # type: ignore[arg-type]
        self._families = elite, child

    def log_probability(self, steps: Steps) -> np.ndarray:
        """Of the mean of T."""
        with np.errstate(divide="ignore"):
            return np.log(dense(self.chain.T)[steps.history[:, 0], steps.child])

    def forecast(self, roots: Roots, generations: int, lineages: int, seed: int) -> dict[str, Forecast]:
        """From all three starts; the last two give the elite its own children beside the row of T."""
        chain, states = self.chain, self.chain.states
        known = {
            "niche": np.zeros((roots.niche.size, states)),
            "elite": self._recorded(roots.uid),
            "genotype": self._recorded(roots.uid) + _landed(roots.offspring, states),
        }
        question = Question(draws=DRAWS, seed=seed)
        draws = 1 if chain.posterior is None else DRAWS
        values, simulated = [], []
        for number, drawn in enumerate(question.samples(chain)):
            rng = np.random.default_rng([seed, number])
            rows = dense(drawn.children(roots.niche))
            strength = 1.0 if chain.posterior is None else chain.posterior.elite_concentration
            firsts = [rows, *(draw_children(known[s], rows, rng, strength) for s in ("elite", "genotype"))]
            first, onward = np.concatenate(firsts), dense(drawn.onward)
            values.append(coverage(onward, first, generations, lineages, chain.n_niches))
            simulated.append(
                simulated_coverage(onward, first, generations, lineages, chain.n_niches, CHECKS // draws, rng)
            )
        expected, checks = np.stack(values), np.concatenate(simulated, axis=2).astype(np.float64)
        middle = checks.mean(axis=2, keepdims=True)
        checks = np.clip(middle + spread_of(chain) * (checks - middle), 0.0, chain.n_niches)
        size = roots.niche.size
        return {
            start: Forecast(expected[:, k * size :][:, :size], checks[k * size :][:size])
            for k, start in enumerate(STARTS)
        }

    def _recorded(self, uid: np.ndarray) -> np.ndarray:
        """Children that births have recorded of each elite, by state."""
        elite, child = self._families
        counted = np.zeros((uid.size, self.chain.states))
        row = {int(u): k for k, u in enumerate(uid)}
        for birth in np.flatnonzero(np.isin(elite, uid) & (child != NONE)):
            counted[row[int(elite[birth])], child[birth]] += 1
        return counted


def coverage(
    matrix: np.ndarray, first: np.ndarray, generations: int, lineages: int, niches: int
) -> np.ndarray:
    """Expected number of niches of lineages that begin with rows of ``first``, (m, generations)."""
    place = np.arange(niches)
    hit = np.zeros((len(matrix), niches))
    hit[place, place] = 1.0
    multiplied = sparse.csr_array(matrix) if np.count_nonzero(matrix) < 0.3 * matrix.size else matrix
    found = np.empty((len(first), generations))
    for k in range(generations):
        with np.errstate(divide="ignore"):
            missed = np.log1p(-np.minimum(first @ hit, 1.0))
        found[:, k] = -np.expm1(lineages * missed).sum(axis=1)
        hit = multiplied @ hit
        hit[place, place] = 1.0
    return found


def simulated_coverage(
    matrix: np.ndarray,
    first: np.ndarray,
    generations: int,
    lineages: int,
    niches: int,
    checks: int,
    rng: np.random.Generator,
) -> np.ndarray:
    """Number of niches that simulated lineages reach, (m, generations, checks)."""
    size, roots = len(matrix), len(first)
    # The starts are states of their own, entered from nowhere.
    whole = np.zeros((size + roots, size + roots))
    whole[:size, :size], whole[size:, :size] = matrix, first
    begin = np.repeat(np.arange(size, size + roots), checks * lineages)
    sampler, here, states = RowSampler(sparse.csr_array(whole)), begin, []
    for _ in range(generations):
        here = sampler.draw(here, rng)
        states.append(here)
    walks = np.stack(states, axis=-1).reshape(roots * checks, lineages, generations)
    found = niches_reached(walks, niches)
    return found.reshape(roots, checks, generations).swapaxes(1, 2)


def _landed(offspring: np.ndarray, states: int) -> np.ndarray:
    return np.stack([np.bincount(row[row != NONE], minlength=states) for row in offspring])


def _plain(name: str) -> Estimator:
    return lambda births, niches: PlainChain(births, niches, name)


ESTIMATORS: dict[str, Estimator] = {name: _plain(name) for name in ("empirical-bayes", "dirichlet", "mle")}
