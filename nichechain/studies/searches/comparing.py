"""What a selection is worth beside uniform parents: births needed, niches filled, quality, evolvability."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.core.intervals import LEVEL, mean_interval
from nichechain.studies.results import Interval
from nichechain.studies.searches.study import REFERENCE, SelectionStudy

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Mean:
    """A mean over runs.

    Parameters
    ----------
    value : float
        NaN where no run has one.
    interval : Interval
    runs : int
    """

    value: float
    interval: Interval
    runs: int


@dataclass(frozen=True)
class Worth:
    """How a selection did.

    Parameters
    ----------
    selection : str
    runs : int
        Finished, and so is uniform's of the same seed.
    births_ratio : Mean
        Births needed over those that uniform needed, for the coverage that the worse of both ends with:
        below 1 where the selection is better. Geometric, paired by seed; 1 for uniform itself.
    p : float
        Of Wilcoxon's signed-rank test that the ratios lie about 1; NaN for uniform, and where all are 1.
    filled : Mean
        Niches filled at the end.
    quality : Mean
        QD score at the end: the best objectives of all filled niches, each above the least of them in
        any search of the study; NaN without an objective.
    offspring_niches : Mean
        Niches that offspring of an elite of the end land in.
    curiosity : tuple of (float, Mean)
        Rank correlation of curiosity and 5-evolvability, after some shares of the births.
    """

    selection: str
    runs: int
    births_ratio: Mean
    p: float
    filled: Mean
    quality: Mean
    offspring_niches: Mean
    curiosity: tuple[tuple[float, Mean], ...]


def compare_selections(study: SelectionStudy, records: pa.Table) -> tuple[Worth, ...]:
    """How the selections of a study did, as far as it is.

    Parameters
    ----------
    study : SelectionStudy
    records : pyarrow.Table
        Of :func:`read_searches`.

    Returns
    -------
    tuple of Worth
        In the order of the study.

    Raises
    ------
    NichechainError
        If no search of uniform parents is finished.
    """
    from scipy import stats

    if not isinstance(records, pa.Table):
        raise NichechainError(f"records is {shown(records)}, but must be a pyarrow.Table")
    frame = records.to_pandas(use_threads=False)
    searches: dict[tuple[str, int], pd.DataFrame] = dict(
        iter(frame.groupby(["selection", "run"], sort=False))
    )
    reference = {run: rows for (selection, run), rows in searches.items() if selection == REFERENCE}
    if not reference:
        raise NichechainError(f"no search of {REFERENCE} parents is finished, which others are compared with")
    floor = min(rows["least"].iloc[-1] for rows in searches.values())
    found = []
    for selection in study.selections:
        mine = {run: rows for (name, run), rows in searches.items() if name == selection and run in reference}
        logs = np.array([np.log(births_ratio(rows, reference[run])) for run, rows in mine.items()])
        told = logs.size > 0 and bool(np.any(logs != 0.0))
        last = [rows.iloc[-1] for rows in mine.values()]
        found.append(
            Worth(
                selection,
                len(mine),
                _geometric(logs),
                float(stats.wilcoxon(logs).pvalue) if told else float("nan"),
                _mean([row["filled"] for row in last]),
                _mean([row["best"] - row["filled"] * floor for row in last]),
                _mean([row["offspring_niches"] for row in last]),
                _correlations(list(mine.values()), study.config.evaluations),
            )
        )
    return tuple(found)


def births_ratio(rows: pd.DataFrame, reference: pd.DataFrame) -> float:
    """Births that a search needed over those of another, for the coverage that the worse ends with."""
    target = min(rows["filled"].iloc[-1], reference["filled"].iloc[-1])
    return _needed(rows, target) / _needed(reference, target)


def _needed(rows: pd.DataFrame, filled: float) -> float:
    return float(rows["births"].iloc[int(np.argmax(rows["filled"].to_numpy() >= filled))])


def _correlations(searches: list[pd.DataFrame], births: int) -> tuple[tuple[float, Mean], ...]:
    tables = [rows.dropna(subset=["curiosity"]) for rows in searches]
    shares = sorted({round(4 * row / births) / 4 for rows in tables for row in rows["births"]})
    return tuple(
        (
            share,
            _mean(
                [
                    value
                    for rows in tables
                    for row, value in zip(rows["births"], rows["curiosity"], strict=True)
                    if round(4 * row / births) / 4 == share
                ]
            ),
        )
        for share in shares
    )


def _mean(values: list[float]) -> Mean:
    kept = np.array(values, np.float64)
    kept = kept[~np.isnan(kept)]
    if not kept.size:
        nothing = float("nan")
        return Mean(nothing, Interval(nothing, nothing, LEVEL, "t"), 0)
    mean, low, high = (float(value) for value in mean_interval(kept))
    return Mean(mean, Interval(low, high, LEVEL, "t"), kept.size)


def _geometric(logs: Floats) -> Mean:
    mean = _mean(logs.tolist())
    low, high = np.exp(mean.interval.low), np.exp(mean.interval.high)
    return Mean(
        float(np.exp(mean.value)), Interval(float(low), float(high), LEVEL, "t of logarithms"), mean.runs
    )
