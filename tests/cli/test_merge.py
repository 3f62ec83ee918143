import json

import pytest

import nichechain as nc
from nichechain.cli import main


@pytest.fixture(scope="module")
def pair(built, tmp_path_factory):
    """Another run of the same search, and both as one."""
    root = tmp_path_factory.mktemp("merge")
    options = ["--evaluations", "600", "--grid", "8x8", "--scale", "0.3", "--seed", "6"]
    assert main(["build", "arm", *options, "--out", str(root / "other")]) == 0
    assert main(["merge", str(built), str(root / "other"), "--out", str(root / "both")]) == 0
    return root


def test_merged_archive_opens_everywhere(pair, capsys):
    assert len(nc.load(pair / "both").births()) == 2100
    assert main(["info", str(pair / "both")]) == 0
    shown = capsys.readouterr().out
    assert "2100 (merged)" in shown
    assert "of the first run" in shown
    assert main(["info", str(pair / "both"), "--format", "json"]) == 0
    runs = json.loads(capsys.readouterr().out)["origin"]["runs"]
    assert [(run["births"], run["first_uid"], run["config"]["seed"]) for run in runs] == [
        (1500, 0, 5),
        (600, 1500, 6),
    ]
    assert main(["evolvability", str(pair / "both"), "--top", "2", "--draws", "3"]) == 0


def test_compare_resamples_runs_of_a_merged_archive(built, pair, capsys):
    options = ["--resamples", "3", "--l", "2", "--lineages", "10"]
    assert main(["compare", str(built), str(pair / "both"), *options, "--format", "json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["clusters"][1] == ["runs", 2]
    assert content["clusters"][0][0] == "elites"
    assert [row["figure"] for row in content["rows"]] == ["evolvability", "reach", "coverage"]
    assert main(["compare", str(built), str(pair / "both"), *options]) == 0
    shown = capsys.readouterr().out
    assert "B: resampled over 2 runs" in shown
    assert "reached by 10 lineages" in shown
    assert main(["compare", str(built), str(built), *options, "--format", "csv"]) == 0
    assert capsys.readouterr().out.splitlines()[0].startswith("figure,first,second,difference")


def test_bad_merges(built, pair, capsys):
    build = ["build", "arm", "--out", str(pair / "both"), "--resume", "--evaluations", "3000"]
    for arguments, said in (
        (["merge", str(built), "--out", str(pair / "new")], "1 archive cannot be merged"),
        (["merge", str(built), str(built), "--out", str(pair / "new")], "both have the run of seed 5"),
        (build, "was merged, so no build can go on with it"),
    ):
        assert main(arguments) == 2
        captured = capsys.readouterr()
        assert said in captured.err
        assert captured.err.count("\n") == 1
    assert not (pair / "new").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--l", "0"], "l is 0"),
        (["--resamples", "1"], "resamples is 1"),
        (["--draws", "0"], "draws is 0"),
        (["--seed", "-1"], "--seed is -1"),
        (["--min-births", "100000"], "no niche has 100000 births"),
    ],
)
def test_bad_comparisons(built, capsys, options, said):
    assert main(["compare", str(built), str(built), *options]) == 2
    assert said in capsys.readouterr().err


def test_archives_of_other_niches_are_not_compared(built, capsys):
    assert main(["compare", str(built), "fetch-pick-and-place"]) == 2
    assert "have different niches" in capsys.readouterr().err
