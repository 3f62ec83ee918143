"""Operators and selection on the command line: what is asked for is what is built, and is kept."""

import numpy as np
import pytest

import nichechain as nc
from nichechain.cli import main

from .conftest import build


@pytest.mark.parametrize(
    ("options", "fields"),
    [
        (
            ["--mutation", "student-t", "--df", "5", "--step-bound", "per-coordinate:0.4"],
            {"mutation": "student-t", "df": 5.0, "step_bound": ("per-coordinate", 0.4)},
        ),
        (
            ["--self-adaptive", "--step-bound", "rescaled:2", "--selection", "curiosity"],
            {"self_adaptive": True, "step_bound": ("rescaled", 2.0), "selection": "curiosity"},
        ),
    ],
)
def test_options_are_built_kept_and_resumed(options, fields, tmp_path, capsys):
    folder, long = tmp_path / "arm", tmp_path / "long"
    assert main(build(folder, 150, *options)) == 0
    config = nc.load(folder).config
    assert {name: getattr(config, name) for name in fields} == fields
    # Options that are not said again stay as they were.
    assert main(["build", "arm", "--out", str(folder), "--resume", "--evaluations", "300"]) == 0
    assert main(build(long, 300, *options)) == 0
    assert nc.load(folder).births().equals(nc.load(long).births())
    capsys.readouterr()
    assert main(build(folder, 400, "--resume", "--step-bound", "rescaled:9")) == 2
    assert "was begun with" in capsys.readouterr().err


def test_births_stay_in_their_parents_neighbourhood(tmp_path):
    folder = tmp_path / "arm"
    assert main(build(folder, 400, "--step-bound", "per-coordinate:0.05")) == 0
    elites = nc.load(folder).elites
    # Angles begin within 0.1 rad and move by no more than the bound in a generation.
    reach = 0.1 + 0.05 * elites.depth + 1e-6
    assert (np.abs(elites.genotype).max(axis=1) <= reach).all()
    assert elites.depth.max() >= 3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--layer-scales", "1,0.5"], "arm has no layers"),
        (["--layer-scales", "1;2"], "--layer-scales is '1;2'"),
        (["--step-bound", "2"], "--step-bound is '2', but must be per-coordinate:SIZE or rescaled:SIZE"),
        (["--df", "4"], "only student-t has"),
        (
            ["--mutation", "uniform-ball", "--step-bound", "per-coordinate:1"],
            "cannot be bounded per coordinate",
        ),
    ],
)
def test_what_does_not_fit_is_one_sentence(options, message, tmp_path, capsys):
    assert main(build(tmp_path / "arm", 100, *options)) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "arm").exists()


def test_scales_of_layers_are_those_of_the_controller(tmp_path, capsys):
    folder = tmp_path / "fetch"
    arguments = ["build", "fetch", "--evaluations", "4", "--initial", "2", "--batch", "2", "--grid", "2x2"]
    assert main([*arguments, "--layer-scales", "1,2", "--out", str(folder)]) == 2
    assert "layer scales are 1, 2, but there are 3 layers (800, 1024, 128 weights)" in capsys.readouterr().err
