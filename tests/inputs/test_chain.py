"""Bad input of the chain: matrices, counts, estimators, and what is asked of a chain."""

# ruff: noqa: ARG005  # every row of a table takes the world, whether it needs it or not

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import sparse

from nichechain import NicheChain, NichechainError
from nichechain.chain import TransitionCounts
from nichechain.chain.structure.wormholes import wormholes
from nichechain.niches import GridNiches

from .table import (
    LINEAGES,
    NOT_A_NUMBER,
    RAGGED,
    SEED,
    SHARE,
    UNKNOWN,
    Call,
    Made,
    World,
    check_refused,
    rows,
    whole,
)

_BAD_NICHE = (-1, 7, (9, 9), (0,), "0,0", 1.5)
_OTHER = GridNiches((3, 2), ((0.0, 3.0), (0.0, 1.0)))
_THRESHOLD = (-0.1, 1.0, 1.5, *NOT_A_NUMBER)
_SHARES = ([1.0], [0.5, 0.6, 0, 0, 0, 0], [-1.0, 2.0, 0, 0, 0, 0], [np.nan] * 6, *RAGGED)
_ROOT = {"niche": _BAD_NICHE, "convention": UNKNOWN, **LINEAGES}

_APART = NicheChain(np.eye(2))
_NO_POSTERIOR = Made(lambda w: w.given, "no-posterior")


def _at(function: str, **bad: Any) -> Call:
    return Call(function, lambda w: {"chain": w.estimated}, bad)


