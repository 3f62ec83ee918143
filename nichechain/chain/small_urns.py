"""Pólya's urns of few states, for many roots at once.

The same as :mod:`nichechain.chain.urns`, by operations on whole arrays: nothing is compiled, so that whoever
asks a small chain need not wait for the compiler to be loaded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.urns import UrnRows

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_STATES = 1_000
"""States whose rows are kept whole, 8 MB of them."""
MOST_VISITS = 250
"""Visits of the lineages of a root up to which all of them are gone through for each."""


@dataclass(frozen=True)
class WholeRows:
    """Rows of T as urns, Dirichlet(t_i p_i), whole.

    Parameters
    ----------
    upto : (S * S,) float64 array
        i + p_i0 + ... + p_ij: one sorted array for all rows.
    total : (K, S) float64 array
        t, what each row is worth in births, for K kinds of roots.
    """

    upto: Floats
    total: Floats

    @classmethod
    def of(cls, rows: UrnRows, base: Floats, *, absorbing: bool) -> WholeRows:
        """Those of rows around a base measure (S, S)."""
        share = rows.weights.toarray() + rows.strength[:, None] * base
        if absorbing:
            share[-1] = 0.0
            share[-1, -1] = 1.0
        np.cumsum(share, axis=1, out=share)
        share /= share[:, -1:].copy()
        share += np.arange(len(share))[:, None]
        return cls(share.ravel(), rows.total[None, :])

    def worth(self, kinds: list[UrnRows]) -> WholeRows:
        """The same shares, as sure as those of each of other rows, for as many kinds of roots."""
        return replace(self, total=np.stack([rows.total for rows in kinds]))

    def children(self, states: Ints, uniform: Floats) -> Ints:
        """A child of each of some states (N,), for numbers below 1."""
        size = self.total.shape[1]
        place = np.searchsorted(self.upto, states + uniform, "right") - states * size
        found: Ints = np.minimum(place, size - 1)
        return found


@dataclass(frozen=True)
class SmallUrns:
    """Walks of lineages that draw rows as they enter them.

    Parameters
    ----------
    first, later : WholeRows
        What a root's children are drawn from, and what all others are, by draws of their own.
    """

    first: WholeRows
    later: WholeRows

    def walks(self, first: Ints, moves: int, rng: np.random.Generator) -> Ints:
        """States of lineages that begin in roots' states (g, M), generation after generation.

        Parameters
        ----------
        first : (g, M) int64 array
            Of g / K roots of the first kind, then as many of each other.
        moves : int
        rng : numpy.random.Generator

        Returns
        -------
        (g, (moves + 1) M) int64 array
        """
        g, lineages = first.shape
        states = np.empty(((moves + 1) * lineages, g), np.int16)
        states[:lineages] = first.T
        roots = np.arange(g)
        kinds = len(self.later.total)
        kind = roots * kinds // g
        for visit in range(moves * lineages):
            rows, since = (self.first, 0) if visit < lineages else (self.later, lineages)
            here = states[visit].astype(np.int64)
            known = rows.total[kind if len(rows.total) > 1 else 0, here]
            place = rng.random(g) * (known + visit - since)
            fresh = place < known
            source = np.where(fresh, 0, since + (place - known).astype(np.int64))
            # Whoever would copy a visit to another state draws again, among those to its own.
            again = np.flatnonzero(~fresh & (states[source, roots] != here))
            if again.size:
                alike = states[since:visit, again] == here[again]
                upto = np.cumsum(alike, axis=0, dtype=np.int16)
                place = rng.random(again.size) * (known[again] + upto[-1]) - known[again]
                fresh[again] = place < 0.0
                source[again] = since + (upto <= place.astype(np.int64)).sum(axis=0)
            child = states[visit + lineages]
            child[~fresh] = states[source[~fresh] + lineages, np.flatnonzero(~fresh)]
            new = np.flatnonzero(fresh)
            child[new] = rows.children(here[new], rng.random(new.size))
        return states.T.astype(np.int64)
