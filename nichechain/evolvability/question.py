"""What is asked of a chain: how long and how many lineages, from which root, on which draws of T."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeVar, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.chain.lineages import scattered_rows
from nichechain.chain.model import NicheChain, Transition
from nichechain.core.checks import as_floats, check_at_least, check_choice, check_fits, check_seed
from nichechain.core.duration import warn_if_long
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.niches import Niche

Item = TypeVar("Item")

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Method = Literal["auto", "exact", "monte-carlo"]
"""How l-evolvability is computed."""
Convention = Literal["definition", "procedure"]
"""Whether the root's own state counts: it does by ``procedure``, not by ``definition``."""

DRAWS = 50
"""Posterior draws of T that a value is averaged over."""
MOST_EXACT = 1_000
"""States up to which l-evolvability of an estimated chain is computed in closed form by default."""

# States whose elites' rows are drawn together: few generators, and little in vain for a single root.
_TOGETHER = 16

# What a processor does in a second.
_MOVES_A_SECOND, _SUMS_A_SECOND = 4e6, 2e10
# Lineages that are longer or more numerous cost more to simulate than their closed form.
_LONGEST, _MOST_LINEAGES = 1_000, 10_000


@dataclass(frozen=True)
class DrawnChain:
    """One T that births allow, and what lineages do by it.

    Parameters
    ----------
    rows : (S, S) array, scipy.sparse.csr_array or PooledTransition
        T: where children of a niche's elites land.
    onward : (S, S) array, scipy.sparse.csr_array or PooledTransition
        Rows that generations after the first are drawn from; T itself where births tell nothing of
        lineages.
    concentration : float, optional
        α, where an elite has a distribution of its own for its children, Dirichlet(α T_i).
    seed, number : int
        Of the question, and of the draw.
    """

    rows: Transition
    onward: Transition
    concentration: float | None
    seed: int
    number: int

    def children(self, states: Ints) -> Transition:
        """Distributions of generation 1 of elites in some states, (m, S).

        Those of 16 states that follow one another are drawn together, from
        ``keyed(seed, Purpose.ELITE_ROW, number * blocks + block)``, whatever states are asked for.
        """
        if self.concentration is None:
            some: Transition = self.rows[states]
            return some
        size = self.rows.shape[0]
        blocks = -(-size // _TOGETHER)
        own = np.empty((states.size, size))
        for block in np.unique(states // _TOGETHER).tolist():
            members = np.arange(block * _TOGETHER, min((block + 1) * _TOGETHER, size))
            rng = keyed(self.seed, Purpose.ELITE_ROW, self.number * blocks + block)
            drawn = scattered_rows(dense(self.rows[members]), self.concentration, rng)
            here = states // _TOGETHER == block
            own[here] = drawn[states[here] - members[0]]
        return own


def dense(matrix: Transition) -> Floats:
    """A matrix as an array."""
    return matrix if isinstance(matrix, np.ndarray) else matrix.toarray()


@dataclass(frozen=True)
class Question:
    """What is asked about lineages without selection, whatever their root.

    Parameters
    ----------
    l : int
        Generations, at least 1.
    lineages : int
        Number U of independent lineages, at least 1: l·U descendants.
    convention : {"definition", "procedure"}
        Whether the root's own state counts, see :mod:`nichechain.evolvability`.
    method : {"auto", "exact", "monte-carlo"}
        Closed form; the paper's simulation; or, by default, closed form up to a thousand states and
        beyond, where T is estimated, lineages simulated on every draw of T at once.
    repeats : int
        Simulations over all draws, at least 1.
    draws : int
        Posterior draws of T, where it is estimated, at least 1.
    seed : int
        Of draws and simulations.

    Raises
    ------
    NichechainError
        If a number is out of range or a name unknown.
    """

    l: int = 5
    lineages: int = 100
    convention: Convention = "definition"
    method: Method = "auto"
    repeats: int = 100
    draws: int = DRAWS
    seed: int = 0

    def __post_init__(self) -> None:
        check_at_least(1, l=self.l, lineages=self.lineages, repeats=self.repeats, draws=self.draws)
        check_choice("convention", self.convention, get_args(Convention))
        check_choice("method", self.method, get_args(Method))
        check_seed(self.seed)
        check_fits(l=self.l, lineages=self.lineages, repeats=self.repeats, draws=self.draws)
        for name in ("l", "lineages", "repeats", "draws", "seed"):
            # Short numbers of NumPy would overflow in what is computed with them.
            object.__setattr__(self, name, int(getattr(self, name)))

    @property
    def root_counts(self) -> bool:
        """Whether the root's own state is one of those that are counted."""
        return self.convention == "procedure"

    @property
    def steps(self) -> int:
        """States of a lineage that count: l, and the root's own where it does."""
        return self.l + self.root_counts

    def drawn_steps(self, own: int | None) -> int:
        """States of a lineage that are drawn: those that count, but for a root's own that is known."""
        return self.steps - (own is not None)

    def by_urns(self, chain: NicheChain) -> bool:
        """Whether rows of T are only drawn where lineages enter them, since there are many."""
        small = chain.states <= MOST_EXACT or self.l > _LONGEST or self.lineages > _MOST_LINEAGES
        return self.method == "auto" and chain.posterior is not None and not small

    def warn_if_long(self, chain: NicheChain, roots: int = 1, samples: int | None = None) -> None:
        """Say so before it begins where an answer could take over ten minutes.

        Parameters
        ----------
        chain : NicheChain
        roots : int
            Roots that are asked for.
        samples : int, optional
            Draws of T, where they are not those of the question.
        """
        samples = self.number_of_samples(chain) if samples is None else samples
        if self.method == "monte-carlo":
            moves = float(roots) * max(samples, self.repeats) * self.lineages * self.steps
            cost = moves / _MOVES_A_SECOND
        elif self.by_urns(chain):
            cost = float(roots) * samples * 2 * self.lineages * self.steps / _MOVES_A_SECOND
        else:
            given = chain.posterior is None and sparse.issparse(chain.operator)
            entries = chain.operator.nnz if given else chain.states**2  # type: ignore[union-attr]
            # Longer ones are mostly over when nothing changes any more.
            products = samples * min(self.steps, _LONGEST)
            cost = 2.0 * products * entries * chain.n_niches / _SUMS_A_SECOND
        warn_if_long(cost, "fewer roots, lineages, generations or draws take less", stacklevel=4)

    def transitions(self, chain: NicheChain, *, redraw: bool = False) -> Iterator[Transition]:
        """T itself where it is given, draws from its posterior where it is estimated with one.

        Parameters
        ----------
        chain : NicheChain
        redraw : bool
            Whether a T that is given comes as often as one that is drawn, since something else is
            drawn with it.

        Yields
        ------
        (S, S) array, scipy.sparse.csr_array or PooledTransition
            Draw k comes from ``keyed(seed, Purpose.POSTERIOR, k)``.
        """
        for number in range(self.number_of_samples(chain, redraw=redraw)):
            yield self.transition(chain, number)

    def transition(self, chain: NicheChain, number: int) -> Transition:
        """Draw k of :meth:`transitions`."""
        if chain.posterior is None:
            return chain.operator
        return chain.posterior.draw(keyed(self.seed, Purpose.POSTERIOR, number))

    def samples(
        self,
        chain: NicheChain,
        *,
        redraw: bool = False,
        on_done: Callable[[int], None] | None = None,
    ) -> Iterator[DrawnChain]:
        """The same, each with what lineages do by it.

        Parameters
        ----------
        chain, redraw
            As in :meth:`transitions`.
        on_done : callable, optional
            Told 1 whenever the work on a draw is over.

        Yields
        ------
        DrawnChain
            What it adds to draw k comes from ``keyed(seed, Purpose.LINEAGE_LAW, k)``.
        """
        for number in range(self.number_of_samples(chain, redraw=redraw)):
            yield self.sample(chain, number)
            if on_done is not None:
                on_done(1)

    def sample(self, chain: NicheChain, number: int) -> DrawnChain:
        """Draw k of :meth:`samples`."""
        transition = self.transition(chain, number)
        law = None if chain.posterior is None else chain.posterior.law
        if law is None:
            return DrawnChain(transition, transition, None, self.seed, number)
        assert chain.posterior is not None
        if isinstance(transition, sparse.csr_array) and transition.nnz == chain.states**2:
            transition = transition.toarray()
        onward = law.onward(transition, keyed(self.seed, Purpose.LINEAGE_LAW, number))
        return DrawnChain(transition, onward, chain.posterior.elite_concentration, self.seed, number)

    def repeats_of_each(self, chain: NicheChain, *, redraw: bool = False) -> int:
        """Simulations on each of :meth:`transitions`, so that all have as many as asked for."""
        return math.ceil(self.repeats / self.number_of_samples(chain, redraw=redraw))

    def number_of_samples(self, chain: NicheChain, *, redraw: bool = False) -> int:
        """How many there are of :meth:`transitions`."""
        return self.draws if redraw or chain.posterior is not None else 1


def told(items: Iterable[Item], on_done: Callable[[int], None] | None) -> Iterator[Item]:
    """The items, telling 1 whenever the work on one of them is over."""
    for item in items:
        yield item
        if on_done is not None:
            on_done(1)


class Root:
    """Where lineages begin: in a niche, or with offspring of a given distribution.

    Parameters
    ----------
    chain : NicheChain
    niche : int or tuple of int, optional
        The root stands in this niche.
    offspring : (n_niches,) or (S,) array, optional
        D: generation 1 is drawn from this distribution. Give either this or ``niche``.

    Raises
    ------
    NichechainError
        If not exactly one is given, there is no such niche, or D is no distribution.
    """

    def __init__(
        self, chain: NicheChain, *, niche: Niche | None = None, offspring: ArrayLike | None = None
    ) -> None:
        if (niche is None) == (offspring is None):
            raise NichechainError("give either a niche or the distribution of the offspring, and only one")
        self.state = None if niche is None else chain.state(niche)
        known = self.state is not None and chain.births is not None
        self.births: int | None = int(chain.births[self.state]) if known else None  # type: ignore[index]
        self.distribution = np.zeros(chain.states)
        if offspring is not None:
            self.distribution = _distribution(offspring, chain)
        else:
            self.distribution[self.state] = 1.0

    def visited(self, question: Question) -> int | None:
        """The root's own state, where it is one of those that count."""
        return self.state if question.root_counts else None

    def children(self, drawn: DrawnChain) -> Floats:
        """Distribution of generation 1, (S,)."""
        if self.state is None:
            return self.distribution
        row: Floats = dense(drawn.children(np.array([self.state])))[0]
        return row


def _distribution(offspring: ArrayLike, chain: NicheChain) -> Floats:
    given = as_floats("offspring", offspring)
    if given.shape not in ((chain.n_niches,), (chain.states,)):
        raise NichechainError(
            f"offspring has shape {given.shape}, but must be ({chain.n_niches},), one share per niche"
        )
    if not np.isfinite(given).all() or (given < 0).any() or abs(given.sum() - 1.0) > 1e-8:
        raise NichechainError(
            f"offspring sums to {given.sum():.9g}, but must be shares that are not negative and sum to 1"
        )
    shares = np.zeros(chain.states)
    shares[: given.size] = given
    return shares
