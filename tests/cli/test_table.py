import io
import json

import pandas as pd

import nichechain as nc
from nichechain.cli import main
from nichechain.landscape import niche_table

ASKED = ["--l", "2", "--lineages", "10", "--draws", "3"]


def test_all_niches_as_csv(built, capsys):
    assert main(["table", str(built), *ASKED, "--by", "niche", "--format", "csv"]) == 0
    read = pd.read_csv(io.StringIO(capsys.readouterr().out))
    expected = niche_table(nc.load(built), l=2, lineages=10, draws=3)
    assert read["niche"].tolist() == expected["niche"].tolist()
    assert list(read) == list(expected)
    assert read["evolvability"].sum() == expected["evolvability"].sum()


def test_the_largest_first(built, capsys):
    assert main(["table", str(built), *ASKED, "--by", "wormholes-in", "--top", "3", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert len(rows) == 3
    assert rows[0]["wormholes_in"] >= rows[1]["wormholes_in"] >= rows[2]["wormholes_in"]


def test_a_table_for_a_terminal_says_what_it_left_out(built, capsys):
    assert main(["table", str(built), *ASKED, "--top", "2"]) == 0
    shown = capsys.readouterr().out
    known = len(niche_table(nc.load(built), l=2, lineages=10, draws=3))
    assert f"2 of {known} niches" in shown
    assert "wormholes" in shown


def test_niches_of_few_births_are_not_ranked(built, capsys):
    frame = niche_table(nc.load(built), l=2, lineages=10, draws=3)
    few = frame["births"] < 20
    assert 0 < few.sum() < len(frame)
    for by in ("evolvability", "entered"):
        assert main(["table", str(built), *ASKED, "--by", by, "--format", "csv"]) == 0
        read = pd.read_csv(io.StringIO(capsys.readouterr().out))
        ranked = read.head(len(frame) - few.sum())
        assert (ranked["births"] >= 20).all()
        assert ranked[by].is_monotonic_decreasing
        assert read["niche"].tail(few.sum()).tolist() == frame.loc[few, "niche"].tolist()
    assert main(["table", str(built), *ASKED, "--by", "evolvability", "--min-births", "0", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert rows[0]["niche"] == frame.loc[frame["evolvability"].idxmax(), "niche"]


def test_a_table_says_how_many_are_not_ranked(built, capsys):
    few = int((nc.load(built).births().value_counts("parent_niche") < 1000).sum())
    assert main(["table", str(built), *ASKED, "--min-births", "1000"]) == 0
    assert "niches with fewer than 1000 births of parents there are not ranked" in capsys.readouterr().out
    assert few > 1
