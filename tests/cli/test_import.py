import json

import numpy as np
import pandas as pd
import pytest

import nichechain as nc
from nichechain.cli import main


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """An archive without births of lineages, which a log cannot tell from others."""
    folder = tmp_path_factory.mktemp("plain") / "arm"
    asked = [
        "--evaluations",
        "1500",
        "--grid",
        "8x8",
        "--scale",
        "0.3",
        "--seed",
        "5",
        "--lineage-share",
        "0",
    ]
    assert main(["build", "arm", *asked, "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def log(built, tmp_path_factory):
    path = tmp_path_factory.mktemp("import") / "log.csv"
    nc.load(built).births().to_csv(path, index=False)
    return path


def imported(log, out, *options):
    return main(["import", str(log), "--grid", "8x8", "--bounds=-1,1,-1,1", "--out", str(out), *options])


def test_imported_archive_opens_without_a_domain(built, log, tmp_path, capsys):
    out = tmp_path / "in"
    assert imported(log, out, "--elite", "parent_uid", "--uid", "uid", "--step", "step", "--run", "run") == 0
    assert "1500, 1400 of them with a parent" in capsys.readouterr().out
    for arguments in (["evolvability", "--top", "3", "--draws", "5"], ["estimate"]):
        command, *options = arguments
        shown = []
        for folder in (built, out):
            assert main([command, str(folder), *options]) == 0
            shown.append(capsys.readouterr().out)
        assert shown[0] == shown[1]
    assert main(["info", str(out)]) == 0
    told = capsys.readouterr().out
    assert "1500 (imported)" in told
    assert "log.csv" in told
    # A log has neither elites nor genotypes.
    assert "0 parameters" not in told
    assert "deepest elite" not in told
    # Nothing is known of how children were made.
    assert "cauchy" not in told
    assert main(["info", str(out), "--format", "json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["niches_filled"] == nc.load(built).filled
    for kind in ("visits", "evolvability", "reachability", "transitions"):
        assert main(["plot", str(out), kind, "--out", str(tmp_path / f"{kind}.png"), "--dpi", "30"]) == 0


def test_without_elites_it_says_so(log, tmp_path, capsys):
    assert (
        imported(log, tmp_path / "in", "--child-behavior", "behavior_x,behavior_y", "--names", "left,up") == 0
    )
    assert "count as unrelated" in capsys.readouterr().out
    assert nc.load(tmp_path / "in").meta.facts.behavior_names == ("left", "up")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--child", "a", "--child-behavior", "x,y"], "--child and --child-behavior exclude each other"),
        (["--parent", "from"], "has no column 'from'"),
        (["--grid", "8"], "grid has 1 axes but bounds have 2"),
        (["--grid", "0x8"], "--grid is '0x8'"),
        (["--grid", "2x2"], "states run from 0 to 4"),
    ],
)
def test_bad_options_are_one_sentence(log, tmp_path, capsys, options, said):
    assert imported(log, tmp_path / "in", *options) == 2
    captured = capsys.readouterr()
    assert said in captured.err
    assert captured.err.count("\n") == 1
    assert not (tmp_path / "in").exists()


@pytest.mark.parametrize("kind", ["npy", "csv", "txt", "parquet"])
def test_niches_around_centroids_of_a_file(log, tmp_path, kind):
    centroids = np.random.default_rng(0).uniform(-1, 1, (12, 2))
    file = tmp_path / f"centroids.{kind}"
    match kind:
        case "npy":
            np.save(file, centroids)
        case "parquet":
            pd.DataFrame(centroids, columns=["x", "y"]).to_parquet(file)
        case "csv":
            pd.DataFrame(centroids, columns=["x", "y"]).to_csv(file, index=False)
        case _:
            np.savetxt(file, centroids)
    behavior = ["--child-behavior", "behavior_x,behavior_y", "--parent-behavior", "behavior_x,behavior_y"]
    command = ["import", str(log), "--niches", str(file), "--bounds=-1,1,-1,1", "--out", str(tmp_path / "in")]
    assert main([*command, *behavior, "--objective", "objective"]) == 0
    archive = nc.load(tmp_path / "in")
    assert archive.niches == nc.CVTNiches(centroids, ((-1, 1), (-1, 1)))
    frame = pd.read_csv(log)
    np.testing.assert_array_equal(archive.births()["objective"], frame["objective"])
    assert main([*command, *behavior]) == 2
    assert main([*command, *behavior, "--force"]) == 0


def test_niches_are_given_once(log, tmp_path, capsys):
    assert imported(log, tmp_path / "in", "--niches", "c.npy") == 2
    assert "either the cells of --grid or around the centroids of --niches" in capsys.readouterr().err
    assert main(["import", str(log), "--bounds=0,1,0,1", "--out", str(tmp_path / "in")]) == 2
    assert "either the cells of --grid" in capsys.readouterr().err


def test_no_such_log(tmp_path, capsys):
    assert imported(tmp_path / "no.csv", tmp_path / "in") == 2
    assert "No such file" in capsys.readouterr().err
    assert imported(__file__, tmp_path / "in") == 2
    assert "neither a .csv, .csv.gz or .parquet file" in capsys.readouterr().err
