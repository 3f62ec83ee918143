import json

import matplotlib.image
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import nichechain as nc
from nichechain.cli import main
from nichechain.core.errors import NichechainError
from nichechain.plots.validation import plot_calibration, plot_reached
from nichechain.validation import ValidationConfig, validate

CONFIG = ValidationConfig(elites=8, lineages=6, l=3, offspring=10, permutations=19, seed=2)
OPTIONS = ["--elites", "8", "--lineages", "6", "--l", "3", "--permutations", "19", "--seed", "2"]


@pytest.fixture(scope="module")
def result(arm):
    with nc.Threads(1) as threads:
        return validate(arm, threads, CONFIG)


def test_every_test_is_reported(result):
    names = [test.name.split(",")[0] for test in result.tests]
    assert names == ["lineage", "homogeneity", "siblings", *["Chapman-Kolmogorov"] * 3]
    values = result.to_json()
    assert values["births"] == 2000
    assert values["convention"] == "definition"
    assert [row["generation"] for row in values["direct"]["summary"]] == [1, 2, 3] * 2
    assert len(values["direct"]["elites"]) == 2 * 8 * 3
    assert values["direct"]["evaluations"] == CONFIG.evaluations == 8 * (6 * 3 + 10)
    # Strict JSON has no NaN.
    json.dumps(values, allow_nan=False)


def test_one_generation_has_no_chapman_kolmogorov_of_lineages(arm):
    config = ValidationConfig(elites=4, lineages=3, l=1, offspring=5, permutations=1)
    with nc.Threads(1) as threads:
        assert len(validate(arm, threads, config).tests) == 4


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"elites": 2}, "elites is 2"),
        ({"lineages": 0}, "lineages is 0"),
        ({"l": 0}, "l is 0"),
        ({"offspring": 0}, "offspring is 0"),
        ({"permutations": 0}, "permutations is 0"),
        ({"seed": -1}, "seed is -1"),
    ],
)
def test_bad_configurations(options, said):
    with pytest.raises(NichechainError, match=said):
        ValidationConfig(**options)


def test_command_writes_what_it_shows(arm, tmp_path, capsys):
    out = tmp_path / "some" / "where"
    assert main(["validate", str(arm.folder), *OPTIONS, "--workers", "1", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    written = json.loads((out / "validation.json").read_text())
    for test in written["tests"]:
        assert test["name"] in shown
        assert f"{test['p_value']:.3f}" in shown
    for row in written["direct"]["summary"]:
        assert f"{row['predicted']:.2f}" in shown
    assert "convention: definition" in shown
    births = pd.read_csv(out / "lineages.csv")
    assert len(births) == 8 * 6 * 3
    first = births[births["generation"] == 1]
    niches = first[first["state"] < 64].groupby("root")["state"].nunique()
    reached = {row["root"]: row["reached"] for row in written["direct"]["elites"] if row["generation"] == 1}
    assert niches.to_dict() == {root: count for root, count in reached.items() if count}
    picture = matplotlib.image.imread(out / "calibration.png")
    assert picture.shape[1] > 2 * picture.shape[0]
    assert (picture[..., :3] < 0.9).any(axis=2).mean() > 0.01


def test_workers_do_not_change_the_report(arm, tmp_path):
    for workers in ("1", "2"):
        main(["validate", str(arm.folder), *OPTIONS, "--workers", workers, "--out", str(tmp_path / workers)])
    one, two = ((tmp_path / workers / "validation.json").read_bytes() for workers in ("1", "2"))
    assert one == two


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--elites", "1"], "elites is 1"),
        (["--l", "0"], "l is 0"),
        (["--permutations", "-3"], "permutations is -3"),
        (["--workers", "0"], "workers is 0"),
    ],
)
def test_bad_options_write_nothing(arm, tmp_path, capsys, options, said):
    out = tmp_path / "out"
    assert main(["validate", str(arm.folder), *options, "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_a_file_is_no_folder(arm, tmp_path, capsys):
    (tmp_path / "out").write_text("")
    assert main(["validate", str(arm.folder), *OPTIONS, "--out", str(tmp_path / "out")]) == 2
    assert "that is a file" in capsys.readouterr().err


def test_calibration_shows_prediction_against_reality(result):
    check = result.direct
    ax = plot_calibration(check, Figure().add_subplot(), generation=2)
    for line, prediction in zip(ax.lines, check.predictions, strict=False):
        np.testing.assert_allclose(line.get_xdata(), prediction.value[:, 1])
        np.testing.assert_allclose(line.get_ydata(), check.reached[:, 1])
    diagonal = ax.lines[-1].get_xydata()
    np.testing.assert_array_equal(diagonal[:, 0], diagonal[:, 1])
    assert ax.get_xlim() == ax.get_ylim()
    with pytest.raises(NichechainError, match="generation is 4"):
        plot_calibration(check, ax, generation=4)


def test_means_over_generations(result):
    ax = plot_reached(result.direct, Figure().add_subplot())
    drawn = {line.get_label(): line.get_ydata() for line in ax.lines}
    for prediction in result.direct.predictions:
        expected = prediction.value.mean(axis=0)
        np.testing.assert_allclose(drawn[f"predicted from the {prediction.start}"], expected)
    real = result.direct.reached.mean(axis=0)
    assert any(np.array_equal(line.get_ydata(), real) for line in ax.lines)
