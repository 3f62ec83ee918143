"""Executors by what the command line says."""

from __future__ import annotations

import sys

import pytest

from nichechain import execution
from nichechain.core.errors import NichechainError
from nichechain.execution import Processes, Threads, available_cpus


@pytest.mark.parametrize(
    ("workers", "count"),
    [(None, available_cpus()), ("3", 3), ("threads", available_cpus()), ("threads:3", 3)],
)
def test_threads(workers: str | None, count: int) -> None:
    with execution.make(workers) as made:
        assert isinstance(made, Threads)
        assert made._pool._max_workers == count


@pytest.mark.parametrize(("workers", "count"), [("processes", available_cpus()), ("processes:3", 3)])
def test_processes(workers: str, count: int) -> None:
    with execution.make(workers) as made:
        assert isinstance(made, Processes)
        assert made._size() == count


@pytest.mark.parametrize(
    ("workers", "said"),
    [
        ("0", "workers is 0, but must be at least 1"),
        ("-2", "workers is -2, but must be at least 1"),
        ("threads:0", "workers is 0, but must be at least 1"),
        ("processes:-1", "workers is -1, but must be at least 1"),
        *(
            (odd, f"workers is '{odd}', but must be a number of threads, threads:N, processes:N, ray")
            for odd in (
                "two",
                "2.5",
                "2:2",
                ":2",
                "threads:",
                "processes:two",
                "process:2",
                "²",
                "ray:",
                "ray:2",
                "ray://",
                "rays",
                "Ray",
                " 2",
            )
        ),
    ],
)
def test_what_is_no_executor(workers: str, said: str) -> None:
    with pytest.raises(NichechainError) as caught:
        execution.make(workers)
    assert str(caught.value).startswith(said)


@pytest.mark.parametrize("workers", ["ray", "ray://127.0.0.1:10001"])
def test_without_ray(workers: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(NichechainError, match=r"not installed .*: pip install 'nichechain\[ray\]'"):
        execution.make(workers)
