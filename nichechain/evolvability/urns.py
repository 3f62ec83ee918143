"""l-evolvability of estimated chains whatever their size: lineages draw rows of T as they enter them.

See :mod:`nichechain.chain.urns`: cost follows descendants, not niches.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.lineages import urns_of
from nichechain.core.intervals import drawn_interval, no_interval
from nichechain.core.randomness import Purpose, keyed
from nichechain.core.row_sampler import RowSampler
from nichechain.evolvability.record import draw_known
from nichechain.execution.side_by_side import side_by_side, stop_if_nobody_waits

if TYPE_CHECKING:
    from nichechain.chain.posterior import DirichletPosterior
    from nichechain.chain.urns import Urns
    from nichechain.evolvability.question import Question

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Lineages of a root are 2 to 40 times as many as are asked for: halves tell the noise, more lower it.
# Descendants of all roots up to which a draw has more.
_WORTHWHILE = 200_000
# Draws after which only what may be among the best is followed further.
_FEW_DRAWS = 8
# Descendants that are kept at once, by each thread.
_DESCENDANTS = 2_000_000


@dataclass(frozen=True)
class Simulated:
    """Coverage of m roots on D draws of T, each by simulated lineages.

    Parameters
    ----------
    coverage : (D, m, k) float64 array
        Unbiased estimates of the niches that U lineages visit, for k numbers U.
    noise : (D, m, k) float64 array
        Estimates of their variance given T.
    """

    coverage: Floats
    noise: Floats

    def summary(self, size: int = 0) -> tuple[Floats, Floats, Floats, Floats]:
        """Mean over the draws, its standard error, and 5 % and 95 % quantiles, (m,) each.

        Parameters
        ----------
        size : int
            Which of the k numbers of lineages.

        Notes
        -----
        Simulation widens the spread over draws by its own variance, which is known. Quantiles are drawn in
        towards the mean by the ratio of the standard deviations without and with it. Few draws tell
        that ratio badly where simulation is most of the spread: then it is at least half that of all
        roots together, and half of its own standard error.
        """
        drawn, noise = self.coverage[:, :, size], self.noise[:, :, size].mean(axis=0)
        mean = drawn.mean(axis=0)
        if len(drawn) == 1:
            return mean, np.sqrt(noise), *no_interval(mean)
        spread = drawn.var(axis=0, ddof=1)
        own = 1.0 - noise / np.maximum(spread, 1e-300)
        together = 1.0 - noise.mean() / max(spread.mean(), 1e-300)
        least = max(0.5 * together, 0.5 * math.sqrt(2.0 / (len(drawn) - 1)), 0.0)
        kept = np.sqrt(np.clip(own, min(least, 1.0), 1.0))
        low, high = drawn_interval(drawn)
        return mean, np.sqrt(spread / len(drawn)), mean + kept * (low - mean), mean + kept * (high - mean)


@dataclass(frozen=True)
class Record:
    """Where children of some genotypes are known to have landed.

    Parameters
    ----------
    children : (m, S) scipy.sparse.csr_array of int64
        How many in each state.
    strength : float
        α, how many children the row of T is worth beside them.
    """

    children: sparse.csr_array
    strength: float

    def draw(self, rng: np.random.Generator) -> tuple[Floats, sparse.csr_array]:
        """The part of their first generation that these speak for, and how they divide it."""
        return draw_known(self.children, rng, self.strength)


def simulated_coverage(
    posterior: DirichletPosterior,
    question: Question,
    sizes: list[int],
    *,
    roots: Ints | None = None,
    offspring: Floats | None = None,
    record: Record | None = None,
    numbers: range | None = None,
    on_done: Callable[[int], None] | None = None,
) -> Simulated:
    """Coverage of lineages on draws of T that are made as they are needed.

    Parameters
    ----------
    posterior : DirichletPosterior
    question : Question
        Generations, convention, draws and seed.
    sizes : list of int
        Numbers U of lineages, each at least 1.
    roots : (m,) int64 array, optional
        States that roots stand in.
    offspring : (S,) float64 array, optional
        D: where the children of a single root are. Give either this or ``roots``.
    record : Record, optional
        Of genotypes that stand in ``roots``: then all states that count come after the root's own.
    numbers : range, optional
        Which draws; by default all that are asked for.
    on_done : callable, optional
        Told how many more draws are done.

    Returns
    -------
    Simulated

    Notes
    -----
    Of M ≥ 2 U simulated lineages, U are drawn without replacement in expectation (Hurlbert 1971), which
    is unbiased for U lineages on the same T. Draw d comes from ``keyed(seed, Purpose.WALKS, d)``; roots
    have draws of their own. The row that a genotype's first generation is drawn from, where its record does
    not speak, is no row of later generations.
    """
    m = 1 if roots is None else roots.size
    counts_first = roots is None or record is not None or question.root_counts
    moves = question.steps - counts_first
    lineages = max(sizes) * int(np.clip(_WORTHWHILE // (m * question.steps * max(sizes)), 2, 40))
    at_once = max(1, _DESCENDANTS // (lineages * (moves + 1)))
    asked = range(question.draws) if numbers is None else numbers
    coverage = np.empty((len(asked), m, len(sizes)))
    noise = np.empty_like(coverage)

    def simulate(place: int) -> int:
        draw = asked[place]
        rng = keyed(question.seed, Purpose.WALKS, draw)
        urns = urns_of(posterior, keyed(question.seed, Purpose.POSTERIOR, draw))
        own = None if record is None else record.draw(keyed(question.seed, Purpose.FIRST_GENERATION, draw))
        for start in range(0, m, at_once):
            stop_if_nobody_waits()
            block = slice(start, min(start + at_once, m))
            if roots is None:
                assert offspring is not None
                first = rng.choice(offspring.size, (1, lineages), p=offspring / offspring.sum())
            else:
                first = np.repeat(roots[block], lineages).reshape(-1, lineages)
            if own is not None:
                first = _first_generation(first, own[0][block], own[1][block], urns, rng)
            begins = roots is not None and own is None
            states = urns.walks(first.astype(np.int64), moves, rng, roots=begins)
            coverage[place, block], noise[place, block] = covered(
                states[:, 0 if counts_first else lineages :], lineages, sizes, urns.niches
            )
        return place

    side_by_side(simulate, range(len(asked)), on_done)
    return Simulated(coverage, noise)


def _first_generation(
    roots: Ints, known: Floats, shares: sparse.csr_array, urns: Urns, rng: np.random.Generator
) -> Ints:
    """Children of roots (g, M): by what is known of each, in part, and else by the row of its niche."""
    lineages = roots.shape[1]
    first = urns.walks(roots, 1, rng, roots=True)[:, lineages:]
    root, lineage = np.nonzero(rng.random(roots.shape) < known[:, None])
    first[root, lineage] = RowSampler(shares).draw(root, rng)
    return first


def best_coverage(
    posterior: DirichletPosterior,
    question: Question,
    roots: Ints,
    best: int,
    on_done: Callable[[int], None] | None = None,
) -> tuple[Ints, Simulated]:
    """The same for the best of many roots: whoever cannot be one of them is left out after a few draws.

    Parameters
    ----------
    posterior, question, on_done
        As in :func:`simulated_coverage`, for U of the question.
    roots : (m,) int64 array
    best : int
        How many are wanted.

    Returns
    -------
    (c,) int64 array and Simulated
        Places in ``roots`` of those that may be among the best, and what all draws say of these.

    Notes
    -----
    A root is left out if its mean over the first draws is below that of the last of the best by more
    than three standard errors of each.
    """
    size = [question.lineages]
    few = range(min(_FEW_DRAWS, question.draws))
    first = simulated_coverage(posterior, question, size, roots=roots, numbers=few, on_done=on_done)
    if len(few) < 2 or roots.size <= best:
        left = np.arange(roots.size)
    else:
        drawn = first.coverage[:, :, 0]
        error = drawn.std(axis=0, ddof=1) / math.sqrt(len(few))
        # Few draws tell a spread badly.
        margin = 3.0 * np.maximum(error, np.median(error))
        mean = drawn.mean(axis=0)
        worst = np.sort(mean - margin)[-best]
        left = np.flatnonzero(mean + margin >= worst)
    begun = Simulated(first.coverage[:, left], first.noise[:, left])
    others = range(few.stop, question.draws)
    if not others:
        return left, begun
    rest = simulated_coverage(posterior, question, size, roots=roots[left], numbers=others, on_done=on_done)
    return left, Simulated(
        np.concatenate([begun.coverage, rest.coverage]), np.concatenate([begun.noise, rest.noise])
    )


def covered(states: Ints, lineages: int, sizes: list[int], niches: int) -> tuple[Floats, Floats]:
    """Niches visited by U of M lineages, and its variance as two halves tell it: (g, k) each."""
    from nichechain.evolvability import urn_steps

    half = lineages // 2
    tables = [
        np.stack([hit_probabilities(whole, size) for size in sizes])
        for whole in (lineages, half, lineages - half)
    ]
    whole, first, second = urn_steps.count(states, lineages, half, niches, *tables)
    return whole, (first - second) ** 2 / 4.0


def hit_probabilities(lineages: int, size: int) -> Floats:
    """P(one of c among M is among U drawn without replacement), for c from 0 to M."""
    missed = np.arange(lineages)
    left = np.maximum(lineages - size - missed, 0) / (lineages - missed)
    return np.concatenate([[0.0], 1.0 - np.cumprod(left)])
