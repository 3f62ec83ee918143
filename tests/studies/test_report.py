import dataclasses
import json
import re

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from nichechain import domains, execution
from nichechain.core.errors import NichechainError
from nichechain.studies import (
    LEVELS,
    METRICS,
    Condition,
    Study,
    metric_conditions,
    paper,
    pressure_conditions,
    read_records,
    run,
    variations,
)
from nichechain.studies.analysis import analyse, varied
from nichechain.studies.document import Bullets, Code, Document, Heading, Paragraph, Picture, Table
from nichechain.studies.findings import find
from nichechain.studies.report import FILES, write_report
from nichechain.studies.wording import compose

FEW = 199
BASE = Condition(label="x")


def study(kind, conditions, runs=50, steps=50, **more):
    return Study(kind, "fetch", conditions, runs, steps, (4, 4), ((0, 1), (0, 1)), **more)


def pressure(runs=50, **more):
    return study("pressure", pressure_conditions(LEVELS, BASE), runs, **more)


def metrics(names=paper.METRICS, runs=50, steps=100, **more):
    return study("metrics", metric_conditions(names, BASE), runs, steps, **more)


def table(values, rng=None):
    """Records of runs, of η* by condition and step; all else is noise."""
    rng = rng or np.random.default_rng(0)
    rows = [
        {"condition": label, "run": number, "step": step, "expected_evolvability": float(value)}
        for label, steps in values.items()
        for step, of_runs in steps.items()
        for number, value in enumerate(of_runs)
    ]
    frame = pd.DataFrame(rows).sort_values(["condition", "run", "step"], kind="stable")
    noise = ("evolvability", "coverage", "expected_local_sensitivity", "behavior_0", "behavior_1")
    frame = frame.assign(**{name: rng.uniform(0.1, 1, len(frame)) for name in noise})
    return pa.Table.from_pandas(frame.assign(sample_size=30, stalled=0), preserve_index=False)


def correlated(r):
    """Values of 6 levels × 50 runs, of which Spearman's r with the level is as wanted."""
    level = np.repeat(np.arange(6)[::-1], 50)
    noise = np.random.default_rng(11).normal(size=300)
    low, high = 0.0, 50.0
    for _ in range(60):
        share = (low + high) / 2
        values = level + share * noise
        # Pearson's correlation of ranks.
        found = np.corrcoef(pd.Series(level).rank(), pd.Series(values).rank())[0, 1]
        low, high = (share, high) if found > r else (low, share)
    return dict(zip(LEVELS, values.reshape(6, 50), strict=True))


def separate(sums):
    """Groups of 50 that share the ranks 1 ... n, with these sums of ranks."""
    n = 50 * len(sums)
    groups = [np.arange(k + 1, n + 1, len(sums), dtype=float) for k in range(len(sums))]
    while any(off := [group.sum() - wanted for group, wanted in zip(groups, sums, strict=True)]):
        over, under = int(np.argmax(off)), int(np.argmin(off))
        gap = groups[over][:, None] - groups[under]
        wanted = min(off[over], -off[under])
        i, j = np.unravel_index(np.argmin(np.where(gap > 0, np.abs(gap - wanted), np.inf)), gap.shape)
        groups[over][i], groups[under][j] = groups[under][j], groups[over][i]
    return groups


def statistics(folder):
    def refuse(name):
        raise AssertionError(f"{name} is not JSON")

    return json.loads((folder / "statistics.json").read_text(), parse_constant=refuse)


def asked_of(values, asking, step):
    wanted = (asking, step, "expected_evolvability")
    return [t for t in values["tests"] if (t["asking"], t["step"], t["measure"]) == wanted]


def verdicts(analysis):
    return {finding.claim: finding.verdict for finding in find(analysis)}


def verdict(analysis, words):
    (found,) = [said for claim, said in verdicts(analysis).items() if words in claim]
    return found


def test_the_papers_correlation_has_its_p_value(tmp_path):
    values = {label: {0: np.arange(50.0), 50: end} for label, end in correlated(0.7106).items()}
    write_report(tmp_path, pressure(), table(values), resamples=FEW)
    (found,) = asked_of(statistics(tmp_path), "trend", 50)
    assert found["test"]["name"] == "Spearman's rank correlation"
    assert found["test"]["statistic"] == pytest.approx(0.7106, abs=5e-5)
    assert found["test"]["n"] == 300
    assert found["test"]["p"] == pytest.approx(2.1e-47, rel=0.03)
    interval = found["test"]["effect"]["interval"]
    assert interval["low"] < 0.7106 < interval["high"]
    assert interval["level"] == 0.95
    assert "bootstrap" in interval["method"]
    assert "r = 0.711" in (tmp_path / "report.md").read_text()


