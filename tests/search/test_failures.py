"""Births that fail, one by one or all together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from nichechain import variation
from nichechain.archive import read
from nichechain.archive.building import build
from nichechain.core.errors import NichechainError
from nichechain.domains import Evaluation, PlanarArm
from nichechain.domains.base import Domain
from nichechain.execution import Processes, Threads
from nichechain.niches import GridNiches
from nichechain.search.config import BuildConfig
from nichechain.search.failures import Failures
from nichechain.walks import Uniform, WalkConfig, diversity, walk

CONFIG = BuildConfig(
    "arm", (9, 7), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=500, initial=100, batch=64, scale=0.3, seed=5
)


def breaking(share_fine: float) -> Domain:
    """An arm that raises where its last joint is beyond a quantile, and only among children."""

    class Breaking(PlanarArm):
        chunk = 7

        def evaluate(self, genotypes: ArrayLike) -> Evaluation:
            angles = np.asarray(genotypes)
            if (np.abs(angles[:, -1]) > share_fine).any():
                raise ValueError(f"torque of {len(angles[0])} joints")
            return super().evaluate(angles)

    return Breaking()


def test_a_birth_that_raises_is_recorded_and_the_build_goes_on(tmp_path: Path) -> None:
    """Alike for threads and processes: reasons hold nothing of where or beside whom it was."""
    contents = []
    for name, executor in (("threads", Threads(2)), ("one", Threads(1)), ("processes", Processes(2))):
        with executor:
            build(CONFIG, tmp_path / name, executor, domain=breaking(0.5))
        paths = sorted(path for path in (tmp_path / name).rglob("*.*") if path.suffix)
        contents.append([path.read_bytes() for path in paths])
    assert contents[0] == contents[1] == contents[2]
    births = read.read_births(tmp_path / "one", read.read_meta(tmp_path / "one")).to_pandas()
    failed = births["failed"].notna()
    assert 5 < failed.sum() < 250
    assert set(births["failed"][failed]) == {"ValueError: torque of 10 joints"}
    assert births["child_niche"][failed].isna().all()
    assert not births["accepted"][failed].any()
    assert len(births) == 500


def test_a_build_of_which_too_much_fails_stops_and_keeps_what_there_is(tmp_path: Path) -> None:
    domain = breaking(0.1)
    with Threads(1) as executor:
        with pytest.raises(NichechainError) as caught:
            build(CONFIG, tmp_path / "a", executor, domain=domain, max_failed=0.3)
        said = str(caught.value)
        births = read.read_meta(tmp_path / "a").births
        assert 100 <= births < 500
        rows = read.read_births(tmp_path / "a", read.read_meta(tmp_path / "a"))
        failed = len(rows) - rows["failed"].null_count
        assert failed > 0.3 * births
        assert said.startswith(f"{failed} of {births} births failed, more than the share of 0.3 that may, ")
        assert f"{failed} of them because: ValueError: torque of 10 joints" in said
        assert "a build with a larger max_failed goes on" in said
        # It stops again at once, and goes on with leave, to the bytes of one that never stopped.
        with pytest.raises(NichechainError, match=f"{failed} of {births} births failed"):
            build(CONFIG, tmp_path / "a", executor, domain=domain, max_failed=0.3)
        build(CONFIG, tmp_path / "a", executor, domain=domain, max_failed=1.0)
        build(CONFIG, tmp_path / "b", executor, domain=domain, max_failed=1.0)
    names = [path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*") if path.is_file()]
    assert all((tmp_path / "a" / n).read_bytes() == (tmp_path / "b" / n).read_bytes() for n in names)


class Wrong(PlanarArm):
    """Has a mistake."""

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        return super().evaluate(np.asarray(genotypes)[:, self.no_such_attribute])  # type: ignore[attr-defined]


def test_a_domain_that_never_works_stops_the_build_and_says_where(tmp_path: Path) -> None:
    with Threads(1) as executor, pytest.raises(NichechainError) as caught:
        build(CONFIG, tmp_path, executor, domain=Wrong(), max_failed=1.0)
    assert str(caught.value) == (
        "all 100 births of the first batch failed, the first because: "
        "AttributeError: 'Wrong' object has no attribute 'no_such_attribute'"
    )
    assert isinstance(caught.value.__cause__, AttributeError)
    assert not read.is_archive(tmp_path)


def test_interrupts_are_nobodys_failure(tmp_path: Path) -> None:
    class Interrupting(PlanarArm):
        def evaluate(self, genotypes: ArrayLike) -> Evaluation:  # noqa: ARG002
            raise KeyboardInterrupt

    with Threads(1) as executor, pytest.raises(KeyboardInterrupt):
        build(CONFIG, tmp_path, executor, domain=Interrupting())


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan"), float("inf")])
def test_shares_that_are_none(share: float, tmp_path: Path) -> None:
    with Threads(1) as executor, pytest.raises(NichechainError, match=r"max_failed is .*, from 0 to 1"):
        build(CONFIG, tmp_path / "archive", executor, max_failed=share)
    assert not (tmp_path / "archive").exists()


@pytest.mark.parametrize(
    ("births", "failed", "most", "stops"),
    [
        (99, 99, 0.5, False),
        (100, 50, 0.5, False),
        (100, 51, 0.5, True),
        (1000, 1000, 1.0, False),
        (100, 1, 0.0, True),
    ],
)
def test_when_it_is_too_much(births: int, failed: int, most: float, stops: bool) -> None:
    import pyarrow as pa

    failures = Failures(most)
    reasons = ["hinge"] * failed + [None] * (births - failed)
    for part in (reasons[::2], reasons[1::2]):
        failures.count(pa.table({"failed": pa.array(part, pa.string())}))
    assert (failures.births, failures.failed) == (births, failed)
    if stops:
        with pytest.raises(NichechainError, match=f"^{failed} of {births} .* hinge; all is kept"):
            failures.check("all is kept")
    else:
        failures.check("all is kept")


def test_a_walk_goes_on_without_those_that_raise() -> None:
    """Failed offspring are recorded, and nobody walks there."""
    config = WalkConfig(Uniform(), diversity.make("knn"), offspring=20, seed=3)
    niches = GridNiches((5, 5), PlanarArm().bounds)
    domain, mutate = breaking(0.3), variation.gaussian(0.2)
    here = walk(domain, mutate, config, runs=2, steps=5, niches=niches)
    failed = here.births.to_pandas()["failed"]
    assert 3 < failed.notna().sum() < 200
    assert set(failed.dropna()) == {"ValueError: torque of 10 joints"}
    assert np.abs(here.state.genotype[..., -1]).max() <= 0.3
    with Threads(2) as executor:
        there = walk(domain, mutate, config, runs=2, steps=5, niches=niches, executor=executor)
    assert there.births.equals(here.births)


def test_a_worker_that_dies_costs_a_birth_and_not_the_build(tmp_path: Path) -> None:
    class Deadly(PlanarArm):
        chunk = 16

        def evaluate(self, genotypes: ArrayLike) -> Evaluation:
            import os

            if (np.abs(np.asarray(genotypes)[:, -1]) > 0.75).any():
                os._exit(3)
            return super().evaluate(genotypes)

    config = replace(CONFIG, evaluations=164)
    with Processes(2) as executor:
        build(config, tmp_path / "died", executor, domain=Deadly())
    with Threads(1) as executor:
        build(config, tmp_path / "raised", executor, domain=breaking(0.75))
    died, raised = (
        read.read_births(tmp_path / name, read.read_meta(tmp_path / name)).to_pandas()
        for name in ("died", "raised")
    )
    assert set(died["failed"].dropna()) == {"worker died"}
    # But for the reason, all is as if the domain had raised.
    assert died["failed"].notna().equals(raised["failed"].notna())
    assert died.drop(columns="failed").equals(raised.drop(columns="failed"))
