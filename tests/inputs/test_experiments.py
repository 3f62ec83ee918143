"""Bad input of experiments and of the validation of a chain."""

# ruff: noqa: ARG005  # every row of a table takes the world, whether it needs it or not
from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nichechain.studies import Condition
from nichechain.studies.searches import read_searches

from .table import (
    NOT_A_NUMBER,
    POSITIVE,
    RAGGED,
    SEED,
    SHARE,
    UNKNOWN,
    Call,
    Made,
    World,
    check_accepted,
    check_refused,
    rows,
    whole,
)

_BOOTSTRAP = {"seed": SEED, "resamples": (10**9, *whole(0))}
# What no folder can be called, and what is none.
_FOLDER = ("/no/such/folder", "/dev/null/folder", "folder" * 100, "a\0b", 3, None, np.zeros(2))
_RUNS = ([1.0], [[1.0, 2.0, 3.0]], [1.0, np.nan, 2.0], [1.0, np.inf, 2.0], *RAGGED)
_GROUPS = {"a": [1.0, 2.0, 3.0], "b": [2.0, 4.0, 5.0]}
_BAD_GROUPS = (
    3,
    [[1.0, 2.0], [3.0, 4.0]],
    {},
    {"a": [1.0, 2.0]},
    {"a": [1.0], "b": [1.0, 2.0]},
    {"a": [1.0, 1.0], "b": [1.0, 1.0]},
    {"a": [1.0, np.nan], "b": [1.0, 2.0]},
    {"a": "three", "b": [1.0, 2.0]},
)
_LABEL = Condition("a")
_TEST = {"permutations": (10**9, *whole(0)), "seed": SEED}

