"""Several searches from one command: one archive for each seed, as if each had been asked for alone."""

import json
import subprocess
import sys

import pytest

import nichechain as nc
from nichechain.cli import main, parsing

from .test_build import contents


def asked(out, *more):
    options = ["--evaluations", "200", "--grid", "4x4", "--scale", "0.3", "--workers", "1"]
    return ["build", "arm", *options, "--seeds", "0..2", "--out", str(out), *more]


def test_each_is_the_search_of_its_seed(tmp_path, capsys):
    assert main(asked(tmp_path / "arm")) == 0
    shown = capsys.readouterr().out
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["arm-seed0", "arm-seed1", "arm-seed2"]
    alone = ["build", "arm", "--evaluations", "200", "--grid", "4x4", "--scale", "0.3", "--seed", "1"]
    assert main([*alone, "--out", str(tmp_path / "alone")]) == 0
    assert contents(tmp_path / "alone") == contents(tmp_path / "arm-seed1")
    for seed in range(3):
        assert str(tmp_path / f"arm-seed{seed}") in shown
    assert f"nichechain compare '{tmp_path}/arm-seed*'" in shown


def test_where_they_go_by_default(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["build", "arm", "--evaluations", "20", "--initial", "5", "--grid", "2x2", "--seeds", "3,5"]
    assert main(words) == 0
    assert sorted(path.name for path in (tmp_path / "archives").iterdir()) == ["arm-seed3", "arm-seed5"]


def test_what_is_there_is_refused_before_anything_is_built(tmp_path, capsys):
    words = ["build", "arm", "--evaluations", "50", "--grid", "4x4", "--seed", "2"]
    assert main([*words, "--out", str(tmp_path / "arm-seed2")]) == 0
    before = contents(tmp_path / "arm-seed2")
    capsys.readouterr()
    assert main(asked(tmp_path / "arm")) == 2
    assert "arm-seed2 already holds an archive of 50 births" in capsys.readouterr().err
    assert not (tmp_path / "arm-seed0").exists()
    assert contents(tmp_path / "arm-seed2") == before
    assert main(asked(tmp_path / "arm", "--force")) == 0
    assert nc.load(tmp_path / "arm-seed2").meta.births == 200


def test_those_not_begun_take_what_was_asked_of_the_others(tmp_path, capsys):
    assert main([*asked(tmp_path / "arm")[:-4], "--seeds", "1", "--out", str(tmp_path / "arm")]) == 0
    resumed = ["build", "arm", "--seeds", "0..2", "--out", str(tmp_path / "arm"), "--resume"]
    assert main(resumed) == 0
    assert main(asked(tmp_path / "straight")) == 0
    for seed in range(3):
        assert contents(tmp_path / f"arm-seed{seed}") == contents(tmp_path / f"straight-seed{seed}")
    assert main([*resumed, "--evaluations", "300"]) == 0
    assert [nc.load(tmp_path / f"arm-seed{seed}").meta.births for seed in range(3)] == [300] * 3
    capsys.readouterr()
    assert main([*resumed, "--scale", "0.2"]) == 2
    assert "arm-seed0 was begun with scale = 0.3" in capsys.readouterr().err


def test_one_of_another_search_is_refused(tmp_path, capsys):
    for seed, scale in (("0", "0.3"), ("2", "0.5")):
        words = ["build", "arm", "--evaluations", "50", "--grid", "4x4", "--seed", seed, "--scale", scale]
        assert main([*words, "--out", str(tmp_path / f"arm-seed{seed}")]) == 0
    capsys.readouterr()
    assert main(["build", "arm", "--seeds", "0..2", "--out", str(tmp_path / "arm"), "--resume"]) == 2
    assert "arm-seed2 was begun with scale = 0.5" in capsys.readouterr().err
    assert not (tmp_path / "arm-seed1").exists()


def test_interrupted_between(tmp_path):
    """The command that goes on is said whole, and goes on."""
    script = (
        "import sys, nichechain.cli as cli\n"
        "from nichechain.archive import building\n"
        "real = building.build\n"
        "def build(config, *more, **named):\n"
        "    if config.seed == 1: raise KeyboardInterrupt\n"
        "    return real(config, *more, **named)\n"
        "building.build = build\n"
        f"sys.exit(cli.main({asked(tmp_path / 'arm', '--force')!r}))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert "Stopped at seed 1, 2 of 3; 0 of 200 births are kept" in done.stdout
    again = done.stdout.splitlines()[-1].split()
    assert again == ["nichechain", *asked(tmp_path / "arm", "--resume")]
    assert main(again[1:]) == 0
    assert main(asked(tmp_path / "straight")) == 0
    for seed in range(3):
        assert contents(tmp_path / f"arm-seed{seed}") == contents(tmp_path / f"straight-seed{seed}")


def test_seed_and_seeds_exclude_each_other(tmp_path, capsys):
    assert main(asked(tmp_path / "arm", "--seed", "3")) == 2
    assert "--seed 3 and --seeds 0..2 exclude each other" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "found"), [("0..3", [0, 1, 2, 3]), ("7", [7]), ("5, 1..2", [5, 1, 2]), ("4..4", [4])]
)
def test_seeds_of_a_text(text, found):
    assert parsing.seeds(text) == found


@pytest.mark.parametrize("text", ["", "3..1", "a", "-1", "0..", "1,1", "0..3,2", "0..10000", "1.5"])
def test_what_are_no_seeds(text):
    with pytest.raises(nc.NichechainError, match="--seeds is"):
        parsing.seeds(text)


def test_meta_says_the_seed(tmp_path):
    assert main(asked(tmp_path / "arm")) == 0
    metas = [json.loads((tmp_path / f"arm-seed{seed}/meta.json").read_text()) for seed in range(3)]
    assert [meta["config"]["seed"] for meta in metas] == [0, 1, 2]
