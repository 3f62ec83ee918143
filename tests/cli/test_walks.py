import json
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from nichechain.cli import main
from nichechain.cli.walks import MetricsCommand, PopulationCommand, PressureCommand, SensitivityCommand
from nichechain.studies import (
    LEVELS,
    METRICS,
    VARIATIONS,
    Condition,
    metric_conditions,
    pressure_conditions,
    read_records,
    read_study,
    variations,
)
from nichechain.studies.report import FILES
from nichechain.studies.study import POPULATION_METRICS, POPULATION_SIZE

SMALL = ("--runs", "3", "--steps", "4", "--offspring", "6", "--workers", "1")


def walks(*words):
    return main(["walks", *map(str, words)])


@pytest.fixture(scope="module")
def pressure(tmp_path_factory):
    folder = tmp_path_factory.mktemp("walks") / "pressure"
    assert walks("pressure", "arm", *SMALL, "--levels", "selective,0.5,random", "--out", folder) == 0
    return folder


def test_pressure_leaves_tables_tests_figure_and_report(pressure):
    for name in FILES:
        assert (pressure / name).stat().st_size > 0
    records = pq.read_table(pressure / "records.parquet")
    assert records.equals(read_records(pressure))
    # Three levels, three runs, five states.
    assert records.num_rows == 3 * 3 * 5
    assert json.loads((pressure / "statistics.json").read_text())
    report = (pressure / "report.md").read_text()
    command = next(line for line in report.splitlines() if line.startswith("nichechain walks"))
    assert command == (
        "nichechain walks pressure arm --runs 3 --steps 4 --levels selective,0.5,random "
        f"--offspring 6 --bounds -1.0,1.0,-1.0,1.0 --out {pressure}"
    )


def test_the_command_in_a_report_gives_the_same_study(tmp_path, capsys):
    folder = tmp_path / "first"
    given = ["metrics", "arm", *SMALL, "--metrics", "kde,parent", "--k", "3", "--grid", "7x5"]
    given += ["--bounds", "-1,0.5,-1,1", "--seed", "4", "--scale", "0.3", "--paired", "--other-niche"]
    assert walks(*given, "--out", folder) == 0
    report = (folder / "report.md").read_text()
    command = next(line for line in report.splitlines() if line.startswith("nichechain walks"))
    words = shlex.split(command.replace(str(folder), str(tmp_path / "second")))
    capsys.readouterr()
    assert main([*words[1:], "--workers", "2"]) == 0
    assert read_study(tmp_path / "second") == read_study(folder)
    assert read_records(tmp_path / "second").equals(read_records(folder))


@pytest.mark.parametrize(
    "given",
    [
        ["population", "arm", *SMALL, "--metrics", "knn,ancestors", "--states", "3"],
        ["metrics", "arm", *SMALL, "--metrics", "knn,evolvability", "--litter", "2", "--states", "2"],
    ],
)
def test_so_does_that_of_several_states_and_of_litters(tmp_path, given, capsys):
    folder = tmp_path / "first"
    assert walks(*given, "--out", folder) == 0
    report = (folder / "report.md").read_text()
    command = next(line for line in report.splitlines() if line.startswith("nichechain walks"))
    words = shlex.split(command.replace(str(folder), str(tmp_path / "second")))
    capsys.readouterr()
    assert main(words[1:]) == 0
    assert read_study(tmp_path / "second") == read_study(folder)
    assert read_records(tmp_path / "second").equals(read_records(folder))
    assert ("ρ\\* at 4" in report) == (given[0] == "population")


@pytest.mark.parametrize("vary", ["scale", "bandwidth-mode", "decay", "k", "offspring"])
def test_sensitivity(tmp_path, vary, capsys):
    small = [word for word in SMALL if vary != "offspring" or word not in ("--offspring", "6")]
    assert walks("sensitivity", "arm", "--vary", vary, *small, "--out", tmp_path) == 0
    study = read_study(tmp_path)
    shown = capsys.readouterr().out
    assert len(study.conditions) >= 2
    assert "3 of 3 runs of each kind" in shown
    for condition in study.conditions:
        assert condition.label in shown


@pytest.mark.parametrize("kind", ["pressure", "metrics", "sensitivity", "population"])
def test_starts_alone(kind, tmp_path):
    assert walks(kind, "arm", "--runs", "3", "--steps", "0", "--workers", "1", "--out", tmp_path) == 0
    report = (tmp_path / "report.md").read_text()
    assert ("ρ\\* at 0" if kind == "population" else "η\\* at 0") in report
    assert "Change 0 to 0" not in report


def test_more_runs(pressure, tmp_path, capsys):
    folder = tmp_path / "grown"
    levels = ("--levels", "selective,0.5,random")
    assert walks("pressure", "arm", *SMALL, *levels, "--runs", "2", "--out", folder) == 0
    assert "2 of 2 runs" in capsys.readouterr().out
    assert walks("resume", folder, "--runs", "3") == 0
    assert read_records(folder).equals(read_records(pressure))
    # The same command goes on as well, and finds nothing left to do.
    assert walks("pressure", "arm", *SMALL, *levels, "--out", folder) == 0


