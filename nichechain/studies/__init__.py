"""Experiments on walks: what pressure and diversity metric do to evolvability, run, tested and reported."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain.core.lazy import lazily

if TYPE_CHECKING:
    from nichechain.studies.conditions import Condition, condition_seed, pressure_of, selection_of
    from nichechain.studies.folder import read_births, read_records, read_study
    from nichechain.studies.initialisation import initialise
    from nichechain.studies.running import run
    from nichechain.studies.stored import is_study
    from nichechain.studies.study import (
        LEVELS,
        METRICS,
        VARIATIONS,
        Study,
        metric_conditions,
        pressure_conditions,
        variations,
    )

# The options of walks are told without what walking needs.
__getattr__, __dir__ = lazily(
    __name__,
    conditions="Condition condition_seed pressure_of selection_of",
    folder="read_births read_records read_study",
    initialisation="initialise",
    running="run",
    stored="is_study",
    study="LEVELS METRICS VARIATIONS Study metric_conditions pressure_conditions variations",
)

__all__ = [
    "LEVELS",
    "METRICS",
    "VARIATIONS",
    "Condition",
    "Study",
    "condition_seed",
    "initialise",
    "is_study",
    "metric_conditions",
    "pressure_conditions",
    "pressure_of",
    "read_births",
    "read_records",
    "read_study",
    "run",
    "selection_of",
    "variations",
]
