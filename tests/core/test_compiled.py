"""Compiled loops, and where their machine code is kept."""

from __future__ import annotations

import numba
import pytest

from nichechain.core.compiled import compiled


def test_machine_code_is_not_kept_where_nothing_can_be_written(monkeypatch):
    def plain(x):
        return 2 * x

    kept = []

    def njit(**options):
        kept.append(options.get("cache", False))
        if kept[-1]:
            raise RuntimeError("cannot cache function 'plain': no locator available")
        return lambda function: function

    monkeypatch.setattr(numba, "njit", njit)
    assert compiled(plain)(3) == 6
    assert kept == [True, False]


def test_it_leaves_the_interpreter_to_others():
    @compiled
    def total(values):
        result = 0.0
        for value in values:
            result += value
        return result

    assert total.targetoptions["nogil"]
    assert total((1.0, 2.0)) == pytest.approx(3.0)
