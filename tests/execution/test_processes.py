"""Processes: the rows of the domain to the bit, whatever becomes of the processes."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import nichechain
from nichechain import variation
from nichechain.archive.building import build
from nichechain.core.errors import NichechainError
from nichechain.domains import FetchPickAndPlace
from nichechain.execution import Executor, Processes, Threads, evaluate_rows
from nichechain.search.config import BuildConfig
from nichechain.walks import Selective, WalkConfig, walk

from .samples import (
    Arm,
    Counted,
    Deadly,
    Fragile,
    Raises,
    Stillborn,
    Writes,
    assert_same,
    check_nothing_is_left,
    notes,
    numbered,
)

CONFIG = BuildConfig(
    "arm", (9, 7), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=700, initial=100, batch=64, scale=0.3, seed=5
)


@pytest.fixture(scope="module")
def two() -> Iterator[Processes]:
    with Processes(2) as executor:
        yield executor


def content(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


def built(folder: Path, executor: Executor, config: BuildConfig = CONFIG) -> dict[str, bytes]:
    build(config, folder, executor, domain=Arm())
    return content(folder)


@pytest.mark.parametrize("n", [1, 7, 200])
def test_rows_come_in_order(n: int, two: Processes) -> None:
    rows = numbered(n)
    rows[n // 2, 1] = np.nan
    done: list[int] = []
    assert_same(two.evaluate(Arm(), rows, done.append), Arm().evaluate(rows))
    assert sum(done) == n


def test_a_build_leaves_the_same_bytes(two: Processes, tmp_path: Path) -> None:
    with Threads(1) as one:
        expected = built(tmp_path / "thread", one)
    for threads in (2, 4):
        with Threads(threads) as several:
            assert built(tmp_path / f"threads-{threads}", several) == expected
    assert built(tmp_path / "processes", two) == expected
    # Half there, half here.
    built(tmp_path / "both", two, replace(CONFIG, evaluations=333))
    with Threads(2) as several:
        assert built(tmp_path / "both", several) == expected


def test_a_walk_takes_the_same_steps(two: Processes) -> None:
    config = WalkConfig(Selective(), nichechain.walks.diversity.make("knn"), offspring=6, seed=3)
    arm = Arm()
    there = walk(arm, variation.cauchy(), config, runs=3, steps=4, executor=two)
    here = walk(arm, variation.cauchy(), config, runs=3, steps=4)
    assert there.births.equals(here.births)
    assert there.state.genotype.tobytes() == here.state.genotype.tobytes()


def test_fetch_gives_the_same_bits(two: Processes) -> None:
    domain = FetchPickAndPlace()
    genotypes = domain.sample(6, seed=2)
    genotypes[3, 0] = np.nan
    assert_same(two.evaluate(domain, genotypes), domain.evaluate(genotypes))


def test_the_domain_travels_once_to_each_process(two: Processes, tmp_path: Path) -> None:
    domain = Counted(tmp_path)
    for _ in range(3):
        assert_same(two.evaluate(domain, numbered(60)), Arm().evaluate(numbered(60)))
    visits = [path.read_text() for path in tmp_path.iterdir()]
    assert 1 <= len(visits) <= 2
    assert set(visits) == {"x"}


def test_a_domain_may_write_to_its_copy(two: Processes) -> None:
    rows = numbered(30)
    assert_same(two.evaluate(Writes(), rows), Writes().evaluate(rows.copy()))
    assert_same(two.evaluate(Arm(), rows), Arm().evaluate(numbered(30)))


def test_a_killed_process_loses_nothing(two: Processes, tmp_path: Path) -> None:
    domain = Deadly(once=tmp_path / "died")
    assert_same(two.evaluate(domain, numbered(100)), Arm().evaluate(numbered(100)))
    assert (tmp_path / "died").exists()


def test_a_process_killed_while_idle_loses_nothing(two: Processes, tmp_path: Path) -> None:
    domain = Counted(tmp_path)
    two.evaluate(domain, numbered(100))
    for path in tmp_path.iterdir():
        os.kill(int(path.name), signal.SIGKILL)
    assert_same(two.evaluate(domain, numbered(100)), Arm().evaluate(numbered(100)))


def test_a_genotype_that_kills_every_process_has_failed(two: Processes) -> None:
    expected = Arm().evaluate(numbered(40))
    found = two.evaluate(Deadly(), numbered(40))
    assert np.flatnonzero(found.failed).tolist() == [17]
    assert found.reasons[17] == "worker died"
    assert np.isnan(found.behavior[17]).all()
    fine = ~found.failed
    assert found.behavior[fine].tobytes() == expected.behavior[fine].tobytes()
    assert_same(two.evaluate(Arm(), numbered(9)), Arm().evaluate(numbered(9)))


def test_a_domain_that_kills_as_it_arrives(two: Processes) -> None:
    with pytest.raises(NichechainError, match="3 workers in a row died as they started"):
        two.evaluate(Stillborn(), numbered(4))


def test_a_domain_that_cannot_be_unpacked(two: Processes) -> None:
    with pytest.raises(LookupError, match="no licence on this machine"):
        two.evaluate(Fragile(), numbered(4))


@pytest.mark.parametrize("kind", ["here", "threads", "processes"])
@pytest.mark.parametrize("chunk", [1, 5, 4096])
@pytest.mark.parametrize("awkward", [False, True])
def test_a_genotype_for_which_the_domain_raises_has_failed(
    kind: str, chunk: int, awkward: bool, two: Processes
) -> None:
    domain, rows = Raises(chunk=chunk, awkward=awkward), numbered(60)
    with Threads(2) as threads:
        executors: dict[str, Executor] = {"threads": threads, "processes": two}
        found = executors[kind].evaluate(domain, rows) if kind in executors else evaluate_rows(domain, rows)
    expected = Arm().evaluate(rows)
    reason = "Awkward: hinge in elbow" if awkward else "ArithmeticError: elbow"
    assert found.reasons == ("",) * 17 + (reason,) + ("",) * 42
    assert found.failed.tolist() == [bool(reason) for reason in found.reasons]
    fine = ~found.failed
    assert found.behavior[fine].tobytes() == expected.behavior[fine].tobytes()
    assert found.objective[fine].tobytes() == expected.objective[fine].tobytes()
    assert np.isnan(found.behavior[17]).all()
    assert np.isnan(found.objective[17])


@pytest.mark.parametrize("kind", ["threads", "processes"])
@pytest.mark.parametrize("error", [MemoryError("no more"), NichechainError("no such block")], ids=repr)
def test_what_no_genotype_can_help_comes_through(kind: str, error: Exception, two: Processes) -> None:
    with Threads(2) as threads:
        executor: Executor = threads if kind == "threads" else two
        with pytest.raises(type(error), match=str(error)) as caught:
            executor.evaluate(Raises(error=error), numbered(60))
    if kind == "processes":
        assert "in evaluate" in notes(caught.value)


@pytest.mark.parametrize(
    ("stop", "everybody"), [(signal.SIGINT, True), (signal.SIGINT, False), (signal.SIGKILL, False)]
)
def test_nothing_is_left_behind(stop: signal.Signals, everybody: bool, tmp_path: Path) -> None:
    check_nothing_is_left("processes:2", stop, everybody, tmp_path)
