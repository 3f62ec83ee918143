"""Bad input of the measures of a landscape."""

# ruff: noqa: ARG005  # every row of a table takes the world, whether it needs it or not
from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from .table import (
    LINEAGES,
    NOT_A_NUMBER,
    RAGGED,
    SEED,
    UNKNOWN,
    Call,
    Made,
    World,
    check_accepted,
    check_refused,
    rows,
    whole,
)

_SAMPLE = (np.zeros(3), 1.0, np.zeros((3, 0)), *RAGGED)
_EPSILON = (0.0, -1.0, *NOT_A_NUMBER)
_ROWS = [[0.0], [0.0, 1.0]]
_SHARE = (0.0, 1.1, *NOT_A_NUMBER)
_PAIR = {"parent": np.zeros((4, 2)), "offspring": np.ones((4, 3, 2))}
_BAD_PAIR = {
    "parent": (np.zeros((3, 2)), np.zeros((4, 3)), np.zeros(2), 1.0, *RAGGED),
    "offspring": (np.zeros((3, 3, 2)), np.zeros((4, 3, 3)), np.zeros(2), 1.0, *RAGGED),
}


def _measured(*names: str) -> tuple[Call, ...]:
    return tuple(
        Call(f"landscape.{name}", lambda w: {"offspring": np.ones((3, 2))}, {"offspring": _SAMPLE})
        for name in names
    )


CALLS = (
    *_measured("evolvability", "expected_evolvability"),
    Call(
        "landscape.population_evolvability",
        lambda w: {"population": np.ones((3, 2))},
        {"population": _SAMPLE},
    ),
    Call("landscape.local_sensitivity", lambda w: dict(_PAIR), _BAD_PAIR),
    Call("landscape.expected_local_sensitivity", lambda w: dict(_PAIR), _BAD_PAIR),
    *(
        Call(
            f"landscape.{name}",
            lambda w: {"parents": np.zeros((4, 2)), "offspring": np.ones((4, 3, 2))},
            {"parents": _BAD_PAIR["parent"], "offspring": _BAD_PAIR["offspring"]},
        )
        for name in ("global_sensitivity", "expected_global_sensitivity")
    ),
    Call(
        "landscape.population_course",
        lambda w: {"births": w.births, "niches": w.archive.niches},
        {"births": (np.eye(3), Made(lambda w: w.births.drop(columns="step"), "no-step"))},
    ),
    Call(
        "landscape.one_hot_evolvability",
        lambda w: {"niche": [0, 1], "niches": 3},
        {"niche": (0, ["a"], [0.5], [[0], [1, 2]]), "niches": whole(0)},
    ),
    Call(
        "landscape.dissimila_ratio",
        lambda w: {"evolvability": [1.0, 2.0], "sensitivity": [1.0, 2.0]},
        {"evolvability": ([1.0], *RAGGED), "sensitivity": ([1.0], *RAGGED), "epsilon": _EPSILON},
    ),
    Call(
        "landscape.hull_volume",
        lambda w: {"behaviors": np.eye(3)},
        {"behaviors": (np.zeros(3), np.zeros((2, 0)), [[np.inf, 0.0]], np.full((3, 2), 1e308), 1.0, *RAGGED)},
    ),
    Call(
        "landscape.find_dissimila",
        lambda w: {"ratio": [1.0, 2.0], "sensitivity": [1.0, 2.0]},
        {
            "ratio": ([1.0], [[1.0, 2.0]], *RAGGED),
            "sensitivity": ([1.0], *RAGGED),
            "share": _SHARE,
            "neutral": (-1.0, *NOT_A_NUMBER),
        },
    ),
    Call("landscape.find_measure", lambda w: {"name": "ratio"}, {"name": UNKNOWN}),
    Call(
        "landscape.find_measures", lambda w: {"names": ["ratio"]}, {"names": ([], ["nothing"], np.array(3))}
    ),
    Call(
        "landscape.measure_behaviors",
        lambda w: dict(_PAIR),
        {
            "parent": (*_BAD_PAIR["parent"], np.full((4, 2), np.nan)),
            "offspring": (*_BAD_PAIR["offspring"], np.ones((4, 1, 2)), np.full((4, 3, 2), np.inf)),
            "epsilon": _EPSILON,
        },
    ),
    Call(
        "landscape.measure",
        lambda w: {"domain": w.arm, "genotype": w.genotypes[0], "mutate": w.mutate, "sample_size": 2},
        {
            "genotype": (np.zeros(3), np.full(10, np.nan), "three", _ROWS),
            "sample_size": whole(1),
            "seed": SEED,
            "epsilon": _EPSILON,
        },
    ),
    Call(
        "landscape.measure_genotypes",
        lambda w: {"domain": w.arm, "genotypes": w.genotypes, "mutate": w.mutate, "sample_size": 2},
        {
            "genotypes": (np.zeros(3), np.zeros((2, 3)), np.full((1, 10), np.nan), "three", _ROWS),
            "sample_size": whole(1),
            "seed": SEED,
            "epsilon": _EPSILON,
        },
    ),
    Call(
        "landscape.measure_archive",
        lambda w: {"archive": w.archive, "offspring": 2, "elites": 2},
        {"offspring": (10**30, *whole(1)), "seed": SEED, "elites": whole(0), "share": _SHARE},
    ),
    Call(
        "landscape.niche_table",
        lambda w: {"archive": w.archive, "l": 1, "lineages": 2, "draws": 2},
        {
            **LINEAGES,
            "estimator": UNKNOWN,
            "children": whole(1),
            "draws": whole(0),
        },
    ),
    Call(
        "landscape.Landscape.correlations",
        lambda w: {"self": w.landscape, "values": np.arange(25.0)},
        {"values": ([1.0], 1.0, *RAGGED)},
    ),
)


@pytest.mark.parametrize(("call", "parameter", "value"), rows(*CALLS))
def test_a_bad_value_is_refused_in_one_sentence(call: Call, parameter: str, value: Any, world: World) -> None:
    check_refused(call, parameter, value, world)


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.name)
def test_the_other_arguments_are_good(call: Call, world: World) -> None:
    check_accepted(call, world)
