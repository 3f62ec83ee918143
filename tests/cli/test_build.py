import hashlib
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import nichechain as nc
from nichechain.cli import main

from .conftest import build


def contents(folder):
    """Every file of an archive with its digest; the lock is not content."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file() and path.name != ".lock"
    }


def test_build_reports_what_came_of_it(tmp_path, capsys):
    folder = tmp_path / "arm"
    assert main(build(folder, 600)) == 0
    shown = capsys.readouterr().out
    archive = nc.load(folder)
    assert f"{archive.filled} of 64" in shown
    assert f"{archive.counts.rows_observed} of 64" in shown
    assert "600, 0 of them outside" in shown
    for line in ("nichechain evolvability", "nichechain plot", "nichechain info"):
        assert f"{line} {folder}" in shown
    scores = nc.niche_evolvability(archive.chain())
    best = scores.ranking(archive.chain()).iloc[0]
    assert f"{best['value']:.1f}" in shown


def test_what_comes_next_runs_where_births_are_few(tmp_path, capsys):
    folder = tmp_path / "arm"
    assert main(build(folder, 120)) == 0
    shown = capsys.readouterr().out
    assert "too few to rank" in shown
    (line,) = [line for line in shown.splitlines() if "nichechain evolvability" in line]
    assert main(line.split()[1:]) == 0


def test_an_archive_is_not_overwritten_unless_asked(tmp_path, capsys):
    folder = tmp_path / "arm"
    main(build(folder, 200))
    before = contents(folder)
    capsys.readouterr()
    assert main(build(folder, 300)) == 2
    error = capsys.readouterr().err
    assert "already holds an archive of 200 births" in error
    assert "--resume" in error
    assert "--force" in error
    assert contents(folder) == before
    assert main(build(folder, 300, "--force")) == 0
    assert nc.load(folder).meta.births == 300


def test_resume_extends_to_the_bits_of_one_long_build(tmp_path):
    short, long = tmp_path / "short", tmp_path / "long"
    main(build(short, 300))
    # Options that are not said again stay as they were.
    assert main(["build", "arm", "--out", str(short), "--resume", "--evaluations", "700"]) == 0
    main(build(long, 700, "--workers", "1"))
    assert contents(short) == contents(long)


def test_resume_refuses_another_configuration(tmp_path, capsys):
    folder = tmp_path / "arm"
    main(build(folder, 200))
    before = contents(folder)
    assert main(build(folder, 400, "--resume", "--mutation", "gaussian")) == 2
    assert "mutation = cauchy" in capsys.readouterr().err
    assert main(build(folder, 100, "--resume")) == 2
    assert "200 births already" in capsys.readouterr().err
    assert contents(folder) == before


def test_resume_without_an_archive_begins_one_and_says_so(tmp_path, capsys):
    folder = tmp_path / "arm"
    said = "arm holds no archive to go on with: one is begun."
    assert main(build(folder, 200, "--resume")) == 0
    assert said in " ".join(capsys.readouterr().out.split())
    assert nc.load(folder).meta.births == 200
    assert main(build(folder, 300, "--resume")) == 0
    assert said not in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--grid", "20"], "2 axes of behavior"),
        (["--grid", "20y20"], "'20y20'"),
        (["--grid", "0x20"], "'0x20'"),
        (["--grid", "-3x4"], "'-3x4'"),
        (["--bounds", "0,1,1"], "'0,1,1'"),
        (["--bounds", "1,0,0,1"], "'1,0,0,1'"),
        (["--bounds", "0,nan,0,1"], "'0,nan,0,1'"),
        (["--bounds", "0,1"], "'0,1'"),
        (["--evaluations", "0"], "evaluations is 0"),
        (["--initial", "0"], "initial is 0"),
        (["--batch", "-1"], "batch is -1"),
        (["--scale", "0"], "scale is 0"),
        (["--scale", "nan"], "scale is nan"),
        (["--seed", "-1"], "seed is -1"),
        (["--workers", "0"], "workers is 0"),
        (["--resume", "--force"], "exclude each other"),
    ],
)
def test_bad_options_are_one_sentence_and_write_nothing(tmp_path, capsys, options, said):
    folder = tmp_path / "arm"
    arguments = ["build", "arm", "--out", str(folder), *options]
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("nichechain: error: ")
    assert said in error
    assert error.count("\n") == 1
    assert not folder.exists()


@pytest.mark.parametrize(
    "options", [["--evaluations", "many"], ["--replacement", "worst"], ["--no-such-option"]]
)
def test_malformed_options_exit_with_status_2(tmp_path, options, capsys):
    assert main(["build", "arm", "--out", str(tmp_path / "arm"), *options]) == 2
    assert capsys.readouterr().err.startswith("nichechain: error: ")
    assert not (tmp_path / "arm").exists()


def test_unknown_domain(tmp_path, capsys):
    assert main(["build", "walker", "--out", str(tmp_path / "w")]) == 2
    assert "domain is 'walker', but must be one of arm, " in capsys.readouterr().err


def test_interrupt_keeps_what_is_done_and_says_how_to_go_on(tmp_path):
    folder = tmp_path / "arm"
    script = (
        "import sys, nichechain.cli as cli; from nichechain.archive import filling as building\n"
        "building.CHECKPOINT_SECONDS = 0.2\n"
        f"sys.exit(cli.main({build(folder, 100_000)!r}))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    deadline = time.monotonic() + 300
    while not (folder / "meta.json").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGINT)
    shown, _ = process.communicate(timeout=120)
    assert process.returncode == 130
    assert f"nichechain build arm --out {folder} --resume" in shown
    kept = nc.load(folder).meta
    assert 0 < kept.births < 100_000
    assert not kept.complete
    assert (
        main(["build", "arm", "--out", str(folder), "--resume", "--evaluations", str(kept.births + 50)]) == 0
    )
    straight = tmp_path / "straight"
    main(build(straight, kept.births + 50))
    assert contents(folder) == contents(straight)


def test_meta_says_what_made_it(built):
    meta = json.loads((built / "meta.json").read_text())
    assert meta["config"]["domain"] == "arm"
    assert meta["versions"]["numpy"] == np.__version__
    assert meta["versions"]["nichechain"] == nc.__version__


def test_a_ranking_that_would_take_long_is_left_to_its_command(tmp_path, capsys, monkeypatch):
    from nichechain.cli import built

    monkeypatch.setattr(built, "_FIRST_LOOK", 0.0)
    words = ["build", "arm", "--evaluations", "300", "--grid", "3x3", "--workers", "1"]
    assert main([*words, "--out", str(tmp_path / "a")]) == 0
    said = capsys.readouterr().out
    assert "evolvability ranks them" in said
    assert "Top niches" not in said


def test_a_steered_build_says_until_when_parents_are_uniform(tmp_path, capsys):
    assert main(build(tmp_path / "steered", 300, "--selection", "reach", "--batch", "64")) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "by reach; uniformly up to birth 164, with no child to learn from" in shown
    assert main(build(tmp_path / "plain", 200)) == 0
    assert "uniformly" not in capsys.readouterr().out
