"""How much elites of one niche differ in where their children land."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from nichechain.births.families import elites_of
from nichechain.chain.counts import TransitionCounts
from nichechain.core.arrays import entries_at

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LOG_CONCENTRATIONS = (-2.3, 11.5)
_TINY = 1e-12


def elite_concentration(
    counts: TransitionCounts, base: Callable[[Ints, Ints], Floats], strength: float, design_effect: Floats
) -> float | None:
    """How many children of an elite its niche's row is worth, when its next child is foretold.

    Parameters
    ----------
    counts : TransitionCounts
    base : callable
        B_ij of pairs (N,) of parent and child.
    strength : float
        s: rows are Dirichlet(C_i / e_i + s B_i).
    design_effect : (S,) float64 array
        e.

    Returns
    -------
    float or None
        τ: children of an elite of niche i are draws from a distribution of its own, Dirichlet(τ T_i).
        Large where elites of a niche are alike. None where births cannot say: no elite that has
        siblings among its children shares its niche with another.

    Notes
    -----
    Maximises Σ_e Σ_j c_ej log ((c_ej − 1 + t_e q_ej) / (m_e − 1 + t_e)): each child is foretold from
    its siblings and from q, the posterior mean of its niche's row without this family. That row is
    itself known only as well as (N_i − m_e) / e_i + s births tell, so that 1 / t_e = 1 / τ + 1 over that
    number: else what is not known of the row would pass for a difference between elites.
    """
    families = counts.families
    elite = elites_of(families)
    parent, child, own = families[:, 0], families[:, 2], families[:, 3].astype(np.float64)
    size = np.bincount(elite, own)[elite]
    kept = (size > 1) & (counts.births[parent] > size)
    if not kept.any():
        return None
    parent, child, own, size = parent[kept], child[kept], own[kept], size[kept]
    effect = design_effect[parent]
    told = (counts.births[parent] - size) / effect + strength
    others = (entries_at(counts.matrix, parent, child) - own) / effect
    expected = np.maximum((others + strength * base(parent, child)) / told, _TINY)

    def surprise(log_concentration: float) -> float:
        t = 1.0 / (np.exp(-log_concentration) + 1.0 / told)
        return -float((own * np.log((own - 1.0 + t * expected) / (size - 1.0 + t))).sum())

    best = minimize_scalar(surprise, bounds=_LOG_CONCENTRATIONS, method="bounded").x
    return float(np.exp(best))
