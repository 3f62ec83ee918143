"""What births leave unknown of T: a Dirichlet distribution for each row."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.elites import elite_concentration
from nichechain.chain.lineages import LineageLaw
from nichechain.chain.operator import PooledTransition
from nichechain.chain.prior import FittedPrior

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# States below which adding up in a dense matrix beats sorting.
_DENSE_STATES = 1_500

# A draw of the prior's part of a row leaves at most this much of it, in expectation, in one place.
_REMAINDER = 1e-4
_FEW_STATES = 16

# Beyond so many states, rows are drawn in at most so many pieces in all, 100 MB of them.
_MANY_STATES = 4_000
_MOST_PIECES = 2_000_000


@dataclass(frozen=True)
class DirichletPosterior:
    """Row i of T is Dirichlet(C_i / e_i + s B_i), rows independent.

    Parameters
    ----------
    counts : TransitionCounts
        C.
    base : BaseMeasure
        B.
    strength : float
        s, the number of births that the base measure is worth.
    design_effect : (S,) float64 array
        e, the number of births of each row that are worth one independent birth.
    prior : FittedPrior, optional
        Where B and s come from: then every draw has a base measure and a strength of its own.
    law : LineageLaw, optional
        How rows for lineages follow from T, where births of lineages tell.
    """

    counts: TransitionCounts
    base: BaseMeasure
    strength: float
    design_effect: Floats
    prior: FittedPrior | None = None
    law: LineageLaw | None = None

    @classmethod
    def of(cls, counts: TransitionCounts, prior: FittedPrior) -> DirichletPosterior:
        """That of births under a prior that was fitted to them."""
        return cls(counts, prior.base, prior.strength, prior.design_effect, prior)

    @cached_property
    def weights(self) -> sparse.csr_array:
        """C_ij / e_i: births of each row as independent ones, (S, S)."""
        return (sparse.diags_array(1.0 / self.design_effect) @ self.counts.matrix).tocsr()

    @cached_property
    def elite_concentration(self) -> float:
        """How many children of an elite its niche's row is worth to what is known of that elite.

        See :func:`nichechain.chain.elites.elite_concentration`; s where births cannot say.
        """
        fitted = elite_concentration(self.counts, self.base.probability, self.strength, self.design_effect)
        return self.strength if fitted is None else fitted

    @property
    def absorbing(self) -> bool:
        """Whether the outside state is never left, by decree."""
        return self.counts.niches.outside == "absorb"

    def mean(self) -> Floats:
        """Posterior mean of T, (S, S): dense, 8 S² bytes."""
        births = self.counts.births / self.design_effect
        rows = self.strength * self.base.rows(np.arange(births.size))
        rows += self.weights.toarray()
        rows /= (births + self.strength)[:, None]
        if self.absorbing:
            rows[-1] = 0.0
            rows[-1, -1] = 1.0
        return rows

    def mean_operator(self) -> PooledTransition:
        """Posterior mean of T in parts: no S² numbers."""
        total = self.counts.births / self.design_effect + self.strength
        kept, prior = (sparse.diags_array(1.0 / total) @ self.weights).tocoo(), self.strength / total
        entries = self._absorbed(kept.data, kept.coords)
        if self.absorbing:
            prior[-1] = 0.0
        return PooledTransition.of(_collected(*entries, total.size), prior, self.base)

    def draw(self, rng: np.random.Generator) -> sparse.csr_array | PooledTransition:
        """One T from the posterior, (S, S): sparse, or a sum of parts.

        Notes
        -----
        With C for C/e: Dirichlet(C + s B) is w·Dirichlet(C) + (1 − w)·Dirichlet(s B) with w ~
        Beta(|C|, s). The
        first part lives on the few states that were observed. The second is drawn by breaking a
        stick (Sethuraman 1994): its k-th piece, Beta(1, s) of what is left, goes to a state drawn
        from B. Pieces shrink fast, so a row of n states needs only about 9 s of them, not n.

        Beyond 4,000 states and two million pieces, the second part is drawn as m atoms from B,
        with weights and a share left to B itself that give it the mean and the covariances of
        Dirichlet(s B), though not the higher moments, and T is a :class:`PooledTransition`.
        """
        if self.prior is not None:
            return self.settled(rng).draw(rng)
        matrix = self.weights.tocoo()
        rows, columns = matrix.coords
        births = self.counts.births / self.design_effect
        states = births.size
        known = np.zeros(states)
        seen = births > 0
        known[seen] = rng.beta(births[seen], self.strength)
        share = rng.standard_gamma(matrix.data)
        share *= (known / np.maximum(np.bincount(rows, share, states), np.finfo(float).tiny))[rows]
        pieces = self._pieces(states)
        if states > _MANY_STATES and states * pieces > _MOST_PIECES:
            return self._draw_atoms(known, (rows, columns, share), rng)
        # In a row of few states, gamma variates of tiny shape would all underflow.
        if pieces >= max(states, _FEW_STATES):
            return _full(self._draw_whole_rows(known, (rows, columns, share), rng))
        # Each piece leaves U^(1/s) of what it was broken from: minus its logarithm is exponential.
        left = np.ones((states, pieces + 1))
        np.cumsum(rng.standard_exponential((states, pieces - 1)), axis=1, out=left[:, 1:-1])
        np.exp(left[:, 1:-1] / -self.strength, out=left[:, 1:-1])
        left[:, -1] = 0.0
        prior = (left[:, :-1] - left[:, 1:]) * (1.0 - known)[:, None]
        parents = np.repeat(np.arange(states), pieces)
        landed = self.base.sample(parents, rng)
        data = np.concatenate([share, prior.ravel()])
        index = np.concatenate([rows, parents]), np.concatenate([columns, landed])
        return _collected(*self._absorbed(data, index), states)

    def settled(self, rng: np.random.Generator) -> DirichletPosterior:
        """The same under one draw of base and strength, where these are not known either."""
        if self.prior is None:
            return self
        base, strength = self.prior.draw(rng)
        return replace(self, base=base, strength=strength, prior=None)

    def _draw_atoms(
        self, known: Floats, observed: tuple[Ints, Ints, Floats], rng: np.random.Generator
    ) -> PooledTransition:
        """The same where a stick would need too many pieces, right in mean and covariances."""
        rows, columns, share = observed
        states = known.size
        atoms = max(1, _MOST_PIECES // states)
        # With weights g over atoms from B, a share w of a row has covariances w² Σ E[g²] times those
        # of one draw from B; a Dirichlet(s B) has 1 / (s + 1) times them.
        if atoms > self.strength + 1.0:
            # Σ E[g²] = (a + 1) / (m a + 1) for a symmetric Dirichlet of parameter a.
            weight = rng.standard_gamma(self.strength / (atoms - self.strength - 1.0), (states, atoms))
            weight /= weight.sum(axis=1, keepdims=True)
            drawn = 1.0
        else:
            weight = np.full((states, atoms), 1.0 / atoms)
            drawn = math.sqrt(atoms / (self.strength + 1.0))
        weight *= drawn * (1.0 - known)[:, None]
        parents = np.repeat(np.arange(states), atoms)
        landed = self.base.sample(parents, rng)
        data = np.concatenate([share, weight.ravel()])
        index = np.concatenate([rows, parents]), np.concatenate([columns, landed])
        prior = (1.0 - drawn) * (1.0 - known)
        if self.absorbing:
            prior[-1] = 0.0
        return PooledTransition.of(_collected(*self._absorbed(data, index), states), prior, self.base)

    def _absorbed(self, data: Floats, index: tuple[Ints, Ints]) -> tuple[Floats, tuple[Ints, Ints]]:
        """Entries, with an outside that absorbs staying where it is."""
        if not self.absorbing:
            return data, index
        last = self.counts.niches.states - 1
        stays = index[0] < last
        return np.append(data[stays], 1.0), (
            np.append(index[0][stays], last),
            np.append(index[1][stays], last),
        )

    def _draw_whole_rows(
        self, known: Floats, observed: tuple[Floats, Floats, Floats], rng: np.random.Generator
    ) -> Floats:
        """The same where a stick would need more pieces than there are states."""
        rows, columns, share = observed
        gamma = rng.standard_gamma(self.strength * self.base.rows(np.arange(known.size)))
        drawn: Floats = gamma * ((1.0 - known) / gamma.sum(axis=1))[:, None]
        drawn[rows, columns] += share
        if self.absorbing:
            drawn[-1] = 0.0
            drawn[-1, -1] = 1.0
        return drawn

    def _pieces(self, states: int) -> int:
        """Pieces of the stick after which the rest is expected to be below ``_REMAINDER``."""
        if self.strength > states:
            return max(states, _FEW_STATES)
        return 1 + math.ceil(math.log(_REMAINDER) / math.log(self.strength / (1.0 + self.strength)))


def _full(dense: Floats) -> sparse.csr_array:
    """A matrix without zeros worth looking for, as a sparse one."""
    rows, columns = dense.shape
    starts = np.arange(rows + 1) * columns
    return sparse.csr_array((dense.ravel(), np.tile(np.arange(columns), rows), starts), shape=dense.shape)


def _collected(data: Floats, index: tuple[Ints, Ints], states: int) -> sparse.csr_array:
    """Entries (row, column) added up, (S, S)."""
    if states > _DENSE_STATES:
        return sparse.coo_array((data, index), shape=(states, states)).tocsr()
    dense = np.bincount(index[0] * states + index[1], data, states * states)
    return sparse.csr_array(dense.reshape(states, states))