CALLS = (
    Call(
        "NicheChain",
        lambda w: {"transition": np.eye(3)},
        {
            "transition": (
                None,
                *RAGGED,
                [[0.5, 0.6], [0.5, 0.5]],
                [[-0.5, 1.5], [0.5, 0.5]],
                [[np.nan, 1.0], [0.5, 0.5]],
                [[np.inf, 1.0], [0.5, 0.5]],
                [1.0],
                [[]],
                [[1.0, 0.0]],
                sparse.csr_array([[0.5, 0.4], [0.5, 0.5]]),
                np.ones((2, 2, 2)),
                np.array([["a", "b"], ["c", "d"]]),
            ),
            "outside": (0, 3, -1, "last"),
            "niches": (_OTHER,),
            "posterior": (Made(lambda w: w.estimated.posterior, "two-of-them"),),
        },
    ),
    Call(
        "NicheChain",
        lambda w: {"transition": np.eye(3), "normalize": True},
        {"transition": ([[1.0, 1.0], [0.0, 0.0]], [[1j, 0], [0, 1]])},
    ),
    Call("NicheChain.state", lambda w: {"self": w.estimated, "niche": 0}, {"niche": _BAD_NICHE}),
    Call("NicheChain.graph", lambda w: {"self": w.estimated}, {"threshold": SHARE}),
    Call(
        "NicheChain.niche_evolvability",
        lambda w: {"self": w.estimated},
        {"l": whole(0), "lineages": whole(0)},
    ),
    Call(
        "TransitionCounts.from_births",
        lambda w: {"parent": [0, 1], "child": [1, 2], "niches": w.niches},
        {
            "parent": ([0], [[0, 1]], [0, 7], [0, -2], [0, 0.5], [0, np.nan], ["a", "b"], [[0], [1, 2]]),
            "child": ([0], [[0, 1]], [0, 7], [0, -2], [0, 0.5], [0, np.inf], ["a", "b"]),
            "elite": ([0], [0, 0.5], ["a", "b"]),
        },
    ),
    Call(
        "TransitionCounts.from_trajectories",
        lambda w: {"trajectories": [[0, 1, 2], [3]], "niches": w.niches},
        {
            "trajectories": (
                *(3, [3], [[0, 7]], [[0.5]], [["a"]], [[[0], [1, 2]]], [[-1, 0]]),
                *(np.array(3), sparse.coo_matrix(np.eye(2))),
            )
        },
    ),
    Call(
        "TransitionCounts.from_matrix",
        lambda w: {"matrix": np.eye(7), "niches": w.niches},
        {"matrix": (np.eye(6), -np.eye(7), 0.5 * np.eye(7), 1j * np.eye(7), np.full((7, 7), 1e18), *RAGGED)},
    ),
    Call(
        "TransitionCounts.from_pairs",
        lambda w: {"parent": [0, 1], "child": [1, 2], "niches": w.niches},
        {
            "parent": ([0], [0, 7], [0, -1], [0, 0.5], ["a", "b"]),
            "child": ([0], [0, 7], [0, -1], [0, 0.5], ["a", "b"]),
            "n": ([1], [1, -1], [1, 0.5], [1, np.nan], ["a", "b"]),
        },
    ),
    Call(
        "TransitionCounts.__add__",
        lambda w: {"self": w.counts, "other": w.counts},
        {"other": (TransitionCounts.from_pairs([0], [1], _OTHER),)},
    ),
    Call(
        "estimate",
        lambda w: {"counts": w.counts},
        {
            "estimator": UNKNOWN,
            "unvisited": ("self",),
            "strength": (0.0, -1.0, np.nan, np.inf, "jeffreys", "three"),
        },
    ),
    Call(
        "chain.estimators.estimate",
        lambda w: {"counts": w.counts, "estimator": "mle"},
        {"unvisited": UNKNOWN, "strength": (1.0,)},
    ),
    Call(
        "chain.estimate",
        lambda w: {"counts": w.counts, "estimator": "dirichlet"},
        {"unvisited": ("base",), "strength": (0.0, -1.0, np.nan, "three", [1.0])},
    ),
    _at("chain.structure.classes.communicating_classes", threshold=_THRESHOLD),
    _at("chain.structure.classes.recurrent_classes", threshold=_THRESHOLD),
    _at("chain.structure.graph.betweenness", threshold=SHARE),
    _at("chain.structure.graph.reachability_graph", threshold=SHARE),
    Call(
        "chain.structure.passage.hitting_probabilities",
        lambda w: {"chain": w.estimated, "target": 0},
        {"target": (*_BAD_NICHE, [], [0, 99], None)},
    ),
    Call(
        "chain.structure.passage.mean_first_passage_times",
        lambda w: {"chain": w.estimated, "target": 0},
        {"target": (*_BAD_NICHE, [], [0, 99], None)},
    ),
    Call(
        "chain.structure.quasi_stationary.quasi_stationary_distribution",
        lambda w: {"chain": w.estimated, "states": [0, 1]},
        {"states": (*_BAD_NICHE, [], [0, 99])},
    ),
    Call(
        "chain.structure.stationary.long_run_distribution",
        lambda w: {"chain": w.estimated, "root": 0},
        {"root": (*_BAD_NICHE, [], [0, 99], None)},
    ),
    *(
        Call(
            f"chain.structure.committors.{name}",
            lambda w: {"chain": w.estimated, "source": 0, "target": [1, 2]},
            {
                "source": (*_BAD_NICHE, [], [0, 99], None, 1),
                "target": (*_BAD_NICHE, [], [1, 99], None, [0, 1]),
            },
        )
        for name in ("committor", "reactive_flux")
    ),
    _at("chain.structure.timescales.implied_timescales", k=whole(0)),
    Call(
        "chain.structure.metastable.metastable_sets",
        lambda w: {"chain": _APART, "groups": 2},
        {"groups": (*whole(1), 3, 1)},
    ),
    Call(
        "chain.structure.intervals.posterior_interval",
        lambda w: {"chain": w.estimated, "question": lambda chain: chain.states, "draws": 2},
        {
            "chain": (_NO_POSTERIOR,),
            "question": ("how long", 3, None),
            "draws": whole(1),
            "level": (0.0, 1.0, 90, *NOT_A_NUMBER),
            "seed": SEED,
        },
    ),
    Call(
        "chain.structure.wormholes.wormhole_exposure",
        lambda w: {"chain": w.estimated, "found": wormholes(w.estimated), "l": 2},
        {
            "found": (
                Made(lambda w: wormholes(w.estimated).drop(columns="child"), "no-column"),
                Made(lambda w: wormholes(w.estimated).assign(child=99, wormhole=True), "no-state"),
            ),
            "l": whole(0),
        },
    ),
    _at(
        "evolvability.where_to_sample.where_to_sample",
        chain=(_NO_POSTERIOR,),
        births=whole(0),
        draws=whole(1),
        **_ROOT,
    ),
    _at(
        "evolvability.where_to_sample.evolvability_derivative",
        **{name: values for name, values in _ROOT.items() if name != "seed"},
    ),
    Call(
        "validation.held_out.compare_estimators",
        lambda w: {"counts": w.counts},
        {"folds": (*whole(1), 10_000), "seed": SEED},
    ),
    Call(
        "validation.contrast.contrast",
        lambda w: {"first": w.table, "second": w.table, "niches": w.archive.niches, "resamples": 2},
        {
            "first": (np.array(3), [], [3], Made(lambda w: w.table.slice(0, 0), "no-births")),
            "second": (np.array(3), Made(lambda w: w.table.drop_columns(["child_niche"]), "no-column")),
            "niches": (_OTHER,),
            "min_births": (*whole(-1)[1:], 10_000),
            "resamples": whole(1),
            "draws": whole(0),
            **LINEAGES,
        },
    ),
    Call(
        "validation.drift.level_drift",
        lambda w: {"births": w.table, "niches": w.archive.niches, "min_births": 1, "draws": 2},
        {
            "births": (
                Made(lambda w: w.table.slice(0, 0), "no-births"),
                Made(lambda w: w.table.drop_columns(["step"]), "no-column"),
            ),
            "niches": (_OTHER,),
            "min_births": (*whole(-1)[1:], 10_000),
            "draws": whole(1),
            "like": ("all", 5),
            **LINEAGES,
        },
    ),
    Call(
        "validation.drift.level_course",
        lambda w: {"births": w.table, "niches": w.archive.niches, "parts": 2, "min_births": 1, "draws": 2},
        {
            "births": (Made(lambda w: w.table.slice(0, 0), "no-births"),),
            "niches": (_OTHER,),
            "parts": (10**30, 10**9, *whole(1)),
            "min_births": (*whole(-1)[1:], 10_000),
            "draws": whole(1),
            "like": ("all", 5),
            **LINEAGES,
        },
    ),
    Call(
        "validation.stability.rank_stability",
        lambda w: {"counts": w.counts, "fractions": (0.5,), "repeats": 1, "draws": 1},
        {
            "fractions": ((), (0.0,), (1.0,), (-0.5,), (np.nan,), ("half",)),
            "thin": UNKNOWN,
            "repeats": whole(0),
            "min_births": (-1, 10_000, *whole(0)[2:]),
            "estimator": UNKNOWN,
            "draws": whole(0),
            **LINEAGES,
        },
    ),
    _at(
        "chain.structure.wormholes.wormholes",
        chain=(_NO_POSTERIOR,),
        beyond=UNKNOWN,
        times=(0.9, -1.0, np.inf, *NOT_A_NUMBER),
        expected_false=(-0.1, *NOT_A_NUMBER),
    ),
    Call(
        "chain.filters.counts_of",
        lambda w: {"births": w.table, "niches": w.archive.niches},
        {
            "births": (Made(lambda w: w.table.drop_columns(["parent_niche"]), "no-column"),),
            "niches": (_OTHER,),
            "run": (-1, 99, "first", 0.5),
            "steps": ((3, 1), (-1, 2), (1,), (0, 0.5), "all"),
        },
    ),
    Call(
        "evolvability.reach.reach",
        lambda w: {"chain": w.estimated, "niche": 0},
        {"offspring": ([1.0],), "draws": whole(0), **_ROOT},
    ),
    Call(
        "evolvability.reach.reach",
        lambda w: {"chain": w.estimated},
        {"niche": (None,), "offspring": _SHARES},
    ),
    Call(
        "evolvability.visits.visit_metrics",
        lambda w: {"chain": w.estimated, "niche": 0},
        {"offspring": ([1.0],), "repeats": whole(0), "draws": whole(0), **_ROOT},
    ),
    Call(
        "evolvability.visits.uniformity",
        lambda w: {"visits": [1, 2]},
        {"visits": (*RAGGED, [1, -1], 3.0, [])},
    ),
    Call(
        "evolvability.visits.visit_entropy",
        lambda w: {"visits": [1, 2]},
        {"visits": (*RAGGED, [1, -1], 3.0, [])},
    ),
    Call(
        "evolvability.coverage.expected_coverage",
        lambda w: {"transition": w.given.T, "first": w.given.T, "steps": 2, "lineages": 3},
        {
            "steps": whole(0),
            "lineages": (*whole(0), [], [0, 1]),
            "counted": (-1, 4, *whole(0)[2:]),
            "columns": whole(0),
        },
    ),
    *(
        Call(
            f"evolvability.coverage.{name}",
            lambda w: {
                "transition": w.given.T,
                "roots": [0, 1],
                "longest": 2,
                "lineages": [3],
                "counted": 3,
            },
            {
                "roots": ([3], [-1], [0.5], "three"),
                "longest": (10**30, *whole(0)),
                "lineages": ([], [0, 1], [0.5], "three"),
                "counted": (-1, 4, *whole(0)[2:]),
            },
        )
        for name in ("coverage_by_generation",)
    ),
    Call(
        "evolvability.coverage.sampled_coverage",
        lambda w: {
            "transition": w.given.T,
            "first": np.array([1.0, 0.0, 0.0]),
            "steps": 2,
            "lineages": 3,
            "repeats": 2,
            "rng": w.rng,
        },
        {
            "steps": whole(0),
            "lineages": (10**30, *whole(0)),
            "repeats": whole(0),
            "counted": (-1, 4, 1.5),
        },
    ),
    Call(
        "evolvability.coverage.rarefied_coverage",
        lambda w: {"counts": [1, 2, 3], "size": 2},
        {
            "counts": ([0, 0], *RAGGED, [1, -1, 3], [0.5, 3.0]),
            "size": (0, 7, -1, *whole(0)[2:]),
            "counted": (-1, 4, 1.5),
        },
    ),
)


