"""What cannot be verified is left alone, and said."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from nichechain.archive import Columns, import_births
from nichechain.archive.archive import Archive, load
from nichechain.domains import PlanarArm
from nichechain.execution.base import WORKER_DIED
from nichechain.niches import GridNiches
from nichechain.verification import verify

from .conftest import CONFIG
from .forgeries import Forgery, found


def test_an_unknown_domain_leaves_the_record_and_the_search(genuine: Archive, tmp_path: Path) -> None:
    forgery = Forgery(genuine)
    forgery.meta = replace(forgery.meta, config=replace(CONFIG, domain="somebody's"))
    forgery.sealed(tmp_path)
    result = verify(tmp_path)
    assert result.ok
    assert {check.group for check in result.checks} == {"record", "search"}
    (reason,) = result.unverified
    assert 'genotypes and evaluations: domain is "somebody\'s"' in reason
    assert (result.sampled_births, result.sampled_elites) == (0, 0)


def test_a_domain_of_another_length_is_not_verified(genuine: Archive) -> None:
    result = verify(load(genuine.folder, domain=PlanarArm(joints=4)))
    assert "genotypes of 10 parameters, but arm has 4" in result.unverified[0]
    assert result.ok


def test_imported_births_are_verified_as_far_as_they_go(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("px,py,x,y\n,,0.1,0.2\n0.1,0.2,0.5,-0.5\n0.1,0.2,,\n")
    niches = GridNiches((6, 5), ((-0.7, 1.0), (-0.9, 0.8)))
    columns = Columns(parent=("px", "py"), child=("x", "y"))
    import_births(tmp_path / "log.csv", tmp_path / "archive", niches, columns=columns)
    result = verify(tmp_path / "archive")
    assert result.ok
    assert "the births were imported" in result.unverified[0]
    forgery = Forgery(load(tmp_path / "archive"))
    forgery.set(1, child_niche=3)
    assert found(verify(forgery.sealed(tmp_path / "forged"))) == {
        "a birth's niche is that of its behavior": (1,)
    }


def test_a_genotype_that_cost_a_worker_is_left_alone(forgery: Forgery, tmp_path: Path) -> None:
    failed = forgery.births["uid"][forgery.births["failed"].notna()].tolist()
    forgery.set(failed[0], failed=WORKER_DIED)
    forgery.set(failed[1], failed=WORKER_DIED)
    result = verify(forgery.sealed(tmp_path), sample=None)
    assert result.ok
    assert result.sampled_births == 333 - 2
    assert result.unverified == ("2 births that cost a worker: evaluating them could end this process",)
