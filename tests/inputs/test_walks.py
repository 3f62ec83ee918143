"""Bad input of walks and of diversity metrics."""

# ruff: noqa: ARG005  # every row of a table takes the world, whether it needs it or not
from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nichechain.walks.diversity import ArchiveRule

from .table import (
    NOT_A_NUMBER,
    POSITIVE,
    RAGGED,
    SEED,
    UNKNOWN,
    Call,
    World,
    check_accepted,
    check_refused,
    rows,
    whole,
)

_FRACTION = (0.0, 1.1, -0.1, *NOT_A_NUMBER)
_POINTS = (np.zeros((2, 3)), np.zeros((1, 2, 2)), np.zeros((2, 3, 5)), 1.0, *RAGGED)


def _points(*more: int) -> np.ndarray:
    return np.random.default_rng(0).random(more or (2, 3, 2))


CALLS = (
    Call(
        "walks.WalkConfig",
        lambda w: {},
        {"offspring": whole(0), "states": whole(0), "seed": SEED},
    ),
    Call("walks.TopFraction", lambda w: {"fraction": 0.5}, {"fraction": _FRACTION, "ties": UNKNOWN}),
    Call("walks.AtLeast", lambda w: {"threshold": 0.5}, {"threshold": NOT_A_NUMBER}),
    Call("walks.run_seed", lambda w: {"seed": 0, "run": 1}, {"seed": SEED, "run": SEED}),
    Call(
        "walks.draw_starts",
        lambda w: {"genotypes": w.genotypes, "config": w.walk, "runs": 2},
        {
            "genotypes": (np.zeros(3), np.zeros((0, 3)), *RAGGED),
            "runs": (0, -1, [], [-1], [0.5], "two", [[0, 1]]),
        },
    ),
    Call(
        "walks.walk",
        lambda w: {"domain": w.arm, "mutate": w.mutate, "config": w.walk, "runs": 2, "steps": 1},
        {
            "runs": (0, -1, [], [-1], [0.5], "two", [[0, 1]]),
            "steps": whole(-1),
            "genotypes": (np.zeros((3, 10)), np.zeros((2, 9)), np.full((2, 10), np.nan), *RAGGED),
        },
    ),
    Call(
        "walk",
        lambda w: {"domain": w.arm, "mutate": w.mutate, "config": w.walk, "runs": 1, "steps": 0},
        {"runs": (0,), "steps": (-1,)},
    ),
    Call(
        "walks.WalkResult.series", lambda w: {"self": w.walked, "measure": "coverage"}, {"measure": UNKNOWN}
    ),
    Call("walks.diversity.make", lambda w: {"name": "knn"}, {"name": UNKNOWN}),
    Call("walks.diversity.KNearest", lambda w: {}, {"k": whole(0)}),
    Call(
        "walks.diversity.OffspringNiches", lambda w: {}, {"offspring": whole(0), "lineages": (11, *whole(0))}
    ),
    Call(
        "walks.diversity.KernelDensity",
        lambda w: {},
        {
            "bandwidth": (*POSITIVE, ((1.0, 0.0), (0.0, 1.0))),
            "mode": UNKNOWN,
            "decay": (0.0, 1.1, *NOT_A_NUMBER),
        },
    ),
    Call(
        "walks.diversity.KernelDensity",
        lambda w: {"mode": "matrix", "bandwidth": ((1.0, 0.0), (0.0, 1.0))},
        {
            "bandwidth": (
                0.5,
                ((1.0, 0.0),),
                ((1.0, 0.5), (0.0, 1.0)),
                ((1.0, 1.0), (1.0, 1.0)),
                ((np.nan, 0.0), (0.0, 1.0)),
                ((1.0, 0.0), (0.0,)),
            )
        },
    ),
    Call(
        "walks.diversity.ArchiveRule",
        lambda w: {},
        {
            "limit": whole(0),
            "entry": UNKNOWN,
            "probability": _FRACTION,
            "count": whole(0),
            "scope": UNKNOWN,
        },
    ),
    Call("walks.diversity.ArchiveRule", lambda w: {"count": 3}, {"probability": (0.5,)}),
    Call(
        "walks.diversity.knn_distance",
        lambda w: {"query": _points(), "pool": _points(2, 5, 2), "k": 2},
        {
            "query": _POINTS,
            "pool": _POINTS,
            "k": whole(0),
            "itself": ([0], [0, 1, 5], [0, 1, -2], [0, 1, 0.5], "none"),
        },
    ),
    Call(
        "walks.diversity.kernel_density",
        lambda w: {"query": _points(), "pool": _points(2, 5, 2), "matrix": np.eye(2)},
        {
            "query": _POINTS,
            "pool": _POINTS,
            "matrix": (np.eye(3), 1.0, -np.eye(2), np.full((2, 2), np.nan), *RAGGED),
            "weight": ([1.0], np.ones((2, 4)), *RAGGED),
            "itself": ([0], [0, 1, 5], [0, 1, -2], [0, 1, 0.5]),
        },
    ),
    Call(
        "walks.diversity.parent_distance",
        lambda w: {"query": _points(), "parent": _points()},
        {"query": (np.zeros((2, 3)), *RAGGED), "parent": (np.zeros((2, 3)), *RAGGED)},
    ),
    Call(
        "walks.diversity.ancestor_distance",
        lambda w: {"query": _points(), "path": _points(2, 1, 4, 2), "lineage": [0, 0, 0]},
        {
            "query": (np.zeros((2, 3)), *RAGGED),
            "path": (np.zeros((2, 3)), np.zeros((2, 1, 4, 3)), *RAGGED),
            "lineage": ([0], [0, 0, 1], [0, 0, -1], [0, 0, 0.5]),
        },
    ),
)


@pytest.mark.parametrize(("call", "parameter", "value"), rows(*CALLS))
def test_a_bad_value_is_refused_in_one_sentence(call: Call, parameter: str, value: Any, world: World) -> None:
    check_refused(call, parameter, value, world)


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.name)
def test_the_other_arguments_are_good(call: Call, world: World) -> None:
    check_accepted(call, world)


def test_an_archive_of_walks_is_of_whole_numbers() -> None:
    """The rule keeps what it was given, so that a study can be written and read back."""
    assert ArchiveRule(limit=3, count=2).limit == 3
