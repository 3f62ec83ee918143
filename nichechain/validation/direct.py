"""The direct check: what descendants really reach beside what the chain predicts.

From some elites, lineages without selection are run with real evaluations, and the number of
niches they reach is compared with what the chain says of a lineage that begins in the elite's
niche, and of one that begins with the elite's own offspring. ``definition`` is the convention:
generation 1 is drawn from the niche's row of T, the root does not count, nor does the outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from nichechain.births.table import NONE
from nichechain.chain.model import NicheChain
from nichechain.core.intervals import drawn_interval
from nichechain.core.randomness import Purpose, keyed
from nichechain.core.row_sampler import RowSampler
from nichechain.evolvability.averaging import spread_of
from nichechain.evolvability.coverage import coverage_by_generation, rarefied_coverage
from nichechain.evolvability.question import MOST_EXACT, Question, dense
from nichechain.evolvability.record import draw_children, own_strength
from nichechain.execution.side_by_side import side_by_side
from nichechain.niches import Niches
from nichechain.validation.rollouts import Lineages, OnDone, niches_reached
from nichechain.validation.simulate import simulate_lineages

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DRAWS = 50
# Simulations of the whole check on each draw of T.
_REPLICAS = 8


@dataclass(frozen=True)
class Prediction:
    """Niches that lineages reach, as the chain has it.

    Parameters
    ----------
    start : str
        ``niche`` or ``genotype``: whose offspring are generation 1.
    value : (R, l) float64 array
        Expected number up to each generation, the mean over draws of T.
    simulated : (R, l, K) float64 array
        Numbers of simulated checks: what births leave unknown of T, and chance, are both in
        their spread.
    """

    start: str
    value: Floats
    simulated: Floats

    @property
    def interval(self) -> tuple[Floats, Floats]:
        """90 % interval of the number that this many lineages reach, (R, l) each."""
        return drawn_interval(self.simulated, axis=2)


@dataclass(frozen=True)
class DirectCheck:
    """What lineages reached beside what was predicted.

    Parameters
    ----------
    lineages : Lineages
    reached : (R, l) int64 array
        Niches really reached.
    births : (R,) int64 array
        Births behind each root's row of T.
    predictions : tuple of Prediction
        From niche and from genotype starts.
    estimator : str
    """

    lineages: Lineages
    reached: Ints
    births: Ints
    predictions: tuple[Prediction, ...]
    estimator: str

    def summary(self) -> pd.DataFrame:
        """One row per start and generation.

        Returns
        -------
        DataFrame
            ``start``, ``generation``; ``reached`` and ``predicted``, means over the elites;
            ``spearman`` of the two, and ``spearman_expected`` with ``_low`` and ``_high``, which
            it would be if the chain were right, so few lineages being run; ``bias``, predicted
            minus reached, with a 95 % t-interval over elites; ``slope`` of reached on predicted,
            above 1 where elites differ more than the chain says; ``covered``, the share of elites
            whose number lies in the chain's 90 % interval.
        """
        import pandas as pd

        rows = []
        for prediction in self.predictions:
            low, high = prediction.interval
            for k in range(self.reached.shape[1]):
                real, value = self.reached[:, k], prediction.value[:, k]
                ideal = _spearmans(prediction.simulated[:, k], value)
                spearman_low, spearman_high = drawn_interval(ideal)
                bias = value - real
                width = stdtrit(bias.size - 1, 0.975) * bias.std(ddof=1) / np.sqrt(bias.size)
                rows.append(
                    {
                        "start": prediction.start,
                        "generation": k + 1,
                        "reached": real.mean(),
                        "predicted": value.mean(),
                        "spearman": float(_spearmans(real[:, None].astype(np.float64), value)[0]),
                        "spearman_expected": np.median(ideal),
                        "spearman_low": spearman_low,
                        "spearman_high": spearman_high,
                        "bias": bias.mean(),
                        "bias_low": bias.mean() - width,
                        "bias_high": bias.mean() + width,
                        "slope": _slope(real, value),
                        "covered": np.mean((real >= low[:, k]) & (real <= high[:, k])),
                    }
                )
        return pd.DataFrame(rows)

    def to_frame(self) -> pd.DataFrame:
        """One row per start, elite and generation: niches reached, predicted, 90 % interval."""
        import pandas as pd

        roots, generations = self.reached.shape
        parts = []
        for prediction in self.predictions:
            low, high = prediction.interval
            parts.append(
                pd.DataFrame(
                    {
                        "start": prediction.start,
                        "root": np.repeat(self.lineages.roots, generations),
                        "births": np.repeat(self.births, generations),
                        "generation": np.tile(np.arange(1, generations + 1), roots),
                        "reached": self.reached.ravel(),
                        "predicted": prediction.value.ravel(),
                        "low": low.ravel(),
                        "high": high.ravel(),
                    }
                )
            )
        return pd.concat(parts, ignore_index=True)


def compare(
    chain: NicheChain,
    lineages: Lineages,
    niches: Niches,
    *,
    draws: int = DRAWS,
    seed: int = 0,
    on_done: OnDone | None = None,
) -> DirectCheck:
    """Predict what the lineages reached, without looking at them.

    Values are those of :func:`nichechain.l_evolvability` and
    :func:`nichechain.genotype_evolvability` for each root and each number of generations, of its fresh
    offspring alone.

    Parameters
    ----------
    chain : NicheChain
    lineages : Lineages
    niches : Niches
    draws : int
        Draws of T, where the chain has a posterior.
    seed : int
    on_done : callable, optional
        Told how many more draws are done.

    Returns
    -------
    DirectCheck

    Raises
    ------
    NichechainError
        If ``draws`` is below 1.
    """
    question = Question(draws=draws, seed=seed)
    roots, size, generations = lineages.states.shape
    n = chain.n_niches
    counts = np.stack([np.bincount(row[row != NONE], minlength=chain.states) for row in lineages.offspring])
    strength = own_strength(chain)

    def predicted(number: int) -> tuple[Floats, Ints]:
        drawn = question.sample(chain, number)
        matrix, rows = drawn.onward, dense(drawn.children(lineages.roots))
        rng = keyed(seed, Purpose.FIRST_GENERATION, number)
        first = np.concatenate([rows, draw_children(counts, rows, rng, strength)])
        rng = keyed(seed, Purpose.PREDICTION, number)
        begin = RowSampler(first).draw(np.tile(np.repeat(np.arange(2 * roots), size), _REPLICAS), rng)
        walks = simulate_lineages(matrix, begin.reshape(-1, size), generations, rng)
        reached = niches_reached(walks, n).reshape(_REPLICAS, 2 * roots, generations)
        if chain.states > MOST_EXACT:
            # The error of so many replicas is small beside that of the lineages really run.
            return reached.mean(axis=0), reached
        none = np.zeros(len(first), np.int64)
        found = coverage_by_generation(matrix, none, generations, [size], n, first=first)
        return found[:, :, 0], reached

    # A T that is given is walked by as often as one that is drawn.
    values, simulated = zip(*side_by_side(predicted, range(question.draws), on_done), strict=True)
    value = np.mean(values, axis=0)
    spread = np.moveaxis(np.concatenate(simulated), 0, 2).astype(np.float64)
    middle = spread.mean(axis=2, keepdims=True)
    spread = np.clip(middle + spread_of(chain) * (spread - middle), 0.0, n)
    genotype = value[roots:]
    if size <= counts.sum(axis=1).min():
        # No distribution has to be guessed: these are children, and there are enough of them.
        genotype[:, 0] = [rarefied_coverage(row, size, counted=n) for row in counts]
    births = np.zeros(chain.states, np.int64) if chain.births is None else chain.births
    return DirectCheck(
        lineages,
        lineages.reached(len(niches)),
        births[lineages.roots],
        (
            Prediction("niche", value[:roots], spread[:roots]),
            Prediction("genotype", genotype, spread[roots:]),
        ),
        chain.estimator,
    )


def _spearmans(real: Floats, value: Floats) -> Floats:
    """Rank correlation of each column of (R, K) with (R,); NaN where either is constant."""
    from scipy.stats import rankdata

    x = rankdata(value)
    y = rankdata(real, axis=0)
    x = x - x.mean()
    y = y - y.mean(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation: Floats = (x @ y) / np.sqrt((x @ x) * (y * y).sum(axis=0))
    return correlation


def _slope(real: Ints, value: Floats) -> float:
    """Least-squares slope of what was reached on what was predicted, NaN where that is constant."""
    off = value - value.mean()
    with np.errstate(invalid="ignore", divide="ignore"):
        return float(np.float64(off @ real) / (off @ off))