def test_the_papers_mean_ranks_have_its_p_values(tmp_path):
    groups = dict(zip(paper.METRICS, separate([6137, 4716, 4667, 4580]), strict=True))
    rng = np.random.default_rng(0)
    values = {name: {0: rng.random(50), 50: rng.random(50), 100: of} for name, of in groups.items()}
    analysis = write_report(tmp_path, metrics(), table(values), resamples=FEW)
    (found,) = asked_of(statistics(tmp_path), "groups", 100)
    assert list(found["groups"]["mean_ranks"].values()) == pytest.approx([122.74, 94.32, 93.34, 91.60])
    assert found["test"]["statistic"] == pytest.approx(9.900, abs=5e-4)
    assert found["test"]["p"] == pytest.approx(paper.METRICS_P, abs=5e-5)
    pairs = {(pair["first"], pair["second"]): pair["p"] for pair in found["groups"]["pairs"]}
    assert pairs == pytest.approx(dict(paper.METRICS_HOLM), abs=5e-5)
    assert verdict(analysis, "makes a difference (step 100)") == "reproduced"
    assert verdict(analysis, "kde against ancestors (step 100)") == "reproduced"
    assert verdict(analysis, "kde against knn (step 100)") == "significant in neither"
    assert verdict(analysis, "KDE dominates (largest mean η*) (step 100)") == "agrees"
    assert verdict(analysis, "kNN without archive is lowest (smallest mean η*) (step 100)") == "differs"


def levels(slope, change, runs=10, labels=LEVELS):
    """η* that starts alike and changes by this much, the more the higher the pressure."""
    rng = np.random.default_rng(4)
    return table(
        {
            label: {
                0: (start := 5 + rng.normal(0, 0.1, runs)),
                50: start + change + slope * (6 - LEVELS.index(label)) + rng.normal(0, 0.1, runs),
            }
            for label in labels
        }
    )


@pytest.mark.parametrize(
    ("slope", "change", "said"),
    [
        (1.0, -2.0, ["reproduced", "reproduced", "reproduced", "agrees"]),
        (1.0, -9.0, ["reproduced", "the opposite", "reproduced", "differs"]),
        (-1.0, 4.0, ["the opposite", "the opposite", "the opposite", "differs"]),
        (0.0, 0.0, ["not found", "not found", "not found", "agrees"]),
    ],
)
def test_verdicts_follow_the_numbers(slope, change, said):
    analysis = analyse(pressure(10), levels(slope, change), resamples=FEW)
    words = ("More pressure", "highly selective", "random walk loses", "modest pressure")
    assert [verdict(analysis, word) for word in words] == said


def test_what_is_not_walked_is_not_judged(tmp_path):
    analysis = write_report(
        tmp_path, pressure(20), levels(1.0, -2.0, 7, LEVELS[:3]), resamples=FEW, command="nichechain walks"
    )
    assert analysis.finished == {"selective": 7, "0.1": 7, "0.25": 7, "0.5": 0, "0.75": 0, "random": 0}
    for words in ("More pressure", "random walk loses", "modest pressure", "same mean"):
        assert verdict(analysis, words) == "cannot be said yet"
    assert verdict(analysis, "highly selective") == "reproduced"
    text = (tmp_path / "report.md").read_text()
    assert "21 of 120 runs are finished" in text
    assert "not complete" in text
    assert "50 runs of each condition, here 0 to 7" in text
    values = statistics(tmp_path)
    assert values["runs"]["share"] == pytest.approx(21 / 120)
    assert values["evaluations"] == {"planned": 120 * 1531, "finished": 21 * 1531}
    assert values["command"] == "nichechain walks"


def test_a_single_run_is_reported_and_nothing_is_tested(tmp_path):
    values = {"selective": {0: [1.0], 50: [2.0]}}
    analysis = write_report(tmp_path, pressure(1), table(values), resamples=FEW)
    assert all(asked.test is None and asked.reason for asked in analysis.asked)
    assert {row["low"] for row in statistics(tmp_path)["summaries"]} == {None}
    assert "NaN" not in (tmp_path / "statistics.json").read_text()


def test_values_that_are_missing_or_all_alike_are_said():
    ones = np.ones(4)
    values = {label: {0: ones, 50: ones} for label in LEVELS[:-1]} | {
        "random": {0: ones, 50: np.array([1, 1, 1, np.nan])}
    }
    analysis = analyse(pressure(4), table(values), resamples=FEW)
    (found,) = analysis.answers("trend", 50)
    assert "values are all 1" in found.reason
    assert analysis.summary("random", 50).n == 3


def test_a_condition_without_any_value_is_reported(tmp_path):
    nothing = np.full(4, np.nan)
    values = {label: {0: np.arange(4.0), 50: np.arange(4.0)} for label in LEVELS[:-1]} | {
        "random": {0: nothing, 50: nothing}
    }
    analysis = write_report(tmp_path, pressure(4), table(values), resamples=FEW)
    assert analysis.summary("random", 50).n == 0
    assert verdict(analysis, "random walk loses") == "cannot be said yet"
    (found,) = asked_of(statistics(tmp_path), "trend", 50)
    assert found["test"]["n"] == 20


