"""Executors: the rows of the domain, in order, whoever evaluates them."""

from __future__ import annotations

import os
import threading

import numpy as np
import pytest
from numpy.typing import ArrayLike

from nichechain.core.errors import NichechainError
from nichechain.domains import Evaluation, PlanarArm
from nichechain.execution import Threads, available_cpus


class SmallChunks(PlanarArm):
    """An arm that is handed out a few genotypes at a time."""

    chunk = 3


class Backwards(PlanarArm):
    """Finishes the first chunk only after the last: two threads must be at work."""

    chunk = 1

    def __init__(self) -> None:
        super().__init__()
        self.last_done = threading.Event()

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        which = float(np.asarray(genotypes)[0, 0])
        if which == 0:
            assert self.last_done.wait(30)
        if which == 9:
            self.last_done.set()
        return super().evaluate(genotypes)


class Breaks(PlanarArm):
    """Raises at one genotype and counts the chunks begun."""

    chunk = 1

    def __init__(self, error: BaseException) -> None:
        super().__init__()
        self.error = error
        self.begun = 0
        self.release = threading.Event()

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        self.begun += 1
        if np.asarray(genotypes)[0, 0] == 2:
            raise self.error
        if np.asarray(genotypes)[0, 0] > 2:
            # Holds the only thread until the caller has seen the error.
            self.release.wait(30)
        return super().evaluate(genotypes)


def numbered(n: int) -> np.ndarray:
    rows = np.zeros((n, 10), np.float32)
    rows[:, 0] = np.arange(n)
    return rows


@pytest.mark.parametrize("workers", [1, 2, 4])
@pytest.mark.parametrize("n", [1, 3, 7, 31])
def test_rows_come_in_order(workers: int, n: int) -> None:
    arm, rows = SmallChunks(), numbered(n)
    rows[n // 2, 1] = np.nan
    done: list[int] = []
    with Threads(workers) as executor:
        evaluation = executor.evaluate(arm, rows, done.append)
    expected = arm.evaluate(rows)
    np.testing.assert_array_equal(evaluation.behavior, expected.behavior)
    np.testing.assert_array_equal(evaluation.objective, expected.objective)
    np.testing.assert_array_equal(evaluation.failed, expected.failed)
    assert evaluation.reasons == expected.reasons
    assert len(evaluation) == n
    assert sum(done) == n
    assert sorted(done) == [n % 3] * (n % 3 > 0) + [3] * (n // 3)


def test_rows_come_in_order_even_if_the_first_is_last() -> None:
    with Threads(2) as executor:
        evaluation = executor.evaluate(Backwards(), numbered(10))
    np.testing.assert_array_equal(evaluation.behavior, PlanarArm().evaluate(numbered(10)).behavior)


@pytest.mark.parametrize("error", [MemoryError("broken"), NichechainError("broken"), KeyboardInterrupt()])
def test_an_error_comes_through_and_stops_the_rest(error: BaseException) -> None:
    domain = Breaks(error)
    with Threads(1) as executor:
        with pytest.raises(type(error)):
            executor.evaluate(domain, numbered(50))
        domain.release.set()
        # One thread works through its queue in order: what is left of it comes before this.
        executor.evaluate(PlanarArm(), numbered(1))
    # Three, and the one that the thread may have taken before the rest were called off.
    assert domain.begun <= 4


def test_an_executor_can_go_on_after_an_error() -> None:
    with Threads(2) as executor:
        domain = Breaks(MemoryError("broken"))
        domain.release.set()
        with pytest.raises(MemoryError, match="broken"):
            executor.evaluate(domain, numbered(10))
        assert len(executor.evaluate(SmallChunks(), numbered(10))) == 10


def test_an_interrupt_while_waiting_stops_the_rest() -> None:
    """As when the user presses Ctrl-C while ``on_done`` draws a progress bar."""

    def interrupt(_done: int) -> None:
        raise KeyboardInterrupt

    domain = Breaks(RuntimeError("never reached"))
    domain.release.set()
    with Threads(1) as executor, pytest.raises(KeyboardInterrupt):
        executor.evaluate(domain, numbered(2), interrupt)


def test_a_closed_executor_takes_nothing() -> None:
    executor = Threads(1)
    executor.close()
    with pytest.raises(RuntimeError):
        executor.evaluate(PlanarArm(), numbered(1))


def test_default_workers_are_the_processors_of_this_process() -> None:
    assert available_cpus() == len(os.sched_getaffinity(0))
    with Threads() as executor:
        assert executor._pool._max_workers == available_cpus()


@pytest.mark.parametrize("workers", [0, -2])
def test_workers_that_are_none(workers: int) -> None:
    with pytest.raises(NichechainError, match=f"workers is {workers}, but must be at least 1"):
        Threads(workers)
