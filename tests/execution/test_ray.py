"""Ray actors on a small local cluster."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from nichechain import execution
from nichechain.domains import FetchPickAndPlace
from nichechain.execution import Ray, Threads

from .samples import Arm, Deadly, Raises, Writes, assert_same, check_nothing_is_left, numbered
from .test_processes import built

ray = pytest.importorskip("ray")

# A cluster of 128 MB is plenty; Ray's own default is a third of the memory.
LOCAL = {
    "address": "local",
    "num_cpus": 2,
    "include_dashboard": False,
    "object_store_memory": 128 * 2**20,
    "logging_level": "ERROR",
}


@pytest.fixture(scope="module")
def cluster() -> Iterator[Ray]:
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    ray.init(**LOCAL)
    try:
        with execution.make("ray") as executor:
            assert isinstance(executor, Ray)
            yield executor
        # It was ours, so the executor has left it running.
        assert ray.is_initialized()
    finally:
        ray.shutdown()


def test_a_build_leaves_the_same_bytes(cluster: Ray, tmp_path: Path) -> None:
    with Threads(1) as one:
        expected = built(tmp_path / "thread", one)
    assert built(tmp_path / "ray", cluster) == expected


def test_fetch_gives_the_same_bits(cluster: Ray) -> None:
    domain = FetchPickAndPlace()
    genotypes = domain.sample(6, seed=2)
    genotypes[3, 0] = np.nan
    assert_same(cluster.evaluate(domain, genotypes), domain.evaluate(genotypes))


def test_a_lost_actor_loses_nothing(cluster: Ray, tmp_path: Path) -> None:
    domain = Deadly(once=tmp_path / "died")
    done: list[int] = []
    assert_same(cluster.evaluate(domain, numbered(100), done.append), Arm().evaluate(numbered(100)))
    assert (tmp_path / "died").exists()
    assert sum(done) == 100
    found = cluster.evaluate(Deadly(), numbered(40))
    assert np.flatnonzero(found.failed).tolist() == [17]
    assert found.reasons[17] == "worker died"


def test_a_genotype_for_which_the_domain_raises_has_failed(cluster: Ray) -> None:
    found = cluster.evaluate(Raises(), numbered(60))
    with Threads(2) as threads:
        assert_same(found, threads.evaluate(Raises(), numbered(60)))
    assert found.reasons[17] == "ArithmeticError: elbow"
    rows = numbered(30)
    assert_same(cluster.evaluate(Writes(), rows), Writes().evaluate(rows.copy()))


def test_an_interrupt_leaves_nothing_behind(tmp_path: Path) -> None:
    check_nothing_is_left("ray", signal.SIGINT, True, tmp_path)
