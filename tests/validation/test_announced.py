"""Checks that could take over ten minutes say so before, once for all that they ask."""

from __future__ import annotations

import re
from typing import Any

import pytest

import nichechain as nc
from nichechain.core import duration
from nichechain.validation import (
    ValidationConfig,
    compare_estimators,
    level_course,
    level_drift,
    rank_stability,
    validate,
)

FEW: dict[str, Any] = {"l": 2, "lineages": 2, "draws": 2}


def validated(archive: nc.Archive) -> None:
    """The checks of ``nichechain validate``, as few as there can be."""
    with nc.Threads(1) as threads:
        validate(archive, threads, ValidationConfig(3, 1, 1, offspring=1, permutations=2))


@pytest.mark.parametrize(
    ("ask", "remedy"),
    [
        (lambda a: rank_stability(a.counts, repeats=1, min_births=2, **FEW), "fewer roots, "),
        (lambda a: level_drift(a.table(), a.niches, min_births=2, **FEW), "fewer roots, "),
        (lambda a: level_course(a.table(), a.niches, parts=2, min_births=2, **FEW), "fewer roots, "),
        (lambda a: compare_estimators(a.counts, folds=2), r"of \d+ births, fewer folds"),
        (validated, r"of \d+ births, fewer permutations"),
    ],
    ids=["stability", "drift", "course", "estimators", "validation"],
)
def test_what_could_take_over_ten_minutes_is_said_before(
    ask: Any, remedy: str, arm_archive: nc.Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(duration, "_LONG", 1e-12)
    with pytest.warns(UserWarning, match=f"this could take 0 minutes: {remedy}") as told:
        ask(arm_archive)
    assert sum(bool(re.search(remedy, str(warning.message))) for warning in told) == 1
