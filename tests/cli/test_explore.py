import pytest

from nichechain.cli import main


@pytest.mark.parametrize("estimator", ["empirical-bayes", "mle"])
def test_explore_writes_one_page(built, tmp_path, capsys, estimator):
    out = tmp_path / "explore.html"
    options = ["--out", str(out), "--estimator", estimator, "--draws", "2", "--l", "3", "--lineages", "20"]
    assert main(["explore", str(built), *options]) == 0
    assert f"wrote {out}" in capsys.readouterr().out.replace("\n", "")
    page = out.read_text(encoding="utf-8")
    assert page.startswith("<!DOCTYPE html>")
    assert '"l":3,"lineages":20' in page
    assert len(page) < 1_000_000
    assert [path.name for path in tmp_path.iterdir()] == ["explore.html"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--l", "0"], "l is 0"),
        (["--l", "11"], "l is 11, but the page goes up to 10"),
        (["--lineages", "0"], "lineages is 0"),
        (["--lineages", "20000"], "lineages is 20000, but the page goes up to 10000"),
        (["--draws", "0"], "draws is 0"),
        (["--seed", "-1"], "--seed is -1"),
        (["--out", "no/such/folder/page.html"], "there is no folder"),
        (["--out", "."], "that is a folder"),
    ],
)
def test_bad_options_write_nothing(built, tmp_path, monkeypatch, capsys, options, said):
    monkeypatch.chdir(tmp_path)
    assert main(["explore", str(built), *options]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())
