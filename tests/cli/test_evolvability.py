import io
import json
from dataclasses import replace

import pandas as pd
import pytest

import nichechain as nc
from nichechain import evolvability
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


def test_an_elite_begins_with_its_record_and_fresh_offspring_if_asked(built, capsys):
    archive = nc.load(built)
    births = archive.births()
    by_elite = births["parent_uid"].value_counts()
    elite = next(e for e in map(archive.elite, archive.elites.niche.tolist()) if by_elite.get(e.uid, 0) > 3)
    options = [built, "--elite", elite.state, "--draws", 5]
    (row,) = as_json(capsys, *options)
    assert row["value"] == pytest.approx(nc.genotype_evolvability(archive, elite, draws=5).value)
    assert (row["recorded"], row["offspring"], row["root"]) == (by_elite[elite.uid], 0, "elite")
    assert f"{row['recorded']} recorded children" in ask(capsys, *options)
    (row,) = as_json(capsys, *options, "--offspring", 12)
    expected = nc.genotype_evolvability(archive, elite, offspring=12, draws=5)
    assert row["value"] == pytest.approx(expected.value)
    assert (row["recorded"], row["offspring"]) == (by_elite[elite.uid], 12)
    assert "recorded children and of 12 offspring evaluated now" in ask(capsys, *options, "--offspring", 12)
    (row,) = as_json(capsys, *options, "--offspring", 12, "--fresh-only")
    assert (row["recorded"], row["offspring"]) == (0, 12)


def test_meta_evolvability_is_that_of_the_library(built, capsys):
    archive = nc.load(built)
    elite = archive.elite(int(archive.elites.niche[3]))
    options = [built, "--elite", elite.state, "--meta", 6, "--seed", 2]
    (row,) = as_json(capsys, *options, "--offspring", 4)
    expected = evolvability.meta_evolvability(archive, elite, children=6, offspring=4, seed=2)
    for name in ("value", "low", "high", "own", "lineages", "offspring", "failed"):
        assert row[name] == pytest.approx(getattr(expected, name))
    assert row["children"] == 6
    shown = ask(capsys, *options)
    assert "niches that 6 offspring of a child reach, mean over 6 children of the elite" in shown
    assert "value" in ask(capsys, *options, "--format", "csv")


def test_an_elite_without_recorded_children_says_so(built, capsys):
    archive = nc.load(built)
    parents = set(archive.births()["parent_uid"].dropna())
    elites = map(archive.elite, archive.elites.niche[archive.elites.niche < 64].tolist())
    childless = next(elite for elite in elites if elite.uid not in parents)
    options = [built, "--l", 2, "--draws", 5]
    assert "no children are recorded of this elite" in ask(capsys, *options, "--elite", childless.state)
    (row,) = as_json(capsys, *options, "--elite", childless.state)
    (niche,) = as_json(capsys, *options, "--niche", childless.state)
    assert row["value"] == pytest.approx(niche["value"])


def test_elites_are_ranked_as_by_the_library(built, capsys):
    options = [built, "--rank", "elites", "--l", 2, "--draws", 5, "--min-births", 0]
    rows = as_json(capsys, *options, "--top", 4)
    expected = nc.elite_evolvability(nc.load(built), l=2, draws=5).head(4)
    assert [row["niche"] for row in rows] == expected["niche"].tolist()
    assert [row["value"] for row in rows] == pytest.approx(expected["value"].tolist())
    assert {row["root"] for row in rows} == {"elite"}
    shown = ask(capsys, *options, "--top", 64)
    assert "without any begin as their niche does" in shown
    assert "children" in shown


def test_a_level_that_drifts_is_said_beside_the_numbers(built, capsys, monkeypatch):
    from nichechain.validation import drift

    found = drift.LevelDrift(20.0, 30.0, 5.0, 15.0, (700, 700), 40, 5, 100)
    monkeypatch.setattr(drift, "level_drift", lambda *_, **__: found)
    assert found.answer in ask(capsys, built, "--top", 2)
    monkeypatch.setattr(drift, "level_drift", lambda *_, **__: replace(found, low=-1.0))
    assert "level" not in ask(capsys, built, "--top", 2)


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
        (["--elite", "4,4", "--offspring", "-1"], "--offspring is -1"),
        (["--offspring", "3"], "--offspring belongs to --elite"),
        (["--fresh-only"], "--fresh-only belongs to --elite"),
        (["--elite", "4,4", "--fresh-only"], "--fresh-only needs offspring"),
        (["--rank", "elites", "--elite", "4,4"], "--rank and --elite exclude each other"),
        (["--rank", "elites", "--method", "monte-carlo"], "elites are ranked in closed form"),
        (["--rank", "elites", "--uncertainty", "prior"], "--rank asks for elites"),
        (["--meta", "5"], "--meta belongs to --elite"),
        (["--elite", "4,4", "--meta", "1"], "--meta is 1"),
        (["--elite", "4,4", "--meta", "5", "--offspring", "0"], "--offspring is 0"),
        (["--elite", "4,4", "--meta", "5", "--l", "3"], "--l is 3, but belongs to what a chain foretells"),
        (["--elite", "4,4", "--meta", "5", "--fresh-only"], "--fresh-only and --meta exclude each other"),
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
