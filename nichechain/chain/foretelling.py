"""How well guesses foretell the children of elites that they were not made of.

Fitted to the births that they are made of, guesses vouch for each other: two births of neighbouring rows
that fell into one niche by chance look like a neighbour's word. So the weights of the kinds of guesses, and
how much the base counts beside a row's own births, are judged by elites that were left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from nichechain.births.families import elites_of, folds_of
from nichechain.chain.attribution import attributed, floored
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.families import families_of
from nichechain.chain.kinds import Kinds
from nichechain.chain.siblings import effect_of, sibling_correlation
from nichechain.core.randomness import Purpose, keyed

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_FOLDS = 4
# Births left out are few numbers' evidence: folds are left out one after the other until there are so many.
_ENOUGH = 15_000
_ROUNDS, _STEPS = 6, 30
_STRENGTH = 30.0
_LOG_STRENGTHS = (-7.0, 9.0)
_MOST_ERROR = 1.0


@dataclass(frozen=True)
class LeftOut:
    """Children of elites that were left out, and what the others' births say of them.

    Parameters
    ----------
    expected : (k, N) float64 array
        What each kind of guess expects of each pair of states.
    own, row : (N,) float64 arrays
        Independent births of the same pair, and of the same row, that are left.
    births : (N,) float64 array
        How many were left out.
    elite, entry, children : (F,) arrays
        The same by elites: whose children they are, which of the N, and how many.
    """

    expected: Floats
    own: Floats
    row: Floats
    births: Floats
    elite: Ints
    entry: Ints
    children: Floats

    def guessed(self, weights: Floats) -> Floats:
        """The same of all kinds together, (N,)."""
        found: Floats = np.einsum("k,kn->n", weights, self.expected)
        return found

    def foretold(self, weights: Floats, strength: float) -> Floats:
        """T_ij of the pairs by the births that are left, (N,)."""
        found: Floats = (self.own + strength * self.guessed(weights)) / (self.row + strength)
        return found


def leave_out(counts: TransitionCounts, kinds: Kinds, parent: Ints, child: Ints) -> LeftOut:
    """Leave a quarter of the elites out, with all their children, then the next.

    Parameters
    ----------
    counts : TransitionCounts
        Births that do not say whose they are count as their own families.
    kinds : Kinds
        Of the pairs that have births.
    parent, child : (E,) int64 arrays
        These pairs, sorted.
    """
    states = counts.niches.states
    families = families_of(counts)
    elite = elites_of(families)
    pair = np.searchsorted(parent * states + child, families[:, 0] * states + families[:, 2])
    births = int(families[:, 3].sum())
    folds = max(_FOLDS, births // _ENOUGH)
    # At random: in order of what they had, the births left would be too good a picture of those left out.
    fold = folds_of(elite, folds, keyed(0, Purpose.LEFT_OUT))
    correlation = sibling_correlation(counts)
    parts = []
    seen = entries = 0
    for number in range(folds):
        if seen >= _ENOUGH:
            break
        out = fold == number
        left, gone = families[~out], families[out, 3].astype(np.float64)
        total = np.bincount(left[:, 0], left[:, 3], states).astype(np.int64)
        effect = effect_of(left, total, correlation)
        own = np.bincount(pair[~out], left[:, 3], parent.size) / effect[parent]
        expected = kinds.expected(attributed(kinds, own, total / effect))
        some, entry = np.unique(pair[out], return_inverse=True)
        held = np.bincount(entry, gone, some.size)
        row = (total / effect)[parent[some]]
        parts.append((expected[:, some], own[some], row, held, elite[out], entries + entry, gone))
        seen, entries = seen + int(gone.sum()), entries + some.size
    if not parts:
        nothing, none = np.zeros(0), np.zeros(0, np.int64)
        return LeftOut(np.zeros((kinds.number, 0)), nothing, nothing, nothing, none, none, nothing)
    return LeftOut(*(np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)))


def weighed(left: LeftOut, strength: float | None = None) -> tuple[Floats, float, float]:
    """The weights and the strength under which rows best foretell children of elites left out.

    Parameters
    ----------
    left : LeftOut
    strength : float, optional
        s, where it is not to be fitted.

    Returns
    -------
    weights : (k,) float64 array
    strength : float
    error : float
        Standard error of the logarithm of the strength; 0 where it was given.

    Notes
    -----
    Maximises Σ c log T_ij over births left out, with T_ij = (C_ij + s Σ_k w_k B^k_ij) / (N_i + s) of the
    births that are left: w by expectation maximisation, s by a line search, in turns. The marginal
    likelihood of the counts would take the likeness of siblings for a difference between niches, and find
    too small a strength. The error is that of estimating equations, summed over elites (Huber 1967), as an
    elite's children are not independent.
    """
    kinds = len(left.expected)
    weights = floored(np.full(kinds, 1.0 / kinds))
    found = _STRENGTH if strength is None else strength
    if not left.births.size:
        return weights, 1.0 if strength is None else strength, 0.0
    for _ in range(_ROUNDS):
        for _ in range(_STEPS):
            explained = left.births * found / (left.own + found * left.guessed(weights))
            weights = floored(weights * np.einsum("kn,n->k", left.expected, explained))
        if strength is None:
            found = _strength(left, weights)
    return weights, found, 0.0 if strength is not None else _error(left, weights, found)


def _strength(left: LeftOut, weights: Floats) -> float:
    def surprise(log_strength: float) -> float:
        return -float(left.births @ np.log(left.foretold(weights, float(np.exp(log_strength)))))

    return float(np.exp(minimize_scalar(surprise, bounds=_LOG_STRENGTHS, method="bounded").x))


def _error(left: LeftOut, weights: Floats, strength: float) -> float:
    step = 0.05
    below, here, above = (
        np.log(left.foretold(weights, float(strength * np.exp(shift)))) for shift in (-step, 0.0, step)
    )
    bend = -float(left.births @ (above - 2.0 * here + below)) / step**2
    slope = (above - below) / (2.0 * step)
    slopes = np.bincount(left.elite, left.children * slope[left.entry])
    # Where s is so large that rows are all base, the likelihood is flat and its size makes no difference.
    return _MOST_ERROR if bend <= 0 else min(_MOST_ERROR, float(np.sqrt((slopes**2).sum()) / bend))
