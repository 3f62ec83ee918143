import json

import pytest

from nichechain import NichechainError, domains
from nichechain.cli.domains import run


def test_lists_every_domain_with_what_a_build_needs_to_know(capsys):
    assert run([]) == 0
    shown = capsys.readouterr().out
    for name in domains.names():
        assert name in shown
    assert "[1.05, 1.55] by [0.4, 1.1]" in shown
    assert "1,952" in shown
    assert "gym:ENV_ID" in shown
    assert "evaluations/s" not in shown


def test_json(capsys):
    assert run(["--json"]) == 0
    rows = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert set(rows) == set(domains.names())
    assert rows["cosinus"] == {
        "name": "cosinus",
        "behavior": ["b"],
        "unit": "units",
        "bounds": [[-5.0, 5.0]],
        "genotype": 2,
        "objective": "minus the distance of behavior to -4 (units)",
    }


def test_speed_is_measured_on_demand(capsys, monkeypatch):
    monkeypatch.setattr(domains, "names", lambda: ("linear",))
    assert run(["--json", "--speed"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["evaluations_per_second"] > 0
    assert run(["--speed"]) == 0
    assert "evaluations/s" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["--fast"], ["arm"]])
def test_bad_options(words):
    with pytest.raises(NichechainError, match=r"there is no (option --fast|argument arm)"):
        run(words)
