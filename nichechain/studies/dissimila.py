"""Do points of a low dissimila ratio hold walks back? The paper suspects it ('Local "optima"').

A point with a small r* lies far from offspring that resemble each other, so novelty may select it
although little can come of it. If so, a walk that stands on one should have less evolvability a
few steps later, above all when compared with points that are as evolvable now.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError
from nichechain.landscape import dissimila_ratio, find_dissimila
from nichechain.studies.results import HypothesisTest
from nichechain.studies.statistics import RESAMPLES, adjust, signed_rank_test

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]

HORIZON = 5
"""Steps after which a walk is looked at again."""

OUTCOMES = {
    "moved": "distance moved in {h} steps",
    "later": "η* {h} steps later",
    "gain": "η* {h} steps later, at equal η* now and step",
}
"""What a walk does next: how far its state moves in behavior space, how evolvable it is then, and that
with η* now and the step held fixed, by partial rank correlation. The plain change of η* is not among
them: η* now is a part of it and of r*, so the two are negatively related whatever walks do."""

# A rank correlation of fewer points with two variables held fixed says little.
_POINTS = 10


@dataclass(frozen=True)
class Relation:
    """How r* of a state goes with what its walk does next.

    Parameters
    ----------
    condition : str, optional
        None for the runs of all conditions together.
    outcome : str
        A key of :data:`OUTCOMES`.
    test : HypothesisTest, optional
        Of one rank correlation per run: steps of a run depend on each other, runs do not. Above 0
        where less follows a low r*, as if it held walks back.
    adjusted : float, optional
        p, adjusted by Holm's method for all relations of the study.
    reason : str
        Why there is no test.
    """

    condition: str | None
    outcome: str
    test: HypothesisTest | None
    adjusted: float | None
    reason: str = ""


@dataclass(frozen=True)
class DissimilaStudy:
    """Points of a low r* on the walks of a study.

    Parameters
    ----------
    horizon : int
        Steps after which a walk is looked at again.
    points : int
        States that were measured.
    neutral : int
        Of these, the ones whose offspring all behave as they do (LS* about 0), so that r* says
        nothing: they are left out.
    quantiles : dict of str to tuple of float
        r* of the other states of each condition, at :data:`nichechain.landscape.QUANTILES`.
    runs_left_out : int
        Runs with too few points, or of one value only, for a correlation.
    relations : tuple of Relation
    """

    horizon: int
    points: int
    neutral: int
    quantiles: dict[str, tuple[float, ...]]
    runs_left_out: int
    relations: tuple[Relation, ...]


def study_dissimila(
    records: pd.DataFrame,
    conditions: Sequence[str],
    *,
    horizon: int = HORIZON,
    seed: int = 0,
    resamples: int = RESAMPLES,
) -> DissimilaStudy:
    """Relate r* of the states of walks to what the walks do next.

    Parameters
    ----------
    records : DataFrame
        Of :func:`nichechain.studies.read_records`.
    conditions : sequence of str
        Labels of those that have finished runs.
    horizon : int
        At least 1.
    seed : int
        Of the bootstraps.
    resamples : int

    Raises
    ------
    NichechainError
        If the horizon is below 1.
    """
    check_at_least(1, horizon=horizon)
    correlations: dict[str, dict[str, list[float]]] = {label: {} for label in conditions}
    quantiles: dict[str, tuple[float, ...]] = {}
    neutral = left_out = 0
    for label in conditions:
        rows = records[records["condition"] == label].sort_values(["run", "step"])
        sensitivity = rows["expected_local_sensitivity"].to_numpy(np.float64)
        ratio = dissimila_ratio(rows["expected_evolvability"].to_numpy(np.float64), sensitivity)
        found = find_dissimila(ratio, sensitivity)
        neutral += int(found.neutral.sum())
        quantiles[label] = tuple(float(q) for q in found.quantiles)
        rows = rows.assign(ratio=np.where(found.neutral, np.nan, ratio))
        of_runs = [_correlations(run, horizon) for _, run in rows.groupby("run")]
        left_out += sum(not run for run in of_runs)
        for outcome in OUTCOMES:
            correlations[label][outcome] = [run[outcome] for run in of_runs if run]
    relations = []
    for outcome in OUTCOMES:
        everything = [r for label in conditions for r in correlations[label][outcome]]
        relations.append(_relate(None, outcome, everything, seed, resamples))
        relations += [
            _relate(label, outcome, correlations[label][outcome], seed, resamples) for label in conditions
        ]
    return DissimilaStudy(horizon, len(records), neutral, quantiles, left_out, _adjusted(relations))


def _correlations(run: pd.DataFrame, horizon: int) -> dict[str, float]:
    """Rank correlations of r* with each outcome over the states of one run; empty where there is none."""
    from scipy import stats

    names = sorted(name for name in run.columns if name.startswith("behavior_"))
    behavior = run[names].to_numpy(np.float64)
    evolvability = run["expected_evolvability"].to_numpy(np.float64)
    now, later = evolvability[:-horizon], evolvability[horizon:]
    ratio, step = run["ratio"].to_numpy(np.float64)[:-horizon], run["step"].to_numpy(np.float64)[:-horizon]
    moved = np.linalg.norm(behavior[horizon:] - behavior[:-horizon], axis=1)
    kept = np.isfinite(ratio) & np.isfinite(now) & np.isfinite(later)
    ratio, now, later, step, moved = (column[kept] for column in (ratio, now, later, step, moved))
    if kept.sum() < _POINTS or any(np.ptp(column) == 0 for column in (ratio, now, later, moved)):
        return {}
    held = np.column_stack([np.ones(len(step)), stats.rankdata(now), stats.rankdata(step)])
    return {
        "moved": float(stats.spearmanr(ratio, moved).statistic),
        "later": float(stats.spearmanr(ratio, later).statistic),
        "gain": float(stats.pearsonr(_rest(ratio, held), _rest(later, held)).statistic),
    }


def _rest(values: Floats, held: Floats) -> Floats:
    """Ranks less what is linear in the columns held fixed."""
    from scipy import stats

    ranks = stats.rankdata(values)
    rest: Floats = ranks - held @ np.linalg.lstsq(held, ranks, rcond=None)[0]
    return rest


def _relate(
    condition: str | None, outcome: str, correlations: list[float], seed: int, resamples: int
) -> Relation:
    try:
        test = signed_rank_test(
            correlations, "median rank correlation of a run", seed=seed, resamples=resamples
        )
    except NichechainError as error:
        return Relation(condition, outcome, None, None, str(error))
    return Relation(condition, outcome, test, None)


def _adjusted(relations: list[Relation]) -> tuple[Relation, ...]:
    """The relations with p adjusted for the number of those that have one."""
    adjusted = iter(adjust([relation.test.p for relation in relations if relation.test]))
    return tuple(Relation(r.condition, r.outcome, r.test, next(adjusted)) if r.test else r for r in relations)
