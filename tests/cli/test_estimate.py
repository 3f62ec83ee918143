import io
import json

import pandas as pd
import pytest

import nichechain as nc
from nichechain.cli import main
from nichechain.validation.held_out import compare_estimators


def ask(capsys, *arguments):
    assert main(["estimate", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def test_estimate_is_that_of_the_library(built, capsys):
    content = json.loads(ask(capsys, built, "--format", "json"))
    archive = nc.load(built)
    chain = archive.chain()
    assert content["strength"] == chain.posterior.strength
    weights = [content[f"weight_{name}"] for name in ("destination", "displacement", "uniform")]
    assert weights == chain.posterior.base.weights.tolist()
    births = archive.births()
    inside = births[births["child_niche"] < 64]
    assert content["never_filled"] == 64 - inside["child_niche"].nunique()
    selected = births["parent_niche"].notna() & ~births["lineage"].fillna(False)
    assert content["births_of_parents"] == selected.sum()
    assert content["births_outside"] == (births["child_niche"] == 64).sum()
    shown = ask(capsys, built)
    for text in (
        chain.estimator,
        "never filled",
        "filled, never a parent",
        "strength of the base",
        "births worth one",
    ):
        assert text in " ".join(shown.split()) or text in shown
    frame = pd.read_csv(io.StringIO(ask(capsys, built, "--format", "csv")))
    assert frame["strength"][0] == pytest.approx(content["strength"])
    assert "strength" not in json.loads(ask(capsys, built, "--estimator", "mle", "--format", "json"))
    assert "every birth counts in full" in ask(capsys, built, "--estimator", "dirichlet")


def test_compare_is_that_of_the_library(built, capsys):
    content = json.loads(ask(capsys, built, "--compare", "--folds", 3, "--seed", 2, "--format", "json"))
    expected = compare_estimators(nc.load(built).counts, folds=3, seed=2).to_frame()
    found = pd.DataFrame(content["estimators"])
    pd.testing.assert_frame_equal(found, expected, check_exact=False)
    frame = pd.read_csv(
        io.StringIO(ask(capsys, built, "--compare", "--folds", 3, "--seed", 2, "--format", "csv"))
    )
    pd.testing.assert_frame_equal(frame, expected, check_exact=False)
    shown = ask(capsys, built, "--compare", "--folds", 3)
    assert f"children of {content['elites']} elites" in shown
    assert "mle, unvisited: self" in shown


def test_stability_answers_in_words_and_draws(built, capsys, tmp_path):
    picture = tmp_path / "stability.png"
    options = [built, "--stability", "--repeats", 1, "--min-births", 10]
    shown = ask(capsys, *options, "--out", picture)
    assert picture.stat().st_size > 10_000
    assert "births" in shown.splitlines()[-2]
    content = json.loads(ask(capsys, *options, "--format", "json"))
    assert content["answer"] in " ".join(shown.split())
    assert [part["fraction"] for part in content["parts"]] == [0.1, 0.25, 0.5, 0.75, 0.9]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--compare", "--stability"], "--compare and --stability exclude each other"),
        (["--folds", "5"], "--folds belongs to --compare"),
        (["--compare", "--folds", "1"], "folds is 1"),
        (["--compare", "--repeats", "2"], "--repeats belongs to --stability"),
        (["--thin", "birth"], "--thin belongs to --stability"),
        (["--stability", "--repeats", "0"], "repeats is 0"),
        (["--stability", "--min-births", "100000"], "0 niches have 100000 births"),
        (["--stability", "--out", "a.gif"], "--out is 'a.gif', but must end in one of .png"),
        (["--stability", "--out", "/nowhere/a.png"], "there is no folder /nowhere"),
        (["--seed", "-1"], "--seed is -1"),
        (["--min-births", "-1"], "--min-births is -1"),
    ],
)
def test_bad_options_are_one_sentence(built, capsys, options, said):
    assert main(["estimate", str(built), *options]) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1
