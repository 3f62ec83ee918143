"""Domains that give equal genotypes unequal behaviors are noticed."""

from __future__ import annotations

from nichechain.cli import main
from nichechain.domains.constancy import inconstancy

from .environments import machine, policies


def test_a_reset_that_leaks_is_noticed():
    def found(**options):
        domain = machine(**options)
        return inconstancy(domain.evaluate, machine(**options).evaluate, policies(domain))

    assert found() is None
    assert "again in another order has a behavior" in found(leak=True)


def test_a_build_says_that_its_environment_leaks(tmp_path, capsys):
    arguments = ["build", "gym:nichechain-test/Machine-v0", "--descriptor", "final-observation:0,1"]
    arguments += ["--controller", "mlp:4", "--evaluations", "40", "--initial", "20", "--bounds=-9,9,-9,9"]
    assert main([*arguments, "--grid", "4x4", "--out", str(tmp_path / "pure")]) == 0
    assert "something random" not in capsys.readouterr().err
    leaking = [*arguments, "--grid", "4x4", "--options", "env.leak=true", "--out", str(tmp_path / "leaking")]
    assert main(leaking) == 0
    assert "has something random that its seed does not fix: a genotype" in capsys.readouterr().err