@pytest.mark.parametrize(("call", "parameter", "value"), rows(*CALLS))
def test_a_bad_value_is_refused_in_one_sentence(call: Call, parameter: str, value: Any, world: World) -> None:
    check_refused(call, parameter, value, world)


@pytest.mark.parametrize(
    "call", [call for call in CALLS if "contrast" not in call.name], ids=lambda c: c.name
)
def test_the_other_arguments_are_good(call: Call, world: World) -> None:
    """What is refused above is refused for the one value that was changed."""
    arguments = call.good(world)
    if "niche" in call.bad and None in call.bad["niche"]:
        arguments["niche"] = 0
    call.function(**arguments)


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
@pytest.mark.parametrize("n", [2, 30, 300])
def test_rows_may_miss_one_by_what_rounding_explains(kind: Any, n: int) -> None:
    """Shares in a coarse format sum to 1 only so far: the tolerance grows with n and with the format."""
    rng = np.random.default_rng(0)
    matrix = rng.random((n, n))
    matrix = (matrix / matrix.sum(axis=1, keepdims=True)).astype(kind)
    chain = NicheChain(matrix)
    assert chain.states == n
    allowed = 8 * n * np.finfo(kind).eps + 1e-12
    worse = matrix.astype(np.float64)
    worse[0] *= (1.0 + 2.0 * allowed) / worse[0].sum()
    if kind is np.float64:
        with pytest.raises(NichechainError, match="row 0 of T sums to"):
            NicheChain(worse)
