import json
import shutil

import nichechain as nc
from nichechain.archive.archive import shipped
from nichechain.cli import main


def test_own_archives_and_those_that_ship(built, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(built, tmp_path / "archives" / "mine")
    (tmp_path / "archives" / "broken").mkdir()
    (tmp_path / "archives" / "broken" / "meta.json").write_text("{}")
    (tmp_path / "archives" / "something else").mkdir()
    assert main(["list", "--json"]) == 0
    rows = {row["archive"]: row for row in json.loads(capsys.readouterr().out)}
    assert set(rows) == {*shipped(), "archives/mine", "archives/broken"}
    mine = rows["archives/mine"]
    assert (mine["births"], mine["filled"], mine["niches"]) == (1500, nc.load(built).filled, 64)
    assert "meta.json is damaged" in rows["archives/broken"]["error"]
    assert main(["list"]) == 0
    assert "archives/mine" in capsys.readouterr().out


def test_another_folder(built, capsys):
    assert main(["list", str(built.parent), "--format", "csv"]) == 0
    assert str(built) in capsys.readouterr().out


def test_no_folder_of_archives_is_no_error(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["list"]) == 0
    assert main(["list", "nowhere"]) == 2
    assert "there is no such folder" in capsys.readouterr().err
