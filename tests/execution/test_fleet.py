"""The loop that keeps workers busy, with workers that are lost when we say so."""

from __future__ import annotations

import random
import threading
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import pytest

from nichechain import variation
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose
from nichechain.execution import Threads, fleet
from nichechain.execution.fleet import Fleet, Outcome, Rows, Workbench, Worker
from nichechain.variation.unborn import Unborn

from .samples import Arm, assert_same, numbered


class Lost(Exception):  # noqa: N818
    """A worker is no more."""


class FakeFleet(Fleet):
    """Threads that behave like workers far away: slow, mortal, and counted."""

    _lost = (Lost,)

    def __init__(
        self,
        size: int,
        mortality: float = 0.0,
        seed: int = 0,
        ready: bool = True,
        deadly: tuple[int, ...] = (),
    ) -> None:
        super().__init__()
        self.deadly = deadly
        self.size, self.mortality, self.is_ready = size, mortality, ready
        self.dice = random.Random(seed)
        self.hired = self.deaths = self.most_out = 0
        self.sent = b""

    def _size(self) -> int:
        return self.size

    def _neighbours(self) -> int:
        return self._size()

    def _send(self, domain: bytes) -> None:
        self.sent = domain

    def _hire(self) -> Worker:
        self.hired += 1
        return FakeWorker(self)


class FakeWorker(Worker):
    def __init__(self, fleet: FakeFleet) -> None:
        super().__init__()
        self.fleet = fleet
        self.bench = Workbench(fleet.sent, fleet._cache_share)
        self.pool = ThreadPoolExecutor(1)
        self.out = 0
        self.lock = threading.Lock()
        self.dead = False
        self.ready: Future[Outcome] = self.pool.submit(self.bench.prepare) if fleet.is_ready else Future()

    def submit(self, rows: Rows) -> Future[Outcome]:
        with self.lock:
            self.out += 1
            self.fleet.most_out = max(self.fleet.most_out, self.out)
        return self.pool.submit(self.work, rows)

    def work(self, rows: Rows) -> Outcome:
        deadly = isinstance(rows, np.ndarray) and np.isin(rows[:, 0], self.fleet.deadly).any()
        if self.dead or deadly or self.fleet.dice.random() < self.fleet.mortality:
            self.fleet.deaths += not self.dead
            self.dead = True
            raise Lost
        with self.lock:
            self.out -= 1
        return self.bench.evaluate(rows)

    def stop(self, *, kill: bool) -> None:
        self.pool.shutdown(wait=not kill)


@pytest.mark.parametrize("size", [1, 2, 7])
@pytest.mark.parametrize("n", [1, 5, 256])
def test_rows_come_in_order(size: int, n: int) -> None:
    done: list[int] = []
    with FakeFleet(size) as executor:
        assert_same(executor.evaluate(Arm(), numbered(n), done.append), Arm().evaluate(numbered(n)))
    assert sum(done) == n


