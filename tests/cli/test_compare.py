"""Groups of archives against groups: patterns, names between commas, and what they have in common."""

import json

import pytest

from nichechain.cli import main

from .conftest import build


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two runs of each of two scales, and one on other niches."""
    folder = tmp_path_factory.mktemp("runs")
    for name, scale in (("near", "0.1"), ("far", "0.5")):
        for seed in ("0", "1"):
            asked = build(folder / f"{name}-{seed}", 400, "--scale", scale, "--seed", seed)
            assert main(asked) == 0
    assert main(build(folder / "other-0", 200, "--grid", "4x4")) == 0
    return folder


def compared(capsys, first, second, *options):
    few = ("--resamples", "2", "--draws", "1", "--l", "1", "--min-births", "1", "--json")
    assert main(["compare", str(first), str(second), *few, *options]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_pattern_is_a_group_of_runs(runs, capsys):
    found = compared(capsys, runs / "near-*", runs / "far-*")
    assert found["clusters"] == [["runs", 2], ["runs", 2]]
    assert found["archives"] == [[str(runs / f"{name}-{seed}") for seed in "01"] for name in ("near", "far")]
    named = compared(capsys, f"{runs / 'near-0'},{runs / 'near-1'}", runs / "far-?")
    assert named == found


def test_one_archive_against_a_group(runs, capsys):
    found = compared(capsys, runs / "near-0", runs / "far-*")
    assert [kind for kind, _ in found["clusters"]] == ["elites", "runs"]


def test_a_window_of_steps(runs, capsys):
    found = compared(capsys, runs / "near-*", runs / "far-*", "--steps", "0:3")
    # The hundred initial births, and two steps of 64.
    assert found["recorded"] == [2 * 228, 2 * 228]


def test_archives_of_a_group_that_differ(runs, capsys):
    words = [f"{runs / 'near-0'},{runs / 'far-1'}", str(runs / "far-0"), "--resamples", "2", "--draws", "1"]
    assert main(["compare", *words, "--l", "1", "--min-births", "1"]) == 0
    assert "The 2 archives of A differ in scale" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["{}/near-*", "{}/nowhere-*"], "matches no archive"),
        (["{}/near-*", "{}/*"], "have different niches"),
        (["{}/near-0,{}/nowhere", "{}/far-0"], "is no archive"),
        (["{}/near-0", "{}/near-1", "{}/far-0"], "there are 3 archives, but must be two sides"),
    ],
)
def test_what_is_no_group(runs, words, said, capsys):
    assert main(["compare", *(word.format(runs, runs) for word in words)]) == 2
    assert said in capsys.readouterr().err


def test_a_run_counts_once(runs, tmp_path, capsys):
    (tmp_path / "copy").symlink_to(runs / "near-0")
    found = compared(capsys, f"{runs / 'near-0'},{tmp_path / 'copy'}", runs / "far-0")
    assert found["archives"][0] == [str(runs / "near-0")]
    again = tmp_path / "again"
    assert main(build(again, 300, "--scale", "0.1", "--seed", "0")) == 0
    capsys.readouterr()
    assert main(["compare", f"{runs / 'near-0'},{again}", str(runs / "far-0")]) == 2
    assert "both have the run of seed 0" in capsys.readouterr().err
