"""Builds in environments of Gymnasium: what their folders say, and what these may have imported."""

from __future__ import annotations

import subprocess
import sys

import numpy as np

import nichechain as nc
from nichechain.cli import main


def test_loading_an_archive_imports_no_descriptor(tmp_path):
    """What meta.json names runs only where it is trusted, and when something is evaluated."""
    (tmp_path / "side_effect.py").write_text(
        "from pathlib import Path\n"
        "Path('imported').touch()\n"
        "def first_two(episode):\n    return episode.observations[-1, :2]\n"
    )
    script = """
import os, sys, numpy as np, nichechain as nc
from pathlib import Path
sys.path.insert(0, '.')
from nichechain import cli
words = ["build", "gym:Swimmer-v5", "--descriptor", "side_effect:first_two", "--bounds=-2,2,-2,2", "--steps",
         "5", "--controller", "mlp:4", "--evaluations", "40", "--initial", "20", "--grid", "4x4"]
words += ["--out", "a"]
if sys.argv[1] == "build":
    assert cli.main(words) == 0
else:
    archive = nc.load("a")
    archive.chain(), archive.births(), archive.elites
    elite = archive.elites
    niche = archive.niches.index(elite.niche[0])
    for untrusted in (lambda: archive.domain, lambda: archive.controller(niche)):
        try:
            untrusted()
        except nc.ArchiveError as error:
            assert "asks to import 'side_effect'" in str(error)
        else:
            raise AssertionError("a module is imported because an archive names it")
    assert cli.main(["build", "gym:Swimmer-v5", "--out", "a", "--resume", "--evaluations", "50"]) == 2
    assert not Path("imported").exists()
    os.environ["NICHECHAIN_TRUSTED_MODULES"] = "side_effect"
    module = archive.domain.controller(elite.genotype[0])
    assert [tuple(p.shape) for p in module.parameters()] == [(4, 8), (4,), (2, 4), (2,)]
    # Not even then, before an episode is evaluated.
    assert not Path("imported").exists()
    again = archive.domain.evaluate(elite.genotype)
    assert (again.behavior == elite.behavior).all()
    assert Path("imported").exists()
"""
    run = [sys.executable, "-c", script]
    subprocess.run([*run, "build"], cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "imported").unlink()
    subprocess.run([*run, "load"], cwd=tmp_path, check=True)


def test_a_build_goes_on_from_its_folder_alone(tmp_path):
    """The command names the environment and the folder; the rest is in the folder."""
    words = ["build", "gym:CartPole-v1", "--initial", "20", "--grid", "5x5"]
    asked = ["--descriptor", "final-observation:0,2", "--bounds=-2.4,2.4,-0.4,0.4", "--controller", "mlp:4"]
    asked += ["--repeats", "2", "--options", "unit=m and rad", "env.sutton_barto_reward=true"]
    assert main([*words, *asked, "--evaluations", "60", "--out", str(tmp_path / "short")]) == 0
    assert (
        main(
            ["build", "gym:CartPole-v1", "--resume", "--evaluations", "90", "--out", str(tmp_path / "short")]
        )
        == 0
    )
    assert main([*words, *asked, "--evaluations", "90", "--out", str(tmp_path / "long")]) == 0
    short, long = nc.load(tmp_path / "short"), nc.load(tmp_path / "long")
    assert short.config == long.config
    assert short.births().equals(long.births())
    assert short.config.domain_options == {
        "bounds": "-2.4,2.4,-0.4,0.4",
        "controller": "mlp:4",
        "descriptor": "final-observation:0,2",
        "env.sutton_barto_reward": True,
        "repeats": 2,
        "unit": "m and rad",
    }
    assert short.config.bounds == ((-2.4, 2.4), (-0.4, 0.4))
    again = short.domain.evaluate(short.elites.genotype)
    np.testing.assert_array_equal(again.behavior, short.elites.behavior)
