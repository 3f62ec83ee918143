"""All that is computed from the finished runs of a study, before any of it is put into words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.core.intervals import mean_interval
from nichechain.studies import paper
from nichechain.studies.conditions import Condition, pressure_of
from nichechain.studies.dissimila import HORIZON, DissimilaStudy, study_dissimila
from nichechain.studies.results import GroupTest, HypothesisTest
from nichechain.studies.statistics import (
    RESAMPLES,
    change_test,
    metric_test,
    paired_test,
    pressure_test,
)
from nichechain.studies.study import Study

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

MAIN = "expected_evolvability"
"""The measure that the paper calls evolvability in its results."""

POPULATION = "population_evolvability"
"""What a study of populations asks first."""

Asking = Literal["trend", "groups", "change"]


@dataclass(frozen=True)
class Summary:
    """A measure of a condition's runs at one step.

    Parameters
    ----------
    condition, measure : str
    step : int
    n : int
        Runs with a value.
    mean, low, high : float
        With the 95 % t-interval of the mean over runs; NaN where there is none.
    median : float
    """

    condition: str
    measure: str
    step: int
    n: int
    mean: float
    low: float
    high: float
    median: float


@dataclass(frozen=True)
class Asked:
    """A question and what a test says to it.

    Parameters
    ----------
    asking : {"trend", "groups", "change"}
        Whether a measure goes with a level, differs between conditions, or changes from step 0.
    measure : str
    step : int
    conditions : tuple of str
        Those that the test rests on.
    test : HypothesisTest, optional
    groups : GroupTest, optional
        For ``groups``, of which ``test`` is the test between all.
    reason : str
        Why there is no test.
    """

    asking: Asking
    measure: str
    step: int
    conditions: tuple[str, ...]
    test: HypothesisTest | None
    groups: GroupTest | None = None
    reason: str = ""


@dataclass(frozen=True)
class Analysis:
    """What the finished runs of a study show.

    Parameters
    ----------
    study : Study
    finished : dict of str to int
        Runs of each condition.
    offspring, failed : int
        Offspring of all states, and how many of them failed.
    stalls : int
        Steps without a candidate, at which a walk stayed.
    steps : tuple of int
        Where conditions are compared.
    summaries : tuple of Summary
    asked : tuple of Asked
    dissimila : DissimilaStudy, optional
        None where walks are too short.
    """

    study: Study
    finished: dict[str, int]
    offspring: int
    failed: int
    stalls: int
    steps: tuple[int, ...]
    summaries: tuple[Summary, ...]
    asked: tuple[Asked, ...]
    dissimila: DissimilaStudy | None

    @property
    def evaluations(self) -> int:
        """Rollouts of the finished runs, the starts among them."""
        return sum(
            n * self.study.condition(label).evaluations(self.study.steps)
            for label, n in self.finished.items()
        )

    @property
    def main(self) -> str:
        """The measure that the study is about."""
        return tested(self.study)[0]

    @property
    def last(self) -> int:
        """Step that matters most: the paper's, or the last where walks do not go so far."""
        wanted = paper.METRICS_STEP if self.study.kind == "metrics" else paper.FIGURE_STEP
        return wanted if wanted in self.steps else self.steps[-1]

    def summary(self, condition: str, step: int, measure: str | None = None) -> Summary:
        """The summary of a condition that has finished runs, by default of the main measure."""
        wanted = (condition, measure or self.main, step)
        return next(s for s in self.summaries if (s.condition, s.measure, s.step) == wanted)

    def answers(self, asking: Asking, step: int, measure: str | None = None) -> list[Asked]:
        """What was asked of a measure at a step, by default of the main one."""
        wanted = (asking, step, measure or self.main)
        return [a for a in self.asked if (a.asking, a.step, a.measure) == wanted]


def analyse(
    study: Study, records: pa.Table, *, resamples: int = RESAMPLES, horizon: int = HORIZON
) -> Analysis:
    """Summarise and test the finished runs of a study.

    Parameters
    ----------
    study : Study
    records : pyarrow.Table
        Of :func:`nichechain.studies.read_records`.
    resamples : int
        Of each bootstrap, which are seeded by the study's seed.
    horizon : int
        Steps after which :func:`study_dissimila` looks again.

    Raises
    ------
    NichechainError
        If a condition of the records is not the study's, or no run is finished.
    """
    frame = records.to_pandas(use_threads=False)
    tables = _Tables(study, frame)
    main, *_ = measures = tested(study)
    last = int(frame["step"].max())
    of_paper = study.kind in ("pressure", "metrics")
    landmarks = {paper.FIGURE_STEP, paper.METRICS_STEP} if of_paper else set()
    steps = tuple(sorted({step for step in landmarks if step < last} | {last}))
    ask = _Asking(study, tables, resamples)
    asked = [ask.groups(0, main, tables.labels)]
    for step in steps:
        asked += [ask.change(label, step) for label in tables.labels if step > 0]
        for measure in measures:
            if study.kind == "pressure" or varied(study) is not None:
                asked.append(ask.trend(step, measure))
            if study.kind != "pressure" and step > 0:
                asked.append(ask.groups(step, measure, tables.labels))
        four = [label for label in tables.labels if label in paper.METRICS]
        if study.kind == "metrics" and step > 0 and four != tables.labels:
            asked.append(ask.groups(step, main, four))
    runs = frame.groupby("condition")["run"].nunique()
    finished = {c.label: int(runs.get(c.label, 0)) for c in study.conditions}
    each = {c.label: (study.steps + 1) * c.width * c.offspring for c in study.conditions}
    offspring = sum(n * each[label] for label, n in finished.items())
    alone = all(condition.states is None for condition in study.conditions)
    return Analysis(
        study=study,
        finished=finished,
        offspring=offspring,
        failed=offspring - int(frame["sample_size"].sum()),
        stalls=int(frame["stalled"].sum()),
        steps=steps,
        summaries=tuple(tables.summaries(sorted({0, *steps}))),
        asked=tuple(asked),
        dissimila=study_dissimila(frame, tables.labels, horizon=horizon, seed=study.seed, resamples=resamples)
        if last > horizon and alone
        else None,
    )


