"""Estimators of T: counts in, an immutable chain out."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import minimize
from scipy.special import gammaln, softmax

from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.model import NicheChain
from nichechain.chain.posterior import DirichletPosterior
from nichechain.errors import NichechainError

Floats = NDArray[np.float64]

Estimator = Literal["dirichlet", "mle"]
Unvisited = Literal["self", "uniform", "base", "absorb"]
ESTIMATORS: tuple[str, ...] = get_args(Estimator)
UNVISITED: tuple[str, ...] = get_args(Unvisited)

# The uniform component never goes below this, so that nothing is impossible.
_FLOOR = 0.01


def estimate(
    counts: TransitionCounts,
    estimator: Estimator = "dirichlet",
    *,
    unvisited: Unvisited | None = None,
    strength: float | None = None,
) -> NicheChain:
    """Estimate the chain behind births.

    Parameters
    ----------
    counts : TransitionCounts
    estimator : {"dirichlet", "mle"}
        ``dirichlet``: a posterior for every row around a base measure pooled over all rows.
        ``mle``: row-normalised counts, the paper's literal T.
    unvisited : {"self", "uniform", "base", "absorb"}, optional
        For ``mle`` only, what a row without births does: stay (default), go anywhere, go where
        children land in general, or leave for good to the outside state.
    strength : float, optional
        For ``dirichlet`` only, how many births the base measure is worth. By default it and the
        mixture are those that make the births most likely.

    Returns
    -------
    NicheChain

    Raises
    ------
    NichechainError
        If an argument is unknown or belongs to the other estimator.
    """
    if estimator == "mle":
        if strength is not None:
            raise NichechainError("strength belongs to the estimator dirichlet, not to mle")
        return _mle(counts, unvisited or "self")
    if estimator == "dirichlet":
        if unvisited is not None:
            raise NichechainError(
                "unvisited belongs to the estimator mle: dirichlet has a posterior for every row"
            )
        return _dirichlet(counts, strength)
    raise NichechainError(f"estimator is {estimator!r}, but must be one of {', '.join(ESTIMATORS)}")


def _mle(counts: TransitionCounts, unvisited: str) -> NicheChain:
    if unvisited not in UNVISITED:
        raise NichechainError(f"unvisited is {unvisited!r}, but must be one of {', '.join(UNVISITED)}")
    states = counts.niches.states
    has_outside = states > len(counts.niches)
    if unvisited == "absorb" and not has_outside:
        raise NichechainError("unvisited is 'absorb', but these niches have no outside state to go to")
    births = counts.births.astype(np.float64)
    empty = np.flatnonzero(births == 0)
    if counts.niches.outside == "absorb":
        empty = empty[empty < states - 1]
    per_row: Floats = np.divide(1.0, births, out=np.zeros(states), where=births > 0)
    observed = sparse.diags_array(per_row) @ counts.matrix
    filler = sparse.lil_array((states, states))
    match unvisited:
        case "self":
            filler[empty, empty] = 1.0
        case "absorb":
            filler[empty, states - 1] = 1.0
        case "uniform":
            filler[empty] = 1.0 / states
        case "base":
            landed = np.bincount(counts.matrix.indices, counts.matrix.data, states)
            if not landed.sum():
                raise NichechainError("unvisited is 'base', but no birth says where children land")
            filler[empty] = landed / landed.sum()
    if counts.niches.outside == "absorb":
        filler[states - 1, states - 1] = 1.0
    return NicheChain(
        (observed + filler.tocsr()).tocsr(),
        niches=counts.niches,
        outside=states - 1 if has_outside else None,
        counts=counts,
        estimator=f"mle, unvisited rows: {unvisited}",
    )


def _dirichlet(counts: TransitionCounts, strength: float | None) -> NicheChain:
    if strength is not None and not (np.isfinite(strength) and strength > 0):
        raise NichechainError(f"strength is {strength}, but must be a positive number")
    fitted, weights = _most_likely(counts, strength)
    posterior = DirichletPosterior(counts, BaseMeasure.pooled(counts, weights), fitted)
    return NicheChain(
        posterior=posterior,
        niches=counts.niches,
        outside=counts.niches.states - 1 if counts.niches.states > len(counts.niches) else None,
        counts=counts,
        estimator=f"dirichlet, strength {fitted:.3g}",
    )


def _most_likely(counts: TransitionCounts, strength: float | None) -> tuple[float, Floats]:
    """Strength and mixture that maximise the Dirichlet-multinomial likelihood of the counts.

    Notes
    -----
    log L = Σ_i log Γ(s)/Γ(N_i + s) + Σ_ij log Γ(C_ij + s B_ij)/Γ(s B_ij), over rows with births;
    Minka (2000), "Estimating a Dirichlet distribution". A row's own births are taken out of the
    pool before the pool predicts them, else the pool would look better than it is.
    """
    births = counts.births
    matrix = counts.matrix.tocoo()
    parent, child = (axis.astype(np.int64) for axis in matrix.coords)
    count = matrix.data.astype(np.float64)
    sizes = births[births > 0].astype(np.float64)
    even = np.array([0.5, 0.5 - _FLOOR, _FLOOR])
    if not count.size:
        return strength or 1.0, even
    components = _without_own(counts, even, parent, child, count)

    def unpack(x: Floats) -> tuple[float, Floats]:
        weights = _FLOOR / 2 + (1.0 - 1.5 * _FLOOR) * softmax(np.append(x[1:], 0.0))
        s = strength if strength is not None else float(np.exp(np.clip(x[0], -7.0, 12.0)))
        return s, weights / weights.sum()

    def loss(x: Floats) -> float:
        s, weights = unpack(x)
        mass = s * (weights @ components)
        rows = gammaln(s) - gammaln(sizes + s)
        return -float(rows.sum() + (gammaln(count + mass) - gammaln(mass)).sum())

    best = minimize(loss, np.array([1.0, 2.0, 2.0]), method="Nelder-Mead", options={"maxiter": 400})
    return unpack(best.x)


def _without_own(
    counts: TransitionCounts,
    weights: Floats,
    parent: NDArray[np.int64],
    child: NDArray[np.int64],
    count: Floats,
) -> Floats:
    """Components of the base at each pair, with the pair's own births taken out of the pool."""
    base = BaseMeasure.pooled(counts, weights)
    components = base.components(parent, child)
    total = count.sum()
    own = np.bincount(parent, count, counts.niches.states)[parent]
    # From share p of total + 1 to what is left of it without the row's own births.
    rest = np.maximum(total + 1.0 - own, 1.0)
    for k in (0, 1):
        components[k] = np.maximum(components[k] * (total + 1.0) - count, 0.0) / rest
    # Where only the row itself ever did such a thing, the uniform share is all there is.
    return np.maximum(components, 1e-12)
