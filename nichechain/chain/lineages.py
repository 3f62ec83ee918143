"""What unselected lineages do otherwise than the children of elites, judged by births of lineages.

A row of T says where children of a niche's elites land. A lineage of one elite differs in two ways. Its
members are no elites, and stay where they are more often, or less. And they take after each other, so that
lineages of one elite go the same ways more often than lineages of many: each elite has rows of its own.
Both are measured on the broods that a search, or a calibration, has among its births: several lineages
of the same elite. Without any, lineages are taken to do what elites' children do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import minimize_scalar

from nichechain.chain.operator import PooledTransition
from nichechain.chain.small_urns import MOST_STATES, MOST_VISITS, SmallUrns, WholeRows
from nichechain.chain.urns import UrnRows, Urns
from nichechain.core.randomness import Purpose, keyed

if TYPE_CHECKING:
    from nichechain.chain.model import Transition
    from nichechain.chain.posterior import DirichletPosterior

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# What τ may be, and what is thought of it before any lineage was seen: 20, or e² times more or less.
_LOG_CONCENTRATIONS = np.linspace(0.0, 9.0, 10)
_EXPECTED, _SPREAD = 3.0, 2.0
# Odds of staying are thought to change by a factor of e² or less.
_STAY_SPREAD = 2.0
_FINE = 181
# A brood's number of niches is never known better than to a tenth, few broods tell their spread badly.
_LEAST_SPREAD = 0.1
_REPEATS = 40
# Elites change over a search, and those that are left are asked about: broods of the later half, or so many.
_FEWEST = 10
# Few broods tell badly how far elites differ. On the tasks that the method was made on, the square of the
# ratio was 2 on average, from 1.2 to 2.6: as sure as 20 broods are. Whole numbers have a least deviation.
_USUAL = 2.0
_IMAGINARY = 20.0
_LEAST_DEVIATION = 0.5
_TINY = 1e-300
# Three quarters of a drawn row of 400 states are smaller, and hold less than 1e-4 of it together.
_SPECK = 1e-7


@dataclass(frozen=True)
class LineageLaw:
    """How rows for lineages of one elite follow from T.

    Row i for the first generation is Dirichlet(α T_i), and for later ones Dirichlet(τ T'_i), where T' is T
    with other odds of staying. Each elite has a draw of its own.

    Parameters
    ----------
    stay : float
        b: odds of staying are e^b times those of T.
    stay_error : float
        Its standard error.
    log_concentrations, weights : (K,) float64 arrays
        Values that log τ may have, and how likely each is.
    spread : float
        How many times wider elites differ in what their lineages reach than such rows make them, at
        least 1.
    broods, births : int
        What it rests on: elites whose lineages were followed, and births of these.
    """

    stay: float
    stay_error: float
    log_concentrations: Floats
    weights: Floats
    spread: float
    broods: int
    births: int

    @property
    def concentration(self) -> float:
        """τ, the median: how many births T's row is worth to the rows of one elite's lineages."""
        middle = np.searchsorted(np.cumsum(self.weights), 0.5)
        return float(np.exp(self.log_concentrations[middle]))

    def taken_as_known(self) -> LineageLaw:
        """The same with b and τ in the middle of what they may be, for chains that have them in common."""
        middle = np.array([np.log(self.concentration)])
        return replace(self, stay_error=0.0, log_concentrations=middle, weights=np.ones(1))

    def drawn(self, rng: np.random.Generator) -> tuple[float, float]:
        """B and τ as lineages allow them as well."""
        stay = self.stay + self.stay_error * float(rng.standard_normal())
        return stay, float(np.exp(rng.choice(self.log_concentrations, p=self.weights)))

    def onward(self, transition: Transition, rng: np.random.Generator) -> Transition:
        """Rows that later generations are drawn from, given a draw of T (S, S).

        Notes
        -----
        Of a :class:`PooledTransition` only what births say one by one is drawn again.
        """
        stay, concentration = self.drawn(rng)
        if isinstance(transition, np.ndarray):
            tilted = transition.copy()
            tilted[np.diag_indices_from(tilted)] *= np.exp(stay)
            return scattered_rows(tilted / tilted.sum(axis=1, keepdims=True), concentration, rng)
        kept = transition.kept if isinstance(transition, PooledTransition) else transition
        more = kept.diagonal() * np.expm1(stay)
        scale = 1.0 / (1.0 + more)
        tilted = (sparse.diags_array(scale) @ (kept + sparse.diags_array(more))).tocsr()
        drawn = _redrawn_entries(tilted, concentration, rng)
        if not isinstance(transition, PooledTransition):
            return drawn
        shares, spread = transition.shares * scale[:, None], transition.spread * scale
        return replace(transition, kept=drawn, shares=shares, spread=spread)


def fitted_law(posterior: DirichletPosterior, repeats: int = _REPEATS) -> LineageLaw | None:
    """The law that births of lineages make likely, or None where there are none.

    Parameters
    ----------
    posterior : DirichletPosterior
        Its counts have the lineages; rows of T are from births that are not of lineages.
    repeats : int
        Simulations of each brood, at least 2.

    Notes
    -----
    b maximises the likelihood of which births of lineages stay. τ makes simulated broods, each with as many
    lineages of the same lengths, reach as many niches as the real ones on average. Broods begun in the
    earlier half of the time are left out, if ten are left. A normal distribution
    of log τ around log 20, two wide, stands for what is thought of it before. A likelihood of single
    steps would see little of τ: what elites differ in is how far their lineages overlap. How many niches
    broods reach differs by more than simulated ones do, where elites differ in more than rows drawn
    independently. That ratio is the root mean square of real broods' distances from simulated ones, in
    standard deviations of these; one degree of freedom goes to τ, and twenty imaginary broods speak for a
    square of 2, which is what tasks with many broods have.
    """
    table = _latest(posterior.counts.lineages)
    if not len(table):
        return None
    stay, error = _stay(posterior, table)
    broods = _Broods(table, len(posterior.counts.niches), repeats)
    rows = UrnRows.of(posterior)
    first = rows.scattered(posterior.elite_concentration)
    later = rows.with_stay(_base_stay(posterior), stay)
    rng = keyed(0, Purpose.LINEAGE_LAW)
    kinds = [later.scattered(float(concentration)) for concentration in np.exp(_LOG_CONCENTRATIONS)]
    difference = broods.simulated(posterior, first, kinds, rng).mean(axis=2) - broods.reached
    off = difference.mean(axis=1)
    spread = difference.std(axis=1, ddof=1) if broods.reached.size > 1 else np.zeros(len(kinds))
    least = max(_LEAST_SPREAD * broods.reached.mean(), _LEAST_DEVIATION)
    known = np.maximum(spread, least) / np.sqrt(broods.reached.size)
    fine = np.linspace(_LOG_CONCENTRATIONS[0], _LOG_CONCENTRATIONS[-1], _FINE)
    miss = np.interp(fine, _LOG_CONCENTRATIONS, off) / np.interp(fine, _LOG_CONCENTRATIONS, known)
    likely = np.exp(-0.5 * (miss**2 + ((fine - _EXPECTED) / _SPREAD) ** 2))
    law = LineageLaw(stay, error, fine, likely / likely.sum(), 1.0, broods.reached.size, len(table))
    (found,) = broods.simulated(posterior, first, [later.scattered(law.concentration)], rng)
    distance = (broods.reached - found.mean(axis=1)) / np.maximum(found.std(axis=1, ddof=1), _LEAST_DEVIATION)
    ratio = np.sqrt(((distance**2).sum() + _IMAGINARY * _USUAL) / (distance.size - 1 + _IMAGINARY))
    return replace(law, spread=max(1.0, float(ratio)))


def urns_of(posterior: DirichletPosterior, rng: np.random.Generator) -> Urns:
    """Urns of one draw of what is not known beyond rows: base, strength, and the law of lineages."""
    settled = posterior.settled(rng)
    rows = UrnRows.of(settled)
    if posterior.law is None:
        return Urns(settled, rows, rows)
    stay, concentration = posterior.law.drawn(rng)
    later = rows.with_stay(_base_stay(settled), stay).scattered(concentration)
    return Urns(settled, rows.scattered(posterior.elite_concentration), later)


def _latest(table: Ints) -> Ints:
    """Rows of the broods begun in the later half of the time, and of the last few at least."""
    if not len(table):
        return table
    newest = np.sort(np.unique(table[:, [5, 0]], axis=0)[:, 0])[::-1]
    kept: Ints = table[table[:, 5] >= min(newest[0] // 2, newest[:_FEWEST][-1])]
    return kept


def _stay(posterior: DirichletPosterior, table: Ints) -> tuple[float, float]:
    """The logarithm of the factor on odds of staying, and its standard error."""
    later = table[table[:, 2] > 1]
    if posterior.absorbing:
        later = later[later[:, 3] < posterior.counts.niches.states - 1]
    state, child = later[:, 3], later[:, 4]
    total = UrnRows.of(posterior).total
    own = posterior.weights.diagonal() + posterior.strength * _base_stay(posterior)
    odds = np.log(np.maximum(own, _TINY) / np.maximum(total - own, _TINY))[state]
    stayed = child == state

    def surprise(b: float) -> float:
        logit = odds + b
        prior = 0.5 * (b / _STAY_SPREAD) ** 2
        return float(np.logaddexp(0.0, logit).sum() - logit[stayed].sum() + prior)

    best = float(minimize_scalar(surprise, bounds=(-6.0, 6.0), method="bounded").x)
    p = 1.0 / (1.0 + np.exp(-(odds + best)))
    return best, float(1.0 / np.sqrt((p * (1.0 - p)).sum() + _STAY_SPREAD**-2))


def _base_stay(posterior: DirichletPosterior) -> Floats:
    """B_ii, (S,)."""
    states = np.arange(posterior.counts.niches.states)
    return posterior.base.probability(states, states)


class _Broods:
    """Lineages by their elites: what they reached, and simulated ones of the same number and lengths."""

    def __init__(self, table: Ints, niches: int, repeats: int) -> None:
        self._niches, self._repeats = niches, repeats
        brood, lineage, generation = table[:, 0], table[:, 1], table[:, 2]
        _, brood = np.unique(brood, return_inverse=True)
        # Lineages of a brood are numbered from 0.
        pairs, which = np.unique(np.stack([brood, lineage]), axis=1, return_inverse=True)
        number = np.arange(pairs.shape[1]) - np.searchsorted(pairs[0], pairs[0])
        longest, widest = int(generation.max()), int(number.max()) + 1
        self._present = np.zeros((brood.max() + 1, longest, widest), bool)
        self._present[brood, generation - 1, number[which.ravel()]] = True
        self._size = np.bincount(pairs[0])
        self._root = np.zeros(self._size.size, np.int64)
        first = generation == 1
        self._root[brood[first]] = table[first, 3]
        inside = table[:, 4] < niches
        reached = np.unique(np.stack([brood[inside], table[inside, 4]]), axis=1)
        self.reached: Floats = np.bincount(reached[0], minlength=self._size.size).astype(np.float64)

    def simulated(
        self, posterior: DirichletPosterior, first: UrnRows, later: list[UrnRows], rng: np.random.Generator
    ) -> Floats:
        """Niches that such broods reach when their later rows are each of some, (K, B, repeats)."""
        generations, states = self._present.shape[1], first.strength.size
        found = np.zeros((len(later), self._size.size, self._repeats))
        for size in np.unique(self._size):
            these = np.flatnonzero(self._size == size)
            roots = np.repeat(self._root[these], self._repeats * size).reshape(-1, size)
            kept = self._present[these][:, :, :size].reshape(these.size, -1)
            kept = np.repeat(kept, self._repeats, axis=0)
            small = states <= MOST_STATES and size * (generations + 1) <= MOST_VISITS
            # Urns of many states are gone through one by one, so that one kind is kept at a time.
            for some in [slice(0, len(later))] if small else [slice(k, k + 1) for k in range(len(later))]:
                kinds = later[some]
                if small:
                    urns = _small_urns(posterior, first, kinds)
                    walks = urns.walks(np.tile(roots, (len(kinds), 1)), generations, rng)
                else:
                    walks = Urns(posterior, first, kinds[0]).walks(roots, generations, rng, roots=True)
                visited = walks[:, size:]
                visited = np.where(np.tile(kept, (len(kinds), 1)) & (visited < self._niches), visited, -1)
                visited.sort(axis=1)
                new = (visited[:, 1:] != visited[:, :-1]).sum(axis=1) + (visited[:, 0] >= 0)
                found[some, these] = new.reshape(len(kinds), these.size, self._repeats)
        return found


def _small_urns(posterior: DirichletPosterior, first: UrnRows, later: list[UrnRows]) -> SmallUrns:
    """Urns of few states, whose later rows differ in nothing but how sure they are."""
    base = posterior.base.rows(np.arange(first.strength.size))
    begins, goes_on = (WholeRows.of(rows, base, absorbing=posterior.absorbing) for rows in (first, later[0]))
    return SmallUrns(begins, goes_on.worth(later))


def scattered_rows(rows: Floats, concentration: float, rng: np.random.Generator) -> Floats:
    """Distributions drawn around some, Dirichlet(τ p), (..., S): what holds next to nothing gets nothing."""
    weight = np.zeros_like(rows)
    kept = rows > _SPECK
    weight[kept] = rng.standard_gamma(concentration * rows[kept])
    total = weight.sum(axis=-1, keepdims=True)
    drawn: Floats = np.where(total > _TINY, weight / np.maximum(total, _TINY), rows)
    return drawn


def _redrawn_entries(
    rows: sparse.csr_array, concentration: float, rng: np.random.Generator
) -> sparse.csr_array:
    """The same of the entries of each row, whose sum stays as it is."""
    row = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
    before = np.bincount(row, rows.data, rows.shape[0])
    weight = rng.standard_gamma(concentration * np.maximum(rows.data, 0.0))
    total = np.bincount(row, weight, rows.shape[0])
    scale = before / np.maximum(total, _TINY)
    data = np.where(total[row] > _TINY, weight * scale[row], rows.data)
    return sparse.csr_array((data, rows.indices, rows.indptr), shape=rows.shape)
