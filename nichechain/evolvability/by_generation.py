"""Coverage of all niches for every number of generations and many numbers of lineages at once.

One table of answers: what a slider over generations and lineages goes through.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse, stats

from nichechain.chain.lineages import urns_of
from nichechain.chain.model import NicheChain
from nichechain.core.checks import check_at_least
from nichechain.core.compiled import compiled
from nichechain.core.intervals import drawn_interval
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.averaging import spread_of, widened
from nichechain.evolvability.question import MOST_EXACT, DrawnChain, Question, dense
from nichechain.evolvability.urns import hit_probabilities
from nichechain.execution.side_by_side import side_by_side

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Target niches treated together, and roots simulated together.
_COLUMNS = 128
_DESCENDANTS = 4_000_000
# Above this share of nonzeros a dense product is faster than a sparse one.
_DENSE = 0.3


def evolvability_table(
    chain: NicheChain,
    longest: int,
    lineages: Sequence[int],
    *,
    draws: int = 50,
    seed: int = 0,
    on_done: Callable[[int], None] | None = None,
) -> Floats:
    """l-evolvability of every niche, with its interval, for 1 to ``longest`` generations.

    Parameters
    ----------
    chain : NicheChain
    longest : int
        Generations l of the longest lineages, at least 1.
    lineages : sequence of int
        Numbers U of lineages, each at least 1.
    draws, seed : int
        Posterior draws of T, where it is estimated.
    on_done : callable, optional
        Told how many more draws are done.

    Returns
    -------
    (3, k, longest, n_niches) float64 array
        Mean over the draws and the ends of the 90 % interval, for each U and l.

    Notes
    -----
    Up to a thousand states each entry is that of :func:`nichechain.evolvability.niche_evolvability` on the
    same draws. Beyond, lineages are simulated, and few draws of T can be afforded: the interval is then
    that of another draw by Student's t, from the draws' standard deviation without the simulation's own.
    """
    check_at_least(1, longest=longest)
    sizes = [int(size) for size in lineages]
    check_at_least(1, lineages=min(sizes))
    question = Question(longest, max(sizes), draws=draws, seed=seed)
    question.warn_if_long(chain, chain.n_niches)
    if chain.posterior is not None and chain.states > MOST_EXACT:
        return _simulated(chain, longest, sizes, question, on_done)

    def reached(draw: int) -> Floats:
        return _exact(question.sample(chain, draw), longest, sizes, chain.n_niches)

    drawn = side_by_side(reached, range(question.number_of_samples(chain)), on_done)
    mean = np.mean(drawn, axis=0)
    return np.stack([mean, *widened(mean, *drawn_interval(drawn), spread_of(chain), chain.n_niches)])


def _exact(drawn: DrawnChain, longest: int, sizes: list[int], niches: int) -> Floats:
    """Niches that lineages visit on one T, (k, longest, n)."""
    transition, first = drawn.onward, None
    if drawn.concentration is not None:
        first = dense(drawn.children(np.arange(niches)))
    if isinstance(transition, sparse.csr_array) and transition.nnz > _DENSE * transition.shape[0] ** 2:
        transition = transition.toarray()
    plan = _products(sizes)
    found = np.zeros((len(sizes), longest, niches))
    for start in range(0, niches, _COLUMNS):
        targets = np.arange(start, min(start + _COLUMNS, niches))
        hit = np.zeros((transition.shape[0], targets.size))
        hit[targets, targets - start] = 1.0
        for step in range(longest):
            begun = None if first is None else first @ hit
            hit = np.ascontiguousarray(transition @ hit)
            _add_reached(hit[:niches] if begun is None else begun, *plan, found[:, step])
            # A lineage that stands on its target has visited it, wherever it goes next.
            hit[targets, targets - start] = 1.0
    return found


def _products(exponents: list[int]) -> tuple[Ints, Ints]:
    """How to make whole powers by few products: factors of each, (p, 2), and where the powers are.

    Product p is number p + 1; number 0 is the base.
    """
    known = {1: 0}
    factors: list[tuple[int, int]] = []

    def product(one: int, other: int, exponent: int | None = None) -> int:
        factors.append((one, other))
        if exponent is not None:
            known[exponent] = len(factors)
        return len(factors)

    for exponent in exponents:
        power, left = None, exponent
        while left:
            step = max(size for size in known if size <= left)
            if 2 * step <= left:
                product(known[step], known[step], 2 * step)
                continue
            power = known[step] if power is None else product(power, known[step])
            left -= step
        assert power is not None
        known[exponent] = power
    return np.array(factors, np.int64).reshape(-1, 2), np.array([known[size] for size in exponents])


@compiled
def _add_reached(hit: Any, factors: Any, powers: Any, found: Any) -> None:
    """Add 1 - (1 - h)^U of the targets (m, c) to the niches reached, (k, m)."""
    roots, targets = hit.shape
    number = np.empty((len(factors) + 1, targets))
    for root in range(roots):
        for j in range(targets):
            number[0, j] = max(0.0, 1.0 - hit[root, j])
        for p in range(len(factors)):
            one, other = factors[p]
            for j in range(targets):
                number[p + 1, j] = number[one, j] * number[other, j]
        for k in range(len(powers)):
            found[k, root] += targets - number[powers[k]].sum()


def _simulated(
    chain: NicheChain,
    longest: int,
    sizes: list[int],
    question: Question,
    on_done: Callable[[int], None] | None,
) -> Floats:
    """The same by lineages that draw rows of T as they enter them."""
    assert chain.posterior is not None
    posterior, n, lineages = chain.posterior, chain.n_niches, 2 * max(sizes)
    half = lineages // 2
    tables = [np.stack([hit_probabilities(size, u) for u in sizes]) for size in (lineages, half)]
    at_once = max(1, _DESCENDANTS // (lineages * (longest + 1)))

    def reached(draw: int) -> tuple[Floats, Floats]:
        """Niches that lineages visit on one draw of T, and the simulation's variance, (k, longest, n)."""
        rng = keyed(question.seed, Purpose.WALKS, draw)
        urns = urns_of(posterior, keyed(question.seed, Purpose.POSTERIOR, draw))
        parts = []
        for start in range(0, n, at_once):
            roots = np.arange(start, min(start + at_once, n))
            first = np.repeat(roots, lineages).reshape(-1, lineages)
            states = urns.walks(first, longest, rng, roots=True)[:, lineages:]
            parts.append(_count(states, lineages, n, longest, *tables))
        whole, halves = (
            np.ascontiguousarray(np.moveaxis(np.concatenate(found), 0, 2))
            for found in zip(*parts, strict=True)
        )
        return whole, halves

    found = side_by_side(reached, range(question.draws), on_done)
    drawn = np.stack([whole for whole, _ in found])
    noise = np.zeros(drawn.shape[1:])
    for _, halves in found:
        noise += halves / question.draws
    mean, low, high = _by_spread(drawn, noise)
    return np.stack([mean, *widened(mean, low, high, spread_of(chain), n)])