@pytest.mark.parametrize("paired", [False, True])
def test_only_runs_of_all_conditions_are_paired(paired):
    rng = np.random.default_rng(0)
    rows = table({name: {0: rng.random(6), 20: rng.random(6)} for name in METRICS}).to_pandas()
    rows = rows[(rows["condition"] != "knn") | (rows["run"] < 4)]
    records = pa.Table.from_pandas(rows, preserve_index=False)
    analysis = analyse(metrics(METRICS, 6, 20, paired=paired), records, resamples=FEW)
    everything, four = analysis.answers("groups", 20)
    assert everything.test.name == ("Friedman's test" if paired else "Kruskal-Wallis test")
    assert everything.test.n == (4 if paired else 28)
    assert set(four.conditions) == set(paper.METRICS)


def test_changes_are_within_runs():
    values = levels(1.0, -2.0)
    analysis = analyse(pressure(10), values, resamples=FEW)
    rows = values.to_pandas().pivot_table(
        index=["condition", "run"], columns="step", values="expected_evolvability"
    )
    for asked in analysis.answers("change", 50):
        of = rows.loc[asked.conditions[0]]
        assert asked.test.effect.value == pytest.approx((of[50] - of[0]).mean())


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """A small study on the arm, really walked."""
    folder = tmp_path_factory.mktemp("walks")
    arm = domains.make("arm")
    conditions = variations("scale", Condition(label="x", offspring=6, k=3))
    made = Study("sensitivity", "arm", conditions, 3, 18, (4, 4), arm.bounds)
    with execution.Threads(1) as threads:
        run(made, folder, threads)
    return made, read_records(folder)


@pytest.fixture(scope="module")
def written(walked, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    return folder, write_report(folder, *walked, command="walks <scale>", unit="arm lengths", resamples=FEW)


def test_a_report_is_six_files(written, walked):
    folder, analysis = written
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    assert pq.read_table(folder / "records.parquet").equals(walked[1])
    assert (folder / "figure.png").read_bytes().startswith(b"\x89PNG")
    values = statistics(folder)
    assert Study.from_json(values["study"]) == walked[0]
    assert values["evaluations"]["finished"] == walked[0].evaluations == analysis.evaluations
    assert values["versions"]["scipy"]
    assert {t["asking"] for t in values["tests"]} == {"trend", "groups", "change"}
    assert not values["findings"]


def test_a_page_needs_no_other_file(written):
    page = (written[0] / "report.html").read_text()
    assert not re.search(r'(src|href)="(?!data:)', page)
    assert "walks &lt;scale&gt;" in page
    assert "Evolvability when scale varies, on arm" in page


def test_the_same_runs_give_the_same_bytes(written, walked, tmp_path):
    write_report(tmp_path, *walked, command="walks <scale>", unit="arm lengths", resamples=FEW)
    for name in FILES:
        assert (tmp_path / name).read_bytes() == (written[0] / name).read_bytes(), name


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("scale", "scale"),
        ("k", "k"),
        ("offspring", "offspring"),
        ("decay", "decay"),
        ("bandwidth-mode", None),
        ("initialisation", None),
    ],
)
def test_a_numeric_setting_has_a_trend(name, field):
    assert varied(study("sensitivity", variations(name, BASE))) == field


def test_two_settings_that_vary_have_no_trend():
    both = (BASE, dataclasses.replace(BASE, label="y", k=3, scale=0.1))
    assert varied(study("sensitivity", both)) is None


def test_other_settings_than_the_papers_are_said():
    base = dataclasses.replace(BASE, scale=0.1)
    other = study("pressure", pressure_conditions(LEVELS, base), 10)
    analysis = analyse(other, levels(1.0, -2.0), resamples=FEW)
    text = compose(analysis, command="", unit="m", figure="f.png", versions={}).markdown()
    assert "Setting scale is 0.1 here, and 1.0 by default" in text
    assert "Setting k" not in text


def test_records_of_another_study_are_refused(tmp_path):
    with pytest.raises(NichechainError, match="condition is 'kde'"):
        write_report(tmp_path, pressure(), table({"kde": {0: [1.0], 50: [2.0]}}))
    assert not list(tmp_path.iterdir())


def test_no_records_are_refused(tmp_path):
    with pytest.raises(NichechainError, match="no finished walks"):
        write_report(tmp_path, pressure(), table({"random": {0: [1.0]}}).slice(0, 0))


def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(NichechainError, match="cannot be written"):
        write_report(tmp_path / "file", pressure(), levels(1.0, -2.0), resamples=FEW)


def test_text_is_shown_as_it_is():
    odd = "a|b <i> *c* _d_ `e` [f](g) & \\"
    blocks = (
        Heading(odd),
        Paragraph(odd),
        Bullets((odd,)),
        Table(odd, (odd,), ((odd,),)),
        Picture("p.png", odd),
    )
    document = Document(odd, (*blocks, Code("a < b")))
    page = document.html({"p.png": b"picture"})
    assert "<i>" not in page
    assert page.count("a|b &lt;i&gt; *c*") == 10
    assert "data:image/png;base64,cGljdHVyZQ==" in page
    markdown_it = pytest.importorskip("markdown_it")
    shown = markdown_it.MarkdownIt("commonmark").enable("table").render(document.markdown())
    assert shown.count("a|b &lt;i&gt; *c* _d_ `e` [f](g) &amp; \\") >= 6
    assert "<em>" not in shown
    assert "<pre><code>a &lt; b" in shown
