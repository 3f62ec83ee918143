import json
import shutil

import pytest

import nichechain as nc
from nichechain.cli import main


def test_births_are_added_and_told_of(built, tmp_path, capsys):
    folder = tmp_path / "arm"
    shutil.copytree(built, folder)
    lineages = int(nc.load(folder).births()["lineage"].sum())
    assert lineages > 0
    assert main(["calibrate", str(folder), "--rollouts", "40", "--workers", "1"]) == 0
    said = capsys.readouterr().out
    # Four lineages of ten births each, whose first are children of elites.
    assert "1540, 40 of them new" in said
    assert str(lineages + 36) in said
    assert main(["info", str(folder), "--format", "json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["births_of_lineages"] == lineages + 36
    assert content["births_of_calibrations"] == 40
    main(["info", str(folder)])
    assert "1540 (complete, 40 of them added by calibrate)" in capsys.readouterr().out
    assert main(["build", "arm", "--out", str(folder), "--resume"]) == 2
    assert "no build can go on" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["nowhere"], "--rollouts is missing: give the number of births to add"),
        (["fetch-pick-and-place", "--rollouts", "10"], "ships with nichechain"),
    ],
)
def test_what_cannot_be_calibrated(given, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["calibrate", *given]) == 2
    assert said in capsys.readouterr().err
