"""Which estimator foretells births best: fitted to some elites' children, judged by those of others."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, softmax

from nichechain.births.families import elites_of, folds_of
from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.estimators import Unvisited, estimate
from nichechain.chain.families import counts_of_families, families_of
from nichechain.chain.model import NicheChain
from nichechain.chain.posterior import DirichletPosterior
from nichechain.core.arrays import entries_at
from nichechain.core.checks import check_at_least
from nichechain.core.duration import warn_if_long
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.core.text import rounded

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Fit = Callable[[TransitionCounts], NicheChain]

# The weight that no component of the base measure goes below.
_FLOOR = 0.005
# Births that all estimators are fitted to in a second, on grids with about a hundred births a niche.
_BIRTHS_A_SECOND = 4e4


@dataclass(frozen=True)
class HeldOut:
    """How well one estimator foretold children of elites that it had not seen.

    Parameters
    ----------
    estimator : str
    births : int
        Children foretold.
    impossible : float
        Share of them that it gave probability 0.
    log_likelihood : float
        Mean log-probability of the others, in nats per birth; NaN where there are none.
    difference : float
        Mean over the same births of its log-probability minus the default estimator's: what it
        gains where it commits itself at all.
    standard_error : float
        Of ``difference``, with children of one elite taken together.
    """

    estimator: str
    births: int
    impossible: float
    log_likelihood: float
    difference: float
    standard_error: float


@dataclass(frozen=True)
class Comparison:
    """Estimators by how well they foretell births, the default one first.

    Parameters
    ----------
    rows : tuple of HeldOut
    folds, elites, seed : int
        Elites were shared among so many folds, by this seed.
    """

    rows: tuple[HeldOut, ...]
    folds: int
    elites: int
    seed: int

    def to_frame(self) -> pd.DataFrame:
        """One row per estimator, with the fields of :class:`HeldOut`."""
        import pandas as pd

        return pd.DataFrame([asdict(row) for row in self.rows])


def compare_estimators(
    counts: TransitionCounts,
    *,
    folds: int = 5,
    seed: int = 0,
    on_done: Callable[[int], None] | None = None,
) -> Comparison:
    """Hold out the children of a share of the elites, estimate T from the rest, foretell them.

    Parameters
    ----------
    counts : TransitionCounts
        Births that do not say whose children they are count as elites of one child each, so
        that without :attr:`TransitionCounts.families` births are held out one by one.
    folds : int
        Every elite is held out once, with so many others at a time that there are this many
        turns; at least 2.
    seed : int
        Of the division into folds.
    on_done : callable, optional
        Told how many more folds are done.

    Returns
    -------
    Comparison
        The estimators of :func:`nichechain.chain.estimate`, and for comparison the strength that
        maximises the marginal likelihood of the counts where siblings pass for independent.

    Raises
    ------
    NichechainError
        If there are fewer elites than folds.

    Notes
    -----
    A log-likelihood on the births that are not impossible flatters an estimator that rules out
    many; ``difference`` compares it with the default on just these.
    """
    check_at_least(2, folds=folds)
    folds = int(folds)
    families = families_of(counts)
    elite = elites_of(families)
    elites = int(elite.max(initial=-1)) + 1
    if elites < folds:
        raise NichechainError(f"folds is {folds}, but only {elites} elites have children")
    births = int(families[:, 3].sum())
    warn_if_long(folds * births / _BIRTHS_A_SECOND, f"of {births} births, fewer folds take less")
    fold = folds_of(elite, folds, keyed(seed, Purpose.FOLDS))
    parent, child, weight = families[:, 0], families[:, 2], families[:, 3]
    fits = dict(_fits(counts))
    foretold = {name: np.zeros(len(families)) for name in fits}
    for turn in range(folds):
        out = fold == turn
        seen = counts_of_families(families[~out], counts)
        for name, fit in fits.items():
            foretold[name][out] = probability_of(fit(seen), parent[out], child[out])
        if on_done is not None:
            on_done(1)
    reference = next(iter(foretold.values()))
    rows = tuple(_judge(name, p, reference, weight, elite) for name, p in foretold.items())
    return Comparison(rows, folds, elites, seed)


def marginal_likelihood_fit(counts: TransitionCounts) -> NicheChain:
    """Rows around the pooled base measure, every birth in full: strength by marginal likelihood.

    What :func:`nichechain.chain.estimate` does without regard to whose children births are.

    Notes
    -----
    Maximises Σ_i log DirichletMultinomial(C_i | s B_i) over s and the weights of B; Minka (2000),
    "Estimating a Dirichlet distribution".
    """
    even = np.array([0.5, 0.5 - _FLOOR, _FLOOR])
    entries = counts.matrix.tocoo()
    parent, child = (axis.astype(np.int64) for axis in entries.coords)
    components = BaseMeasure.pooled(counts, even).components(parent, child)
    births = counts.births[counts.births > 0]

    from scipy.optimize import minimize

    def unpack(x: Floats) -> tuple[float, Floats]:
        weights = _FLOOR + (1.0 - 3.0 * _FLOOR) * softmax(np.append(x[1:], 0.0))
        return float(np.exp(np.clip(x[0], -7.0, 12.0))), weights

    def loss(x: Floats) -> float:
        s, weights = unpack(x)
        prior = np.maximum(s * (weights @ components), 1e-12)
        rows = (gammaln(s) - gammaln(births + s)).sum()
        return -float(rows + (gammaln(entries.data + prior) - gammaln(prior)).sum())

    best = minimize(loss, np.array([2.0, 2.0, 2.0]), method="Nelder-Mead", options={"maxiter": 400})
    strength, weights = unpack(best.x)
    posterior = DirichletPosterior(
        counts, BaseMeasure.pooled(counts, weights), strength, np.ones(counts.niches.states)
    )
    outside = None if counts.niches.outside == "clip" else len(counts.niches)
    return NicheChain(
        posterior=posterior,
        niches=counts.niches,
        outside=outside,
        counts=counts,
        estimator=f"marginal likelihood of all births, strength {rounded(strength)}",
    )


def _fits(counts: TransitionCounts) -> Iterator[tuple[str, Fit]]:
    """The default estimator, then the others."""
    yield "empirical-bayes", estimate
    yield "the same, births unrelated", marginal_likelihood_fit
    for prior in ("1/n", "jeffreys"):
        yield f"dirichlet, {prior}", partial(estimate, estimator="dirichlet", strength=prior)
    for policy in get_args(Unvisited):
        if policy != "absorb" or counts.niches.outside != "clip":
            yield f"mle, unvisited: {policy}", partial(estimate, estimator="mle", unvisited=policy)


def probability_of(chain: NicheChain, parent: Ints, child: Ints) -> Floats:
    """T_ij of some pairs, without making a T that may be dense."""
    posterior = chain.posterior
    if posterior is None:
        given: Floats = entries_at(chain.T, parent, child)
        return given
    births = (posterior.counts.births / posterior.design_effect)[parent]
    own = entries_at(posterior.weights, parent, child)
    prior = posterior.strength * posterior.base.probability(parent, child)
    foretold: Floats = (own + prior) / (births + posterior.strength)
    return foretold


def _judge(name: str, foretold: Floats, reference: Floats, weight: Ints, elite: Ints) -> HeldOut:
    births = int(weight.sum())
    some = foretold > 0
    size = int(weight[some].sum())
    if not size:
        return HeldOut(name, births, 1.0, math.nan, math.nan, math.nan)
    log = weight[some] * np.log(foretold[some])
    gain = log - weight[some] * np.log(reference[some])
    difference = gain.sum() / size
    # Residuals of the ratio, summed over an elite: its children are not independent.
    left = np.bincount(elite[some], gain - difference * weight[some])
    owners = np.unique(elite[some]).size
    error = math.sqrt(float((left**2).sum()) * owners / max(1, owners - 1)) / size
    return HeldOut(name, births, 1.0 - size / births, float(log.sum() / size), float(difference), error)
