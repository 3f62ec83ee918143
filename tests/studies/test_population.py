"""Studies of multi-state walks: what is averaged over states, and what a population is measured by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nichechain import Threads, domains
from nichechain.landscape import population_evolvability
from nichechain.studies import Condition, Study, metric_conditions, read_births, read_records, run
from nichechain.studies.analysis import analyse

ARM = domains.make("arm")
STUDY = Study(
    "population",
    "arm",
    metric_conditions(("kde", "knn"), Condition("base", offspring=4, states=3, scale=0.1)),
    runs=4,
    steps=3,
    shape=(6, 6),
    bounds=ARM.bounds,
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("population")
    with Threads(2) as threads:
        run(STUDY, folder, threads)
    return folder


def test_all_births_are_counted(folder: Path) -> None:
    assert STUDY.evaluations == 2 * 4 * (3 + 4 * 3 * 4) == read_births(folder).num_rows


def test_summaries_are_means_over_states_and_of_the_population(folder: Path) -> None:
    frame = read_records(folder).to_pandas()
    analysis = analyse(STUDY, read_records(folder), resamples=50)
    assert (analysis.main, analysis.last) == ("population_evolvability", 3)
    assert (analysis.evaluations, analysis.offspring, analysis.failed) == (408, 384, 0)
    for label in ("kde", "knn"):
        rows = frame[(frame["condition"] == label) & (frame["step"] == 3)]
        spread, each = [], []
        for _, states in rows.groupby("run"):
            assert len(states) == 3
            spread.append(population_evolvability(states[["next_behavior_0", "next_behavior_1"]].to_numpy()))
            each.append(states["expected_evolvability"].mean())
        assert analysis.summary(label, 3).mean == pytest.approx(np.mean(spread))
        assert analysis.summary(label, 3, "expected_evolvability").mean == pytest.approx(np.mean(each))
    (asked,) = analysis.answers("groups", 3)
    assert asked.test is not None
    assert asked.test.n == 8
