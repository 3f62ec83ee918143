import io
import json

import pandas as pd
import pytest

import nichechain as nc
from nichechain.cli import main


def ask(capsys, *arguments):
    assert main(["evolvability", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def as_json(capsys, *arguments):
    return json.loads(ask(capsys, *arguments, "--format", "json"))


def test_top_is_the_ranking_of_the_library(built, capsys):
    rows = as_json(capsys, built, "--top", 3, "--l", 2, "--lineages", 10, "--draws", 7, "--seed", 4)
    chain = nc.load(built).chain()
    scores = nc.niche_evolvability(chain, l=2, lineages=10, draws=7, seed=4)
    expected = scores.ranking(chain).head(3)
    assert [row["niche"] for row in rows] == expected["niche"].tolist()
    assert [row["value"] for row in rows] == pytest.approx(expected["value"].tolist())
    assert all(row["births"] >= 20 for row in rows)
    assert {row["convention"] for row in rows} == {"definition"}
    assert rows[0]["estimator"] == chain.estimator


def test_niche_by_index_or_number(built, capsys):
    state = int(nc.load(built).elites.niche[5])
    index = f"{state // 8},{state % 8}"
    options = [built, "--estimator", "mle", "--unvisited", "self", "--l", 3, "--lineages", 9]
    (row,) = as_json(capsys, *options, "--niche", index)
    assert [row] == as_json(capsys, *options, "--niche", state)
    chain = nc.load(built).chain("mle", unvisited="self")
    exact = nc.l_evolvability(chain, niche=state, l=3, lineages=9)
    assert row["value"] == pytest.approx(exact.value)
    assert row["index"] == index
    (sampled,) = as_json(capsys, *options, "--niche", index, "--method", "monte-carlo", "--repeats", 4000)
    assert abs(sampled["value"] - exact.value) < 4 * sampled["standard_error"]
    (literal,) = as_json(capsys, *options, "--niche", index, "--convention", "procedure")
    assert literal["value"] > row["value"]


def test_elite_evaluates_its_own_offspring(built, capsys):
    archive = nc.load(built)
    state = int(archive.elites.niche[0])
    (row,) = as_json(capsys, built, "--elite", state, "--offspring", 12, "--draws", 5)
    expected = nc.genotype_evolvability(archive, archive.elite(state), offspring=12, draws=5)
    assert row["value"] == pytest.approx(expected.value)
    assert row["offspring"] == 12
    assert row["root"] == "elite"


def test_csv_is_the_same_table(built, capsys):
    frame = pd.read_csv(io.StringIO(ask(capsys, built, "--top", 2, "--format", "csv")))
    rows = as_json(capsys, built, "--top", 2)
    assert frame["value"].tolist() == pytest.approx([row["value"] for row in rows])


def test_table_stands_with_what_it_rests_on(built, capsys):
    shown = ask(capsys, built, "--top", 2)
    chain = nc.load(built).chain()
    for text in (chain.estimator, "convention: definition", "method: exact", "births behind the row"):
        assert text in shown


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--l", "0"], "l is 0"),
        (["--lineages", "0"], "lineages is 0"),
        (["--niche", "8,0"], "niche is 8,0, but this grid runs from 0,0 to 7,7"),
        (["--niche", "65"], "niche is 65, but the grid has niches 0 to 63"),
        (["--niche", "a,b"], "--niche is 'a,b'"),
        (["--niche", "1,2,3"], "2 indices"),
        (["--niche", "1,2", "--top", "3"], "--niche and --top exclude each other"),
        (["--elite", "0,0"], "niche 0,0 is empty"),
        (["--top", "0"], "--top is 0"),
        (["--draws", "0"], "--draws is 0"),
        (["--offspring", "0"], "--offspring is 0"),
        (["--seed", "-1"], "--seed is -1"),
        (["--min-births", "-1"], "--min-births is -1"),
        (["--min-births", "100000"], "no niche has 100000 births"),
        (["--unvisited", "base"], "unvisited belongs to mle"),
    ],
)
def test_bad_options_are_one_sentence(built, capsys, options, said):
    assert main(["evolvability", str(built), *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert said in captured.err
    assert captured.err.count("\n") == 1