def test_report_of_what_is_there(pressure, capsys):
    before = {name: (pressure / name).read_bytes() for name in FILES}
    for name in FILES:
        (pressure / name).unlink()
    assert walks("report", pressure) == 0
    assert "report.html" in capsys.readouterr().out
    for name in ("records.parquet", "statistics.json", "report.md"):
        assert (pressure / name).read_bytes() == before[name]


def test_interrupted(tmp_path):
    command = [sys.executable, "-m", "nichechain", "walks", "pressure", "arm", "--runs", "40"]
    command += ["--steps", "2000", "--workers", "1", "--out", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "running.npz").exists():
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    shown, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    assert f"nichechain walks resume {tmp_path}" in shown


def test_defaults_are_those_of_the_studies():
    """The command line writes them out again, so that its help need not import the studies."""
    out = Path("study")
    assert PressureCommand("arm", out).conditions() == pressure_conditions(LEVELS, Condition("base"))
    assert MetricsCommand("arm", out).conditions() == metric_conditions(METRICS, Condition("base"))
    base = Condition("base", states=POPULATION_SIZE)
    assert PopulationCommand("arm", out).conditions() == metric_conditions(POPULATION_METRICS, base)
    for name in VARIATIONS:
        assert SensitivityCommand("arm", out, vary=name).conditions() == variations(name, Condition("base"))


def test_help(capsys):
    assert walks() == 0
    assert "pressure DOMAIN" in capsys.readouterr().out
    with pytest.raises(SystemExit) as stopped:
        walks("pressure", "--help")
    assert stopped.value.code == 0
    assert "nichechain walks pressure" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["speed", "arm"], "there is no study 'speed'"),
        (["pressure", "moon"], "domain is 'moon'"),
        (["pressure", "arm", "--levels", "0"], "--levels is '0'"),
        (["pressure", "arm", "--levels", "1.1"], "--levels is '1.1'"),
        (["pressure", "arm", "--levels", "hard"], "--levels is 'hard'"),
        (["pressure", "arm", "--levels", "0.5,0.5"], "'0.5' is given twice"),
        (["pressure", "arm", "--levels", ","], "at least 1 condition"),
        (["metrics", "arm", "--metrics", "knn,euclid"], "--metrics is 'euclid'"),
        (["metrics", "arm", "--k", "0"], "k is 0"),
        (["metrics", "arm", "--bandwidth", "0"], "bandwidth is 0.0"),
        (["metrics", "arm", "--bandwidth", "nan"], "bandwidth is nan"),
        (["metrics", "arm", "--decay", "0"], "decay is 0.0"),
        (["pressure", "arm", "--offspring", "0"], "offspring is 0"),
        (["pressure", "arm", "--runs", "0"], "runs is 0"),
        (["pressure", "arm", "--states", "0"], "states is 0"),
        (["population", "arm", "--states", "1"], "'kde' has states 1, but must have at least 2"),
        (["pressure", "arm", "--metric", "evolvability", "--litter", "0"], "litter is 0"),
        (["pressure", "arm", "--steps", "-1"], "steps is -1"),
        (["pressure", "arm", "--seed", "-1"], "seed is -1"),
        (["pressure", "arm", "--domain-seed", "-1"], "--domain-seed is -1"),
        (["pressure", "arm", "--scale", "inf"], "scale is inf"),
        (["pressure", "arm", "--mutation", "jump"], "mutation is 'jump'"),
        (["pressure", "arm", "--archive-limit", "0"], "--archive-limit is 0"),
        (["pressure", "arm", "--initialisation", "zeros"], "initialisation is 'zeros'"),
        (["pressure", "arm", "--initialisation", "orthogonal"], "arm has no fully connected network"),
        (["pressure", "arm", "--grid", "4"], "arm has 2 axes"),
        (["pressure", "arm", "--grid", "axb"], "--grid is 'axb'"),
        (["pressure", "arm", "--bounds", "1,0,0,1"], "--bounds is '1,0,0,1'"),
        (["pressure", "arm", "--workers", "0"], "workers is 0"),
        (["resume"], "PATH must be given"),
        (["report", "nowhere"], "holds no study"),
        (["resume", "nowhere"], "holds no study"),
    ],
)
def test_bad_input(tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    if words[0] in ("pressure", "metrics", "population"):
        words = [*words, "--out", "study"]
    assert walks(*words) == 2
    shown = capsys.readouterr()
    assert message in shown.err
    assert "Traceback" not in shown.err
    assert shown.out == ""
    assert not (tmp_path / "study" / "records").exists() or words[-3] in ("--workers", "orthogonal")


def test_another_study_in_the_folder(pressure, capsys):
    assert walks("metrics", "arm", *SMALL, "--out", pressure) == 2
    error = capsys.readouterr().err
    assert "differs in kind, conditions" in error
    assert walks("resume", pressure, "--runs", "2") == 2
    assert "3 runs, more than the 2 asked for" in capsys.readouterr().err