CALLS = (
    Call(
        "studies.Condition",
        lambda w: {"label": "a"},
        {
            "label": ("", "--", "a\x1b[31m", "a" * 101, b"a", 3, np.zeros(2)),
            "level": (*UNKNOWN, "1.5", "0", "nan", 10**400, np.zeros(2)),
            "metric": UNKNOWN,
            "offspring": whole(0),
            "mutation": UNKNOWN,
            "scale": POSITIVE,
            "step_bound": ("rescaled", "rescaled:0", "no-such-kind:1", 3, np.zeros(2)),
            "k": whole(0),
            "mode": UNKNOWN,
            "archive_limit": whole(0),
            "archive_scope": (*UNKNOWN, np.zeros(2)),
            "states": whole(0),
            "litter": whole(0),
            "initialisation": (*UNKNOWN, "normal:0", "normal:x", "elites:"),
        },
    ),
    Call(
        "studies.Condition",
        lambda w: {"label": "a", "metric": "parent"},
        {"bandwidth": POSITIVE, "decay": (0.0, 1.1, *NOT_A_NUMBER), "k": whole(0)},
    ),
    Call(
        "studies.Study",
        lambda w: {
            "kind": "pressure",
            "domain": "arm",
            "conditions": (_LABEL,),
            "runs": 1,
            "steps": 1,
            "shape": (2, 2),
            "bounds": ((0, 1), (0, 1)),
        },
        {
            "kind": UNKNOWN,
            "conditions": ((), (_LABEL, _LABEL), 3, ("a",)),
            "runs": whole(0),
            "steps": whole(-1),
            "seed": SEED,
            "domain_seed": SEED,
            "shape": ((2,), (0, 2), ("a", 2), (10**30, 2)),
            "bounds": (((0, 1),), ((1, 0), (0, 1)), "0,1"),
        },
    ),
    Call(
        "studies.Study",
        lambda w: {
            "kind": "population",
            "domain": "arm",
            "conditions": (Condition("a", states=2),),
            "runs": 1,
            "steps": 1,
            "shape": (2, 2),
            "bounds": ((0, 1), (0, 1)),
        },
        {"conditions": ((_LABEL,), (Condition("a", states=1),))},
    ),
    Call(
        "studies.pressure_of", lambda w: {"level": "0.5"}, {"level": ("better", "2", np.zeros(2), *UNKNOWN)}
    ),
    Call("studies.selection_of", lambda w: {"level": "0.5"}, {"level": ("0", "2", np.zeros(2), *UNKNOWN)}),
    Call("studies.condition_seed", lambda w: {"seed": 0, "label": "a"}, {"seed": SEED, "label": (3,)}),
    Call(
        "studies.pressure_conditions",
        lambda w: {"levels": ("0.5",), "base": _LABEL},
        {"levels": (3, ("2",), ("no-such-thing",))},
    ),
    Call(
        "studies.metric_conditions",
        lambda w: {"metrics": ("knn",), "base": _LABEL},
        {"metrics": (3, ("no-such-thing",))},
    ),
    Call("studies.variations", lambda w: {"name": "k", "base": _LABEL}, {"name": UNKNOWN}),
    Call(
        "studies.initialise",
        lambda w: {"domain": w.arm, "scheme": "normal:0.1", "n": 2, "seed": 0},
        {
            "scheme": (*UNKNOWN, "normal:-1", "orthogonal", "elites:/no/such/folder"),
            "n": (10**30, *whole(-1)),
            "seed": SEED,
        },
    ),
    Call("studies.read_study", lambda w: {"folder": w.study}, {"folder": _FOLDER}),
    Call("studies.read_records", lambda w: {"folder": w.study}, {"folder": _FOLDER}),
    Call("studies.read_births", lambda w: {"folder": w.study}, {"folder": _FOLDER}),
    Call(
        "studies.searches.SelectionStudy",
        lambda w: {"config": w.config},
        {
            "selections": (
                *((), ("reach",), ("uniform", "uniform"), ("uniform", "no-such-thing")),
                *("uniform", 3, np.zeros(2), ("uniform", 3)),
            ),
            "runs": whole(1),
            "elites": whole(-1),
            "offspring": whole(1),
        },
    ),
    Call(
        "studies.searches.run_searches",
        lambda w: {"study": w.selection_study, "folder": w.selections, "executor": w.here},
        {"folder": (Made(lambda w: w.log, "a-file"), 3, "folder" * 100, "a\0b")},
    ),
    Call("studies.searches.read_searches", lambda w: {"folder": w.selections}, {"folder": _FOLDER}),
    Call(
        "studies.searches.compare_selections",
        lambda w: {"study": w.selection_study, "records": read_searches(w.selections)[1]},
        {"records": (Made(lambda w: read_searches(w.selections)[1].slice(0, 0), "no-search"), 3, {})},
    ),
    Call(
        "studies.statistics.pressure_test",
        lambda w: {"pressure": [0, 0, 1, 1], "values": [1, 2, 3, 4], "resamples": 20},
        {"pressure": (*_RUNS, [1, 1, 1, 1]), "values": (*_RUNS, [1, 1, 1, 1]), **_BOOTSTRAP},
    ),
    Call(
        "studies.statistics.metric_test",
        lambda w: {"groups": _GROUPS, "resamples": 20},
        {"groups": _BAD_GROUPS, **_BOOTSTRAP},
    ),
    Call(
        "studies.statistics.paired_test",
        lambda w: {"groups": _GROUPS, "resamples": 20},
        {"groups": (*_BAD_GROUPS, {"a": [1.0, 2.0], "b": [1.0, 2.0, 3.0]}), **_BOOTSTRAP},
    ),
    Call(
        "studies.statistics.change_test",
        lambda w: {"before": [1.0, 2.0, 3.0], "after": [1.0, 4.0, 9.0]},
        {"before": (*_RUNS, [1.0, 4.0, 9.0]), "after": (*_RUNS, [1.0, 2.0, 3.0])},
    ),
    Call(
        "studies.statistics.signed_rank_test",
        lambda w: {"values": [1.0, 2.0, -3.0], "name": "r", "resamples": 20},
        {"values": (*_RUNS, [0.0, 0.0]), **_BOOTSTRAP},
    ),
    Call(
        "validation.ValidationConfig",
        lambda w: {},
        {
            "elites": whole(2),
            "lineages": whole(0),
            "l": whole(0),
            "offspring": whole(0),
            "permutations": whole(0),
            "seed": SEED,
        },
    ),
    Call(
        "validation.sample_roots",
        lambda w: {"chain": w.chain, "filled": w.filled, "size": 3, "l": 2, "lineages": 5, "min_births": 0},
        {
            "chain": (Made(lambda w: w.given, "given"),),
            "filled": ([10_000], ["a"], [0.5], [-1]),
            "size": whole(2),
            "l": whole(0),
            "lineages": whole(0),
            "min_births": (10_000, 1.5, "three"),
            "seed": SEED,
        },
    ),
    Call(
        "validation.run_lineages",
        lambda w: {
            "archive": w.archive,
            "roots": w.filled[:2],
            "executor": w.here,
            "l": 1,
            "lineages": 2,
            "offspring": 2,
        },
        {
            "roots": (Made(lambda w: np.array([10_000]), "no-such-state"), ["a"], [np.nan], [0.5]),
            "l": (10**30, *whole(0)),
            "lineages": whole(0),
            "offspring": whole(0),
            "seed": SEED,
        },
    ),
    Call(
        "validation.compare",
        lambda w: {"chain": w.chain, "lineages": w.lineages, "niches": w.archive.niches, "draws": 2},
        {"draws": whole(0), "seed": SEED},
    ),
    Call("validation.births_test", lambda w: {"triples": w.triples, "permutations": 9}, _TEST),
    Call("validation.homogeneity_test", lambda w: {"triples": w.triples, "permutations": 9}, _TEST),
    Call("validation.sibling_test", lambda w: {"triples": w.triples, "permutations": 9}, _TEST),
    Call(
        "validation.lineage_test",
        lambda w: {"triples": w.triples, "permutations": 9},
        {"depth_bins": (10**9, *whole(0)), **_TEST},
    ),
    Call(
        "validation.lineages_test",
        lambda w: {"states": np.array([[0, 1, 2], [1, 1, 0], [0, 1, 1]]), "permutations": 9},
        {"states": (np.zeros(3, int), np.zeros((3, 2), int)), **_TEST},
    ),
    Call(
        "validation.simulate_births",
        lambda w: {"chain": w.given, "births": 5, "rng": w.rng},
        {
            "births": (10**12, *whole(0)),
            "start": ([[0, 1]], 3, -1, [], [0.5], "three"),
            "batch": whole(0),
            "memory": SHARE,
            "replacement": UNKNOWN,
        },
    ),
    Call(
        "validation.simulate_lineages",
        lambda w: {"matrix": w.given.T, "first": [0, 1], "generations": 2, "rng": w.rng},
        {"first": ([3], [-1], [0.5], "three"), "generations": whole(0)},
    ),
)


@pytest.mark.parametrize(("call", "parameter", "value"), rows(*CALLS))
def test_a_bad_value_is_refused_in_one_sentence(call: Call, parameter: str, value: Any, world: World) -> None:
    check_refused(call, parameter, value, world)


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.name)
def test_the_other_arguments_are_good(call: Call, world: World) -> None:
    check_accepted(call, world)