def tested(study: Study) -> tuple[str, ...]:
    """Measures that are summarised and tested, that which a study is about first."""
    of_states = (MAIN, "evolvability", "coverage")
    return (POPULATION, *of_states) if study.kind == "population" else of_states


def varied(study: Study) -> str | None:
    """The one setting that the conditions of a sensitivity study differ in, where it is a number."""
    if study.kind != "sensitivity":
        return None
    settings = [asdict(condition) for condition in study.conditions]
    names = Condition.names()[1:]
    differing = [name for name in names if len({setting[name] for setting in settings}) > 1]
    if len(differing) != 1 or not all(isinstance(s[differing[0]], int | float) for s in settings):
        return None
    return differing[0]


def plain(value: Any) -> Any:
    """Values as JSON has them; what is not finite is None."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, float):
        return value if np.isfinite(value) else None
    return value


class _Tables:
    """A table of runs by steps for each condition and measure, the mean over the states of a walk."""

    def __init__(self, study: Study, frame: pd.DataFrame) -> None:
        if frame.empty:
            raise NichechainError("there are no finished walks to analyse")
        known = [condition.label for condition in study.conditions]
        for label in frame["condition"].unique():
            if label not in known:
                raise NichechainError(f"condition is {shown(label)}, but the study's are {', '.join(known)}")
        there = set(frame["condition"])
        self.labels = [label for label in known if label in there]
        self._of = {
            (label, measure): rows.groupby(["run", "step"])[measure].mean().unstack()
            for label in self.labels
            for rows in [frame[frame["condition"] == label]]
            for measure in tested(study)
        }

    def at(self, label: str, measure: str, step: int) -> pd.Series:
        """Values of the runs that have one."""
        return self._of[label, measure][step].dropna()

    def summaries(self, steps: Sequence[int]) -> list[Summary]:
        found = []
        for (label, measure), table in self._of.items():
            for step in steps:
                values = table[step].to_numpy(np.float64)
                mean, low, high = (float(bound) for bound in mean_interval(values))
                there = values[~np.isnan(values)]
                median = float(np.median(there)) if there.size else np.nan
                found.append(Summary(label, measure, step, there.size, mean, low, high, median))
        return found


@dataclass(frozen=True)
class _Asking:
    """The questions of a study, each answered by a test or by why there is none."""

    study: Study
    tables: _Tables
    resamples: int

    def trend(self, step: int, measure: str) -> Asked:
        labels = tuple(self.tables.labels)
        values = [self.tables.at(label, measure, step) for label in labels]
        levels = np.repeat([self._level(label) for label in labels], [len(v) for v in values])
        return _answer(
            Asked("trend", measure, step, labels, None),
            lambda: pressure_test(
                levels, np.concatenate(values), seed=self.study.seed, resamples=self.resamples
            ),
        )

    def change(self, label: str, step: int) -> Asked:
        main = tested(self.study)[0]
        before, after = (self.tables.at(label, main, s) for s in (0, step))
        runs = before.index.intersection(after.index)
        return _answer(
            Asked("change", main, step, (label,), None), lambda: change_test(before[runs], after[runs])
        )

    def groups(self, step: int, measure: str, labels: Sequence[str]) -> Asked:
        values = {label: self.tables.at(label, measure, step) for label in labels}
        # A condition that has only begun is no group yet.
        values = {label: of_runs for label, of_runs in values.items() if len(of_runs) > 1}
        test: Callable[..., GroupTest] = metric_test
        if self.study.paired and values:
            test = paired_test
            runs = sorted(set.intersection(*(set(of_runs.index) for of_runs in values.values())))
            values = {label: of_runs[runs] for label, of_runs in values.items()}
        return _answer(
            Asked("groups", measure, step, tuple(values), None),
            lambda: test(values, seed=self.study.seed, resamples=self.resamples),
        )

    def _level(self, label: str) -> float:
        condition, name = self.study.condition(label), varied(self.study)
        return 1 - pressure_of(condition.level) if name is None else float(getattr(condition, name))


def _answer(asked: Asked, test: Callable[[], HypothesisTest | GroupTest]) -> Asked:
    said = (asked.asking, asked.measure, asked.step, asked.conditions)
    try:
        found = test()
    except NichechainError as error:
        return Asked(*said, None, reason=str(error))
    if isinstance(found, GroupTest):
        return Asked(*said, found.test, found)
    return Asked(*said, found)
