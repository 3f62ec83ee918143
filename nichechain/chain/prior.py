"""The prior of rows of T, fitted to births: a base measure, a strength, and what is not known of them.

Every birth is taken to come from one of several kinds: from where children land anywhere, from how
far they land anywhere, and on a grid from where, and how far, neighbours' children land. Which birth
is of which kind is shared out among them. How much each kind counts, and the base beside a row's own
births, is judged by how well they foretell the children of elites that they have not seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.attribution import attributed
from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.foretelling import leave_out, weighed
from nichechain.chain.kinds import Kinds
from nichechain.chain.siblings import design_effect

Floats = NDArray[np.float64]

_TINY = 1e-9


@dataclass(frozen=True)
class FittedPrior:
    """Rows of T are Dirichlet(s B_i): the fitted B and s, and draws of what they might be as well.

    Parameters
    ----------
    base : BaseMeasure
        B.
    strength : float
        s.
    log_strength_error : float
        Standard error of log s.
    design_effect : (S,) float64 array
        Births of each row that are worth one independent birth.
    kinds : Kinds
        Guesses of where a child lands.
    pools : (p, E) float64 array
        Independent births of each pair of states that each pool of them has.
    weights : (k,) float64 array
        Of the kinds.
    """

    base: BaseMeasure
    strength: float
    log_strength_error: float
    design_effect: Floats
    kinds: Kinds
    pools: Floats
    weights: Floats

    def draw(self, rng: np.random.Generator) -> tuple[BaseMeasure, float]:
        """A base measure and a strength that the births allow as well.

        Notes
        -----
        The Bayesian bootstrap (Rubin 1981) of the births that each pool is made of, and a log-normal
        strength.
        """
        drawn = rng.standard_gamma(np.maximum(self.pools, _TINY))
        # A kind without births stays as likely as it is.
        scale = (drawn.sum(axis=1) + _TINY) / (self.pools.sum(axis=1) + _TINY)
        weights = self.weights * np.append(scale, 1.0)[self.kinds.pool]
        strength = self.strength * float(np.exp(self.log_strength_error * rng.standard_normal()))
        return self.kinds.base(drawn, weights / weights.sum()), strength


def fit_prior(
    counts: TransitionCounts, strength: float | None = None, weights: Floats | None = None
) -> FittedPrior:
    """The base measure and the strength that births make likely.

    Parameters
    ----------
    counts : TransitionCounts
    strength : float, optional
        s, where it is not to be fitted.
    weights : (k,) float64 array, optional
        Of the kinds, where they are not to be fitted; s is given then, too.

    Notes
    -----
    Weights and strength are those of :func:`nichechain.chain.foretelling.weighed`; births are shared out
    among the kinds by :func:`nichechain.chain.attribution.attributed`.
    """
    effect = design_effect(counts)
    entries = counts.matrix.tocoo()
    order = np.lexsort(entries.coords[::-1])
    parent, child = (axis[order].astype(np.int64) for axis in entries.coords)
    births = entries.data[order] / effect[parent]
    kinds = Kinds(counts.niches, parent, child)
    error = 0.0
    if strength is None or weights is None:
        weights, strength, error = weighed(leave_out(counts, kinds, parent, child), strength)
    pools = attributed(kinds, births, counts.births / effect, weights)
    return FittedPrior(kinds.base(pools, weights), strength, error, effect, kinds, pools, weights)
