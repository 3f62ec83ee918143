"""--steps: births of a window of the search, wherever births are read."""

import base64
import io
import json
import re

import numpy as np
import pandas as pd
import pytest

import nichechain as nc
from nichechain.cli import main
from nichechain.evolvability.record import recorded_children


def test_an_archive_during_some_steps(built):
    archive = nc.load(built)
    early = archive.during((0, 10))
    births = archive.births()
    inside = births[births["step"] < 10]
    assert early.births()["uid"].tolist() == inside["uid"].tolist()
    assert (early.counts.matrix != archive.counts_of(steps=(0, 10)).matrix).nnz == 0
    assert early.chain().births.sum() == early.counts.births.sum() < archive.counts.births.sum()
    assert len(early.elites) == len(archive.elites)


def test_two_windows_have_all_births(built, capsys):
    found = []
    for steps in ("0:10", "10:", ":"):
        assert main(["estimate", str(built), "--steps", steps, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["births_of_parents"])
    assert 0 < found[0] < found[1]
    assert found[0] + found[1] == found[2]


def test_a_table_of_a_window(built, capsys):
    asked = ["--l", "1", "--lineages", "2", "--draws", "2", "--format", "csv"]
    assert main(["table", str(built), "--steps", "0:5", *asked]) == 0
    read = pd.read_csv(io.StringIO(capsys.readouterr().out))
    births = nc.load(built).births()
    assert read["visits"].sum() == ((births["step"] < 5) & (births["child_niche"] < 64)).sum()


@pytest.mark.parametrize("steps", ["3:1", "three", "5", "9999:"])
def test_no_window(built, steps, capsys):
    assert main(["evolvability", str(built), "--steps", steps]) == 2
    assert f"--steps is {steps!r}" in capsys.readouterr().err


def test_a_picture_of_a_window(built, tmp_path):
    out = tmp_path / "visits.png"
    assert main(["plot", str(built), "visits", "--steps", "0:5", "--out", str(out)]) == 0
    assert out.stat().st_size > 0


def test_a_page_of_a_window(built, tmp_path):
    out = tmp_path / "page.html"
    asked = ["explore", str(built), "--steps", "2:9", "--draws", "2", "--out", str(out)]
    assert main(asked) == 0
    data = json.loads(re.search(r'id="data">(.*?)</script>', out.read_text(), re.DOTALL)[1])
    births = nc.load(built).births()
    seen = births[births["step"].between(2, 8)]
    assert (data["births"], data["birthsSeen"], data["steps"]) == (1500, len(seen), [2, 9])
    assert data["stages"][-1] == len(seen)
    # Elites were born at any step, and so were their ancestors.
    holders = np.frombuffer(base64.b64decode(data["eliteBirth"]), "<i4")
    assert (holders >= 0).sum() == nc.load(built).filled


def test_grids_of_a_window(built, capsys):
    found = []
    for steps in ("0:10", "10:", ":"):
        asked = ["sweep", str(built), "--steps", steps, "--sizes", "3", "--draws", "2", "--behavior", "0,0"]
        assert main([*asked, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["births"])
    assert found[0] > 0
    assert found[0] + found[1] == found[2] == 1500


def test_the_record_of_an_elite_in_a_window(built):
    archive = nc.load(built)
    uids = archive.elites.uid
    whole, early = (recorded_children(each, uids).sum() for each in (archive, archive.during((0, 8))))
    births = archive.births()
    of_elites = births["parent_uid"].isin(uids)
    assert whole == of_elites.sum()
    assert early == (of_elites & (births["step"] < 8)).sum() < whole
