"""What becomes of genotypes whose evaluation goes wrong."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from nichechain.core.errors import NichechainError
from nichechain.domains import Evaluation, PlanarArm
from nichechain.execution import evaluate_rows
from nichechain.execution.base import reason_of

from .samples import assert_same, numbered


class Picky(PlanarArm):
    """Raises for the genotypes of some numbers."""

    def __init__(self, numbers: set[int]) -> None:
        super().__init__()
        self.numbers = numbers
        self.calls = 0

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        self.calls += 1
        for number in np.asarray(genotypes)[:, 0].astype(int).tolist():
            if number in self.numbers:
                raise ValueError(f"number {number}")
        return super().evaluate(genotypes)


@given(st.integers(1, 64), st.sets(st.integers(0, 63)))
def test_only_the_rows_that_raise_fail(n: int, numbers: set[int]) -> None:
    rows = numbered(n)
    found = evaluate_rows(Picky(numbers), rows)
    expected = PlanarArm().evaluate(rows)
    bad = np.isin(np.arange(n), list(numbers))
    assert found.failed.tolist() == bad.tolist()
    assert found.reasons == tuple(f"ValueError: number {i}" if i in numbers else "" for i in range(n))
    assert found.behavior[~bad].tobytes() == expected.behavior[~bad].tobytes()
    assert np.isnan(found.behavior[bad]).all()


def test_one_row_among_many_is_found_by_halves() -> None:
    domain = Picky({300})
    evaluate_rows(domain, numbered(1024))
    # The whole, and two halves each time.
    assert domain.calls == 1 + 2 * 10


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (ValueError("joint limit"), "ValueError: joint limit"),
        (ZeroDivisionError(), "ZeroDivisionError"),
        (RuntimeError("two\nlines\tand  more"), "RuntimeError: two lines and more"),
        (KeyError("x"), "KeyError: 'x'"),
        (TypeError("<Model object at 0x7f3a5c0d2e10> is odd"), "TypeError: <Model object at 0x...> is odd"),
        (ValueError("\ud800"), "ValueError: \\ud800"),
        (ValueError("é" * 1000), "ValueError: " + "é" * 244),
    ],
)
def test_reasons_are_one_line_and_the_same_everywhere(error: Exception, reason: str) -> None:
    assert reason_of(error) == reason


def test_an_error_that_cannot_be_printed() -> None:
    class Mute(Exception):  # noqa: N818
        def __str__(self) -> str:
            raise RuntimeError

    assert reason_of(Mute()) == "Mute"


class Gives(PlanarArm):
    """Gives something else than an arm does."""

    def __init__(self, **changes: Any) -> None:
        super().__init__()
        self.changes = changes

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        return replace(super().evaluate(genotypes), **self.changes)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_rows_that_are_not_finite_have_failed(value: float) -> None:
    rows = numbered(4)
    plain = PlanarArm().evaluate(rows)
    behavior, objective = plain.behavior.copy(), plain.objective.copy()
    behavior[1, 1] = value
    objective[3] = value
    found = evaluate_rows(Gives(behavior=behavior, objective=objective), rows)
    assert found.failed.tolist() == [False, True, False, True]
    assert found.reasons == ("", *("behavior or objective is not finite", "") * 2)[:4]
    assert np.isnan(found.behavior[[1, 3]]).all()
    assert np.isnan(found.objective[[1, 3]]).all()
    assert found.behavior[[0, 2]].tobytes() == plain.behavior[[0, 2]].tobytes()


def test_rows_that_a_domain_calls_failed_stay_as_they_are() -> None:
    rows = numbered(5)
    rows[2, 3] = np.nan
    assert_same(evaluate_rows(PlanarArm(), rows), PlanarArm().evaluate(rows))


@pytest.mark.parametrize(
    "changes",
    [
        {"behavior": np.zeros((3, 2))},
        {"behavior": np.zeros((4, 3))},
        {"behavior": np.zeros(4)},
        {"objective": np.zeros(3)},
        {"failed": np.zeros(5, bool)},
        {"reasons": ("",) * 3},
    ],
)
def test_a_domain_that_gives_the_wrong_shape_is_told(changes: dict[str, Any]) -> None:
    with pytest.raises(NichechainError, match=r"PlanarArm.* must give shape \(4, 2\)"):
        evaluate_rows(Gives(**changes), numbered(4))
