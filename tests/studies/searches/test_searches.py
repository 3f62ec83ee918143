"""Searches that are compared: run in pieces and by several, measured, and set beside uniform parents."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from filelock import FileLock

from nichechain import BuildConfig, NichechainError, Threads, build, load
from nichechain.archive.read import read_births
from nichechain.cli import main
from nichechain.search.selection import Told
from nichechain.studies.searches import SelectionStudy, compare_selections, read_searches, run_searches
from nichechain.studies.searches.comparing import births_ratio
from nichechain.studies.searches.measuring import curiosity_agrees, measure
from nichechain.studies.searches.report import FILES

CONFIG = BuildConfig(
    "arm", (12, 12), ((-1.0, 1.0), (-1.0, 1.0)), evaluations=700, initial=40, scale=0.1, seed=2
)
STUDY = SelectionStudy(CONFIG, ("uniform", "curiosity", "reach"), runs=3, elites=4, offspring=6)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("selections")
    with Threads(1) as executor:
        assert run_searches(STUDY, path, executor) == 0
    return path


def test_a_search_is_what_the_build_of_its_configuration_makes(folder, tmp_path):
    _, records = read_searches(folder)
    with Threads(1) as executor:
        build(replace(CONFIG, selection="reach", seed=3), tmp_path / "one", executor)
        archive = load(tmp_path / "one")
        rows = measure(archive, executor, elites=4, offspring=6)
    frame = records.to_pandas()
    own = frame[(frame["selection"] == "reach") & (frame["run"] == 1)].drop(columns=["selection", "run"])
    pd.testing.assert_frame_equal(own.reset_index(drop=True), rows.to_pandas())
    last = own.iloc[-1]
    assert (last["births"], last["filled"]) == (700, archive.filled)
    births = archive.births()
    inside = births[births["child_niche"] < 144]
    best = inside.groupby("child_niche")["objective"].max()
    np.testing.assert_allclose([last["best"], last["least"]], [best.sum(), best.min()])
    assert own["births"].tolist() == [40, *range(104, 700, 64), 700]
    assert 1.0 <= last["offspring_niches"] <= 6.0
    assert own["curiosity"].notna().sum() <= 4


class Interrupted:
    """Threads that are stopped at their fifth batch."""

    def __init__(self, executor):
        self.executor, self.calls = executor, 0

    def evaluate(self, *given):
        self.calls += 1
        if self.calls == 5:
            raise KeyboardInterrupt
        return self.executor.evaluate(*given)


def test_interruptions_and_other_processes_change_nothing(folder, tmp_path):
    for _ in range(6):
        with Threads(1) as executor, pytest.raises(KeyboardInterrupt):
            run_searches(STUDY, tmp_path, Interrupted(executor))
    with Threads(1) as executor:
        # Whoever holds the lock of a search is making it.
        with FileLock(tmp_path / "searches" / "reach-0002.lock"):
            assert run_searches(STUDY, tmp_path, executor) == 1
        assert read_searches(tmp_path)[1].num_rows < read_searches(folder)[1].num_rows
        assert run_searches(STUDY, tmp_path, executor) == 0
    assert read_searches(tmp_path)[1].equals(read_searches(folder)[1])
    assert not [path for path in (tmp_path / "searches").iterdir() if path.is_dir()]


def test_more_runs_may_be_asked_for_and_nothing_else(folder, tmp_path):
    with Threads(1) as executor:
        run_searches(replace(STUDY, runs=2), tmp_path, executor)
        run_searches(STUDY, tmp_path, executor)
        assert read_searches(tmp_path)[1].equals(read_searches(folder)[1])
        with pytest.raises(NichechainError, match="holds a study of 3 runs, more than the 2 asked for"):
            run_searches(replace(STUDY, runs=2), tmp_path, executor)
        other = replace(STUDY, config=replace(CONFIG, scale=0.2), elites=0)
        with pytest.raises(NichechainError, match="differs in elites, scale"):
            run_searches(other, tmp_path, executor)


def test_an_archive_stays_alone_in_its_folder(tmp_path):
    with Threads(1) as executor:
        build(replace(CONFIG, evaluations=150), tmp_path, executor)
        before = sorted(tmp_path.rglob("*"))
        with pytest.raises(NichechainError, match="holds an archive, but a study needs a folder of its own"):
            run_searches(STUDY, tmp_path, executor)
    assert sorted(tmp_path.rglob("*")) == before


def records_of(**searches: list[int]) -> pa.Table:
    """Niches filled after every ten births of some searches, named by selection and run."""
    tables = []
    for name, filled in searches.items():
        selection, run = name.rsplit("_", 1)
        size = len(filled)
        tables.append(
            pd.DataFrame(
                {
                    "selection": selection,
                    "run": int(run),
                    "births": 10 * np.arange(1, size + 1),
                    "filled": filled,
                    "best": -1.0 * np.array(filled),
                    "least": -3.0,
                    "curiosity": [np.nan] * (size - 1) + [0.25 * int(run)],
                    "offspring_niches": [np.nan] * (size - 1) + [2.0 + int(run)],
                }
            )
        )
    return pa.Table.from_pandas(pd.concat(tables), preserve_index=False)


def test_worth_is_a_geometric_mean_of_pairs():
    study = SelectionStudy(replace(CONFIG, evaluations=40), ("uniform", "reach"), runs=3)
    records = records_of(
        uniform_0=[1, 2, 3, 4],
        uniform_1=[1, 4, 6, 8],
        # Half of the births, and twice as many: it ends with what uniform had after half of them.
        reach_0=[2, 4, 5, 6],
        reach_1=[1, 2, 3, 4],
        # No partner yet.
        reach_2=[9, 9, 9, 9],
    )
    uniform, reach = compare_selections(study, records)
    assert (uniform.births_ratio.value, uniform.runs, reach.runs) == (1.0, 2, 2)
    assert reach.births_ratio.value == pytest.approx(1.0)
    assert reach.p == 1.0
    # t of two logarithms ±log 2 with one degree of freedom.
    half = 12.706204736 * np.log(2.0)
    np.testing.assert_allclose(np.log(reach.births_ratio.interval.high), half)
    assert reach.filled.value == 5.0
    # Each niche is worth its best objective, -1, above the least, -3.
    assert reach.quality.value == 10.0
    assert reach.offspring_niches.value == 2.5
    assert [(share, mean.value) for share, mean in reach.curiosity] == [(1.0, 0.125)]


def test_births_are_those_for_the_coverage_of_the_worse():
    rows = {
        name: pd.DataFrame({"births": [10, 20, 30], "filled": filled})
        for name, filled in {"slow": [1, 2, 4], "fast": [2, 4, 7]}.items()
    }
    assert births_ratio(rows["fast"], rows["slow"]) == pytest.approx(2 / 3)
    assert births_ratio(rows["slow"], rows["fast"]) == pytest.approx(3 / 2)
    assert births_ratio(rows["slow"], rows["slow"]) == 1.0


def test_curiosity_agrees_with_evolvability_where_both_follow_the_place(tmp_path):
    with Threads(1) as executor:
        build(replace(CONFIG, evaluations=3000), tmp_path, executor)
    archive = load(tmp_path)
    told = Told.of(read_births(archive.folder, archive.meta))
    assert -1.0 <= curiosity_agrees(told, archive.niches) <= 1.0
    assert np.isnan(curiosity_agrees(told[:40], archive.niches))
    assert np.isnan(curiosity_agrees(told[:60], archive.niches))


def test_the_command_makes_and_reports_a_study(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = [
        "study",
        "selection",
        "arm",
        "--grid",
        "8x8",
        "--evaluations",
        "200",
        "--runs",
        "2",
        "--scale",
        "0.1",
    ]
    words += ["--elites", "2", "--offspring", "3", "--workers", "1", "--out", "s"]
    assert main([*words, "--selections", "uniform", "reach:0.9,uniform:0.1"]) == 0
    assert "4 of 4 searches" in capsys.readouterr().out
    assert all((tmp_path / "s" / name).is_file() for name in FILES)
    report = (tmp_path / "s/report.md").read_text("utf-8")
    (line,) = [line for line in report.splitlines() if line.startswith("nichechain study selection arm")]
    before = [(tmp_path / "s" / name).read_bytes() for name in FILES]
    assert main(line.split()[1:]) == 0
    assert main(["study", "report", "s"]) == 0
    assert before == [(tmp_path / "s" / name).read_bytes() for name in FILES]
    assert main(["study", "resume", "s", "--runs", "3", "--workers", "1"]) == 0
    assert read_searches(tmp_path / "s")[0].runs == 3
    assert main(["study"]) == 0
    assert main(["study", "quality"]) == 2
    assert "there is no study 'quality'" in capsys.readouterr().err
