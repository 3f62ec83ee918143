"""Rows of T that come to be as lineages enter them: Pólya's urns.

A row of T that is Dirichlet(C + s B) need not be drawn to draw children from it. Given k children so far, the
next is one of the C births with weight C, a copy of one of the k with weight k, or a new one from B with
weight s (Blackwell and MacQueen 1973). So all lineages of a root live on the same T, of which only those rows
come to be that they enter. Cost follows descendants, not niches, and no row is cut short.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

if TYPE_CHECKING:
    from nichechain.chain.posterior import DirichletPosterior

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_ABSENT = -1


@dataclass(frozen=True)
class UrnRows:
    """Rows of T as urns: Dirichlet(C_i + s_i B_i).

    Parameters
    ----------
    weights : (S, S) scipy.sparse.csr_array
        C.
    strength : (S,) float64 array
        s.
    """

    weights: sparse.csr_array
    strength: Floats

    @classmethod
    def of(cls, posterior: DirichletPosterior) -> UrnRows:
        """Those of a posterior for T."""
        return cls(posterior.weights, np.full(posterior.weights.shape[0], posterior.strength))

    @property
    def total(self) -> Floats:
        """What each row is worth in births, (S,)."""
        births: Floats = np.asarray(self.weights.sum(axis=1)).ravel() + self.strength
        return births

    def scattered(self, concentration: float) -> UrnRows:
        """Rows for one root, Dirichlet(τ p) around rows p of these: right in means and variances.

        Notes
        -----
        The share m of a row that is worth t births has the variance m (1 − m) / (t + 1). Drawn around what
        was drawn, it has m (1 − m) (1 / (t + 1) + t / ((t + 1) (τ + 1))).
        """
        total = self.total
        part = 1.0 / (total + 1.0) + total / ((total + 1.0) * (concentration + 1.0))
        return self._scaled((1.0 / part - 1.0) / total)

    def with_stay(self, own: Floats, log_odds: float) -> UrnRows:
        """Rows worth as much, whose odds of staying are e^b times as large.

        Parameters
        ----------
        own : (S,) float64 array
            B_ii.
        log_odds : float
            b.
        """
        stay = self.weights.diagonal()
        more = np.maximum(np.expm1(log_odds) * (stay + self.strength * own), -stay)
        total = self.total
        added = UrnRows((self.weights + sparse.diags_array(more)).tocsr(), self.strength)
        return added._scaled(total / (total + more))

    def _scaled(self, factor: Floats) -> UrnRows:
        weights = self.weights
        data = weights.data * np.repeat(factor, np.diff(weights.indptr))
        scaled = sparse.csr_array((data, weights.indices, weights.indptr), shape=weights.shape)
        return UrnRows(scaled, factor * self.strength)


class Urns:
    """Walks of lineages that draw rows as they enter them.

    Parameters
    ----------
    posterior : DirichletPosterior
        Where B comes from, and an outside that is never left.
    first, later : UrnRows
        What a root's children are drawn from, and what all others are. Where they are the same object,
        one draw is behind both.
    """

    def __init__(self, posterior: DirichletPosterior, first: UrnRows, later: UrnRows) -> None:
        self.niches = len(posterior.counts.niches)
        self._base = posterior.base
        self._apart = first is not later
        self._tables = [_table(rows) for rows in (first, later)]
        self._stays = first.strength.size - 1 if posterior.absorbing else _ABSENT

    def walks(self, first: Ints, moves: int, rng: np.random.Generator, *, roots: bool) -> Ints:
        """States of lineages of some roots (g, M), generation after generation: (g, (moves + 1) M).

        Parameters
        ----------
        first : (g, M) int64 array
            Where the lineages of each root begin.
        moves : int
        rng : numpy.random.Generator
        roots : bool
            Whether they begin in the root's own state, not in those of its children.
        """
        from nichechain.chain import urn_steps

        g, lineages = first.shape
        states = np.empty((g, (moves + 1) * lineages), np.int64)
        states[:, :lineages] = first
        for move in range(moves):
            own = roots and move == 0
            # The root's own row has no part in what is drawn later in its niche.
            since = lineages if self._apart and roots and not own else 0
            origin = np.empty((g, lineages), np.int64)
            uniform = rng.random((g, lineages))
            table = self._tables[0 if own else 1]
            urn_steps.choose(*table, self._stays, states, since, move * lineages, uniform, origin)
            new = origin == _ABSENT
            here = states[:, move * lineages : (move + 1) * lineages]
            fresh = np.empty((g, lineages), np.int64)
            fresh[new] = self._base.sample(here[new], rng)
            urn_steps.resolve(origin, fresh, states, (move + 1) * lineages)
        return states


def _table(rows: UrnRows) -> tuple[Ints, Ints, Floats, Floats]:
    weights = rows.weights
    upto = np.concatenate([[0.0], np.cumsum(weights.data)])
    return weights.indptr.astype(np.int64), weights.indices.astype(np.int64), upto, rows.strength