@pytest.mark.parametrize("seed", range(8))
def test_lost_workers_change_nothing(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    # Rows are unlucky here, not deadly: none must be taken for a cause.
    monkeypatch.setattr("nichechain.execution.pieces.LOSSES", 1000)
    done: list[int] = []
    with FakeFleet(3, mortality=0.3, seed=seed) as executor:
        assert_same(executor.evaluate(Arm(), numbered(400), done.append), Arm().evaluate(numbered(400)))
        assert executor.deaths > 3
        # Each of the dead was replaced, and nobody else was hired.
        assert executor.hired == 3 + executor.deaths
        assert len(executor._crew) == 3
    assert sum(done) == 400


def unborn(n: int, seed: int, mutate: variation.Mutation) -> Unborn:
    rng = np.random.default_rng(seed)
    return Unborn(
        mutate,
        Purpose.MUTATION,
        numbered(9)[rng.permutation(9)],
        (3,) * 9,
        rng.integers(9, size=n),
        np.arange(n) + 1000 * seed,
    )


@pytest.mark.parametrize("mortality", [0.0, 0.2])
def test_workers_grow_children_to_the_bit(mortality: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nichechain.execution.pieces.LOSSES", 1000)
    domain = Arm()
    with FakeFleet(3, mortality) as executor:
        for number, scale in enumerate([1.0, 1.0, 0.1, 1.0]):
            children = unborn(200, number, variation.cauchy(scale))
            done: list[int] = []
            found = executor.evaluate(domain, children, done.append)
            assert_same(found, Arm().evaluate(children.grow()))
            assert sum(done) == 200
        assert (executor.deaths > 3) == (mortality > 0)


def test_a_mutation_that_raises_is_not_the_genotypes_doing() -> None:
    def broken(_parent: np.ndarray, _rng: np.random.Generator) -> np.ndarray:
        raise ArithmeticError("no such step")

    with FakeFleet(2) as executor, pytest.raises(ArithmeticError, match="no such step"):
        executor.evaluate(Arm(), unborn(20, 0, broken))
    with Threads(2) as threads, pytest.raises(ArithmeticError, match="no such step"):
        threads.evaluate(Arm(), unborn(20, 0, broken))


@pytest.mark.parametrize("size", [1, 2, 5])
@pytest.mark.parametrize("deadly", [(0,), (17,), (3, 4, 250), (255,), tuple(range(100, 130))])
def test_rows_that_nobody_outlives_have_failed_and_no_others(size: int, deadly: tuple[int, ...]) -> None:
    rows = numbered(256)
    alive = ~np.isin(np.arange(256), deadly)
    done: list[int] = []
    with FakeFleet(size, deadly=deadly) as executor:
        found = executor.evaluate(Arm(), rows, done.append)
        # Each of the dead was replaced.
        assert executor.hired == size + executor.deaths
    expected = Arm().evaluate(rows)
    assert found.failed.tolist() == (~alive).tolist()
    assert found.reasons == tuple("" if fine else "worker died" for fine in alive)
    assert found.behavior[alive].tobytes() == expected.behavior[alive].tobytes()
    assert np.isnan(found.behavior[~alive]).all()
    assert np.isnan(found.objective[~alive]).all()
    assert sum(done) == 256
    # A row costs three workers at least, and those beside it one each at most while it is found.
    assert executor.deaths >= 3 * min(len(deadly), 1)


def test_a_domain_that_nobody_outlives_is_the_cause() -> None:
    with (
        FakeFleet(2, mortality=1.0) as executor,
        pytest.raises(NichechainError, match="each of 8 rows has cost 3 workers, and none has come back"),
    ):
        executor.evaluate(Arm(), numbered(256))


def test_few_pieces_are_out_at_a_time() -> None:
    with FakeFleet(3) as executor:
        executor.evaluate(Arm(), numbered(2000))
    assert executor.most_out == 2


def test_workers_stay_for_the_next_batch_and_go_with_their_domain() -> None:
    domain = Arm()
    with FakeFleet(2) as executor:
        for _ in range(3):
            executor.evaluate(domain, numbered(40))
        assert executor.hired == 2
        executor.evaluate(Arm(), numbered(40))
        assert executor.hired == 4
        assert len(executor._crew) == 2


def test_the_fleet_grows_with_its_cluster() -> None:
    domain = Arm()
    with FakeFleet(1) as executor:
        executor.evaluate(domain, numbered(40))
        executor.size = 3
        executor.evaluate(domain, numbered(40))
        assert executor.hired == len(executor._crew) == 3


def test_nobody_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fleet, "_PATIENCE", 0.05)
    with (
        FakeFleet(2, ready=False) as executor,
        pytest.raises(NichechainError, match="no worker could be started within 0 s"),
    ):
        executor.evaluate(Arm(), numbered(4))


def test_an_interrupt_lets_everybody_go() -> None:
    def interrupt(_done: int) -> None:
        raise KeyboardInterrupt

    with FakeFleet(2) as executor:
        domain = Arm()
        with pytest.raises(KeyboardInterrupt):
            executor.evaluate(domain, numbered(100), interrupt)
        assert executor._crew == []
        assert_same(executor.evaluate(domain, numbered(100)), domain.evaluate(numbered(100)))
