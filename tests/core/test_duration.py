"""What takes long says so before, and how long."""

from __future__ import annotations

import warnings

import pytest

from nichechain.core.duration import warn_if_long


def test_ten_minutes_are_not_announced() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_if_long(600.0, "less is less")


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (601.0, "10 minutes"),
        (7199.0, "120 minutes"),
        (3 * 3600.0, "3 hours"),
        (1000 * 86_400.0, "1,000 days"),
        (1e300, "for ever"),
        (float("inf"), "for ever"),
    ],
)
def test_how_long_is_said_in_units_of_which_there_are_some(seconds: float, said: str) -> None:
    with pytest.warns(UserWarning, match=f"^this could take {said}: less is less$"):
        warn_if_long(seconds, "less is less")
