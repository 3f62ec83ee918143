"""Computations side by side: in order, told of, and over at the first error."""

from __future__ import annotations

import itertools

import pytest

from nichechain.execution.side_by_side import side_by_side, stop_if_nobody_waits


def test_results_come_in_the_order_of_the_items():
    done: list[int] = []
    assert side_by_side(lambda x: x * x, range(50), done.append) == [x * x for x in range(50)]
    assert sum(done) == 50


def test_an_error_is_that_of_the_first_item_that_has_one():
    def odd(x: int) -> int:
        if x % 2:
            raise ValueError(x)
        return x

    with pytest.raises(ValueError, match=r"^1$"):
        side_by_side(odd, range(9))


class _StoppedError(Exception):
    pass


def _stop(_: int) -> None:
    raise _StoppedError


def test_items_without_end_are_taken_as_they_are_needed():
    taken = itertools.count()
    with pytest.raises(_StoppedError):
        side_by_side(lambda x: x, taken, _stop)
    assert next(taken) < 1000


def test_a_long_computation_ends_when_nobody_waits_for_it():
    def call(x: int) -> int:
        while x:
            stop_if_nobody_waits()
        return x

    with pytest.raises(_StoppedError):
        side_by_side(call, range(5), _stop)
    # Elsewhere there is nobody who could have gone.
    stop_if_nobody_waits()