def _by_spread(drawn: Floats, noise: Floats) -> Floats:
    """Mean and interval of few draws, whose spread has the simulation's own variance in it."""
    draws, mean = len(drawn), drawn.mean(axis=0)
    if draws == 1:
        return np.stack([mean, mean, mean])
    # The noise of one niche is known badly, that of all of them well.
    own = np.maximum(drawn.var(axis=0, ddof=1) - noise.mean(axis=-1, keepdims=True), 0.0)
    together = own.mean(axis=-1, keepdims=True)
    variance = np.maximum(own, 0.5 * together)
    half = stats.t.ppf(0.95, draws - 1) * np.sqrt(variance * (1.0 + 1.0 / draws))
    return np.stack([mean, np.maximum(mean - half, 0.0), np.minimum(mean + half, drawn.shape[-1])])


@compiled
def _count(states: Any, lineages: Any, niches: Any, longest: Any, whole: Any, part: Any) -> Any:
    """Niches visited within 1 to ``longest`` generations, and their variance by halves: (g, k, longest)."""
    g, sizes, half = states.shape[0], whole.shape[0], lineages // 2
    found = np.zeros((g, sizes, longest))
    noise = np.zeros((g, sizes, longest))
    number = np.zeros((niches, 2), np.int64)
    sums = np.zeros((3, sizes))
    for root in range(g):
        sums[:] = 0.0
        for step in range(longest):
            for lineage in range(lineages):
                state = states[root, step * lineages + lineage]
                if state >= niches:
                    continue
                again = False
                for earlier in range(step):
                    if states[root, earlier * lineages + lineage] == state:
                        again = True
                        break
                if again:
                    continue
                side = 0 if lineage < half else 1
                mine = number[state, side]
                both = number[state, 0] + number[state, 1]
                for k in range(sizes):
                    sums[0, k] += whole[k, both + 1] - whole[k, both]
                    sums[1 + side, k] += part[k, mine + 1] - part[k, mine]
                number[state, side] += 1
            for k in range(sizes):
                found[root, k, step] = sums[0, k]
                noise[root, k, step] = (sums[1, k] - sums[2, k]) ** 2 / 4.0
        for visit in range(longest * lineages):
            if states[root, visit] < niches:
                number[states[root, visit]] = 0
    return found, noise
