"""Computations side by side: in order, told of, and over at the first error."""

from __future__ import annotations

import pytest

from nichechain.execution.side_by_side import side_by_side


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
