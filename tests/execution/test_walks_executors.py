"""A walk is the same whoever evaluates it."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from nichechain import variation
from nichechain.domains import PlanarArm
from nichechain.execution import Executor, Processes, Threads
from nichechain.niches import GridNiches
from nichechain.walks import TopFraction, WalkConfig, WalkResult, diversity, walk

from .samples import Arm


def _walk(executor: Executor | None) -> WalkResult:
    config = WalkConfig(TopFraction(0.5), diversity.make("knn"), offspring=6, seed=3)
    niches = GridNiches((5, 5), PlanarArm().bounds)
    # Chunks of five split every step's 18 offspring between workers.
    return walk(Arm(), variation.gaussian(0.2), config, runs=3, steps=4, niches=niches, executor=executor)


@pytest.mark.parametrize(
    "make",
    [lambda: Threads(1), lambda: Threads(3), lambda: Processes(2)],
    ids=["one thread", "three threads", "two processes"],
)
def test_executors_give_the_same_walk(make: Callable[[], Executor]) -> None:
    here = _walk(None)
    with make() as executor:
        there = _walk(executor)
    assert there.births.equals(here.births)
    assert there.births.num_rows == 3 * (1 + 5 * 6)
    assert there.table().equals(here.table())
