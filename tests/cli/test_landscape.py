import json

import matplotlib.image
import pandas as pd
import pytest

from nichechain import NichechainError, load
from nichechain import landscape as measures
from nichechain.cli import landscape, main
from nichechain.landscape import MEASURES

QUICK = ["--offspring", "5", "--seed", "3", "--workers", "1"]


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_writes_table_summary_and_maps(built, tmp_path, capsys, suffix):
    out = tmp_path / f"found.{suffix}"
    assert landscape.run([str(built), *QUICK, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    frame = pd.read_csv(out) if suffix == "csv" else pd.read_parquet(out)
    expected = measures.measure_archive(load(built), 5, 3)
    assert frame["niche"].tolist() == expected.state.tolist()
    for name in MEASURES:
        assert frame[name].to_numpy() == pytest.approx(expected.measures[name], rel=1e-8, nan_ok=True)
    summary = json.loads((tmp_path / "found.json").read_text())
    assert summary.items() >= expected.summary().items()
    assert {entry["measure"] for entry in summary["l_evolvability"]["spearman"]} == set(MEASURES)
    assert matplotlib.image.imread(tmp_path / "found.png").shape[1] > 1000
    # Nothing of an interruption is left, and it says what it wrote.
    assert sorted(path.suffix for path in tmp_path.iterdir()) == sorted([f".{suffix}", ".json", ".png"])
    assert "lower bounds" in said
    assert f"wrote {out}" in said.replace("\n", "")


def test_l_evolvability_stands_beside_where_births_tell_of_it(built, tmp_path):
    landscape.run([str(built), *QUICK, "--min-births", "40", "--map", "none"])
    frame = pd.read_csv(tmp_path / "arm-landscape.csv")
    births = load(built).counts.births
    inside = frame["niche"] < 64
    assert (frame.loc[inside, "births_of_niche"] == births[frame.loc[inside, "niche"]]).all()
    assert (frame["l_evolvability"].notna() == (frame["births_of_niche"] >= 40)).all()
    assert frame["l_evolvability"].notna().any()
    assert not (tmp_path / "arm-landscape.png").exists()


def test_rows_and_summary_as_json(built, capsys):
    options = ["--json", "--top", "4", "--by", "expected-ratio", "--lowest", "--map", "none"]
    assert landscape.run([str(built), *QUICK, *options]) == 0
    found = json.loads(capsys.readouterr().out)
    frame = pd.read_csv("arm-landscape.csv")
    lowest = frame[~frame["neutral"]].sort_values("expected_ratio")["niche"].tolist()[:4]
    assert [row["niche"] for row in found["elites"]] == lowest
    assert found["elites"][0]["dissimilum"]
    assert found["sample_size"] == 5
    assert found["archive"] == "arm"


def test_few_elites_have_no_rank_correlation_and_it_says_why(built, capsys):
    assert landscape.run([str(built), *QUICK, "--elites", "2", "--map", "none"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "No rank correlation with 5-evolvability of the niche: it needs three elites that differ" in said
    assert "Spearman" not in said
    assert landscape.run([str(built), *QUICK, "--min-births", "1", "--map", "none"]) == 0
    assert "Rank correlation with 5-evolvability of the niche" in capsys.readouterr().out


def test_another_operator_is_the_one_that_is_measured_with(built, capsys):
    options = ["--mutation", "gaussian", "--scale", "0.02", "--step-bound", "rescaled:0.01"]
    assert landscape.run([str(built), *QUICK, *options, "--json", "--map", "none"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["mutation"], found["scale"], found["step_bound"]) == ("gaussian", 0.02, "rescaled:0.01")
    assert found["bounded"]
    # No direction of a link can turn further than √10 times the length of the step.
    assert 0 < found["global_sensitivity"] < 0.01 * 10**0.5
    assert landscape.run([str(built), *QUICK, *options, "--map", "none"]) == 0
    assert "lower bounds" not in capsys.readouterr().out


def test_goes_on_after_an_interruption_to_the_same_bytes(built, tmp_path, monkeypatch, capsys):
    from nichechain.execution import Threads
    from nichechain.landscape import sampling

    options = [str(built), *QUICK, "--map", "none", "--out"]
    assert landscape.run([*options, "whole.csv"]) == 0
    evaluate, calls = Threads.evaluate, []

    def interrupted(self, domain, genotypes, on_done=None):
        calls.append(len(genotypes))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return evaluate(self, domain, genotypes, on_done)

    for name in ("_FIRST_BATCH", "_LARGEST_BATCH"):
        monkeypatch.setattr(sampling, name, 60)
    monkeypatch.setattr(Threads, "evaluate", interrupted)
    assert landscape.run([*options, "parts.csv"]) == 130
    assert "--resume" in capsys.readouterr().out
    kept = tmp_path / "parts.csv.partial"
    assert kept.exists()
    assert not (tmp_path / "parts.csv").exists()
    with pytest.raises(NichechainError, match="--resume goes on with it, --force starts over"):
        landscape.run([*options, "parts.csv"])
    assert landscape.run([*options, "parts.csv", "--resume"]) == 0
    for suffix in (".csv", ".json"):
        parts, whole = tmp_path / f"parts{suffix}", tmp_path / f"whole{suffix}"
        assert parts.read_bytes() == whole.read_bytes()
    assert not kept.exists()
    kept.write_bytes(b"something else")
    assert landscape.run([*options, "parts.csv", "--force"]) == 0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--offspring", "1"], "--offspring is 1, but must be at least 2"),
        (["--elites", "0"], "elites is 0"),
        (["--share", "2"], "share is 2"),
        (["--seed", "-1"], "seed is -1"),
        (["--top", "-1"], "--top is -1"),
        (["--l", "0"], "l is 0"),
        (["--by", "fitness"], "there is no measure 'fitness'"),
        (["--map", "ratio,fitness"], "there is no measure 'fitness'"),
        (["--map", ""], "there is no measure ''"),
        (["--scale", "0"], "scale is 0"),
        (["--step-bound", "ball:1"], "--step-bound is 'ball:1'"),
        (["--mutation", "uniform-ball", "--step-bound", "per-coordinate:1"], "cannot be bounded per"),
        (["--out", "table.xlsx"], "must end in one of .csv, .parquet"),
        (["--out", "no/such/table.csv"], "there is no folder no/such"),
        (["--workers", "0"], "workers is 0"),
        (["--resume", "--force"], "exclude each other"),
    ],
)
def test_bad_options_write_nothing(built, tmp_path, options, said):
    with pytest.raises(NichechainError, match=said):
        landscape.run([str(built), *options])
    assert not list(tmp_path.iterdir())


def test_step_sizes_that_are_genes_are_the_elites_own(capsys):
    options = ["--evaluations", "200", "--grid", "6x6", "--self-adaptive", "--out", "own"]
    assert main(["build", "arm", *options]) == 0
    assert landscape.run(["own", *QUICK, "--map", "none"]) == 0
    assert "self-adaptive scale" in capsys.readouterr().out
    with pytest.raises(NichechainError, match=r"--scale is 0\.1, but the step sizes of own are genes"):
        landscape.run(["own", *QUICK, "--scale", "0.1"])
    # A step with a bound is within it, whatever the gene.
    assert landscape.run(["own", *QUICK, "--step-bound", "rescaled:0.01", "--map", "none", "--json"]) == 0
    assert 0 < json.loads(capsys.readouterr().out)["global_sensitivity"] < 0.01 * 10**0.5


@pytest.mark.parametrize("domain", [["linear", "--grid", "12"], ["arm", "--niches", "cvt:20"]])
def test_niches_that_are_no_grid_over_a_plane(tmp_path, domain):
    assert main(["build", *domain, "--evaluations", "200", "--out", "own"]) == 0
    assert landscape.run(["own", *QUICK]) == 0
    assert len(pd.read_csv("own-landscape.csv")) == len(load("own").elites)
    assert (tmp_path / "own-landscape.png").exists()


def test_a_folder_is_no_table(built, tmp_path):
    (tmp_path / "table.csv").mkdir()
    with pytest.raises(NichechainError, match="that is a folder"):
        landscape.run([str(built), "--out", "table.csv"])


def test_a_folder_that_cannot_be_written_to(built, tmp_path, monkeypatch):
    # Root may write anywhere, so the system is made to say no.
    monkeypatch.setattr("os.access", lambda *_: False)
    with pytest.raises(NichechainError, match="nothing can be written to"):
        landscape.run([str(built), "--out", str(tmp_path / "table.csv")])
    assert not list(tmp_path.iterdir())
