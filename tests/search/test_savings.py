"""How much physics a build was spared: counted, kept beside the archive, and never needed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from nichechain.domains.base import Evaluation
from nichechain.search import savings
from nichechain.search.savings import Savings


def evaluation(steps: int, known: int) -> Evaluation:
    return Evaluation(np.zeros((1, 2)), np.zeros(1), np.zeros(1, bool), ("",), steps=steps, known=known)


def test_counts_add_up() -> None:
    parts = [evaluation(50, 20), evaluation(100, 0), evaluation(0, 0)]
    assert Savings(10, 5).and_of(Evaluation.concatenate(parts)) == Savings(160, 25)


def test_what_was_written_is_read(tmp_path: Path) -> None:
    savings.write(tmp_path, Savings(100, 40))
    assert savings.read(tmp_path) == Savings(100, 40)


def test_nothing_is_written_of_domains_that_keep_no_count(tmp_path: Path) -> None:
    savings.write(tmp_path, Savings())
    assert not list(tmp_path.iterdir())
    assert savings.read(tmp_path) == Savings()


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[]",
        b"3",
        b"{}",
        b'{"steps": 3}',
        b'{"steps": 3, "known": 4}',
        b'{"steps": "x", "known": 1}',
        b'{"steps": -3, "known": -4}',
        b"\xff",
        b'{"steps": 1e999, "known": 0}',
    ],
)
def test_a_damaged_file_tells_nothing(tmp_path: Path, content: bytes) -> None:
    (tmp_path / savings.FILE).write_bytes(content)
    assert savings.read(tmp_path) == Savings()
