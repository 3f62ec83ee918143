import json

import nichechain as nc
from nichechain.cli import main


def test_info_shows_content_configuration_and_versions(built, capsys):
    assert main(["info", str(built)]) == 0
    shown = capsys.readouterr().out
    archive = nc.load(built)
    for text in ("1500 (complete)", f"{archive.filled} of 64", "8 by 8", "cauchy", "mujoco", "10 parameters"):
        assert text in shown


def test_info_as_json_agrees_with_the_archive(built, capsys):
    assert main(["info", str(built), "--format", "json"]) == 0
    content = json.loads(capsys.readouterr().out)
    archive = nc.load(built)
    births = archive.births()
    assert content["births"] == len(births) == 1500
    assert content["niches_filled"] == births["child_niche"][births["child_niche"] < 64].nunique()
    assert content["rows_of_T_observed"] == births["parent_niche"][births["parent_niche"] < 64].nunique()
    assert content["niches_filled"] + content["niches_never_filled"] == 64
    assert content["deepest_elite"] == archive.elites.depth.max()
    assert content["configuration"]["scale"] == 0.3


def test_a_folder_that_is_no_archive(tmp_path, capsys):
    assert main(["info", str(tmp_path)]) == 2
    assert f"{tmp_path} is no archive: it has no meta.json" in capsys.readouterr().err
    assert main(["info", str(tmp_path / "nowhere")]) == 2
    assert "there is no such folder" in capsys.readouterr().err
    (tmp_path / "meta.json").write_text("{}")
    assert main(["info", str(tmp_path)]) == 2
    assert "meta.json is damaged" in capsys.readouterr().err
