"""Bad input of figures and of the explorer."""

# every row of a table takes the world, whether it needs it or not
from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nichechain.domains import Motion
from nichechain.studies.searches import read_searches

from .table import (
    LINEAGES,
    NOT_A_NUMBER,
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

_THRESHOLD = (-0.1, 1.5, *NOT_A_NUMBER)
_NO_NICHES = ([], list(range(20)), [99], [(9, 9)], 3, np.array(3))
_WALKS = {"measure": UNKNOWN, "conditions": (["no-such-condition"], 3, np.array(3)), "unit": (3, np.zeros(2))}


def _no_runs(w: World) -> Any:
    return w.records.iloc[:0]


def _motion() -> Motion:
    return Motion({"hand": np.zeros((3, 2))}, None, 10.0)


_RECORDS = (Made(_no_runs, "no-runs"), Made(lambda w: w.births, "births"), 3, {}, np.zeros(3))
_STEP = (-1, 99, "last", 0.0, np.zeros(2))

CALLS = (
    Call(
        "plots.plot_generations",
        lambda w: {"chain": w.chain, "ax": w.axes(), "niches": [0], "lineages": 2, "longest": 2, "draws": 1},
        {
            "niches": _NO_NICHES,
            "lineages": whole(0),
            "longest": (2**63, *whole(0)),
            "draws": (10**400, *whole(0)),
            "seed": LINEAGES["seed"],
        },
    ),
    Call(
        "plots.plot_lineages",
        lambda w: {"chain": w.chain, "ax": w.axes(), "niches": [0], "l": 2, "most": 10, "draws": 1},
        {
            "niches": _NO_NICHES,
            "l": whole(0),
            "most": (2**63, *whole(1)),
            "draws": (2**63, *whole(0)),
            "seed": LINEAGES["seed"],
        },
    ),
    Call(
        "plots.plot_reachability",
        lambda w: {"archive": w.archive, "chain": w.chain, "ax": w.axes()},
        {"threshold": SHARE, "most": whole(0)},
    ),
    Call(
        "plots.plot_motion",
        lambda w: {"archive": w.archive, "motion": _motion(), "ax": w.axes()},
        {"niche": (-1, 99, (9, 9), "0"), "upto": (-1, 99, 0.5)},
    ),
    Call(
        "plots.watch_elite",
        lambda w: {
            "archive": w.archive,
            "niche": int(w.archive.elites.niche[0]),
            "out": f"{w.fresh()}.png",
        },
        {"niche": (-1, 99, (9, 9), "0"), "out": ("film.avi", "film")},
    ),
    *(
        Call(
            f"plots.classes.{name}",
            lambda w: {"archive": w.archive, "chain": w.archive.chain("mle"), "ax": w.axes()},
            {"threshold": _THRESHOLD},
        )
        for name in ("plot_classes", "plot_transitions_by_class")
    ),
    Call(
        "plots.plot_evolvability",
        lambda w: {"archive": w.archive, "scores": w.archive_scores, "ax": w.axes()},
        {"min_births": ("three", np.nan, 1.5)},
    ),
    Call(
        "plots.plot_reach",
        lambda w: {"archive": w.archive, "reach": w.reached, "ax": w.axes(), "niche": 0},
        {"niche": (-1, 99, (9, 9), "0")},
    ),
    Call(
        "plots.plot_calibration",
        lambda w: {"check": w.check, "ax": w.axes(), "generation": 1},
        {"generation": (*whole(0), 3)},
    ),
    Call(
        "plots.plot_walks", lambda w: {"records": w.records, "ax": w.axes()}, {"records": _RECORDS, **_WALKS}
    ),
    Call(
        "plots.plot_runs",
        lambda w: {"records": w.records, "ax": w.axes(), "step": 0},
        {"records": _RECORDS, "step": _STEP, **_WALKS},
    ),
    Call(
        "plots.plot_filled",
        lambda w: {"records": read_searches(w.selections)[1].to_pandas(), "ax": w.axes()},
        {
            "records": (Made(lambda w: w.births, "births"), 3, {}, np.zeros(3)),
            "selections": (("no-such-thing",), 3, (10**30,), (np.zeros(2),)),
        },
    ),
    Call(
        "plots.draw_study",
        lambda w: {"records": w.records, "step": 0},
        {
            "records": _RECORDS,
            "step": _STEP,
            "conditions": _WALKS["conditions"],
            "unit": (3,),
            "title": (3,),
            "main": ("no-such-thing",),
        },
    ),
    Call(
        "plots.explorer.page.write_explorer",
        lambda w: {"archive": w.archive, "chain": w.chain, "out": w.fresh(), "draws": 1},
        {
            **LINEAGES,
            "l": (10_000, *whole(0)),
            "lineages": (10**9, *whole(0)),
            "draws": whole(0),
            "films": ("/no/such/folder", 3),
            "out": (Made(lambda w: w.folder, "a-folder"), 3, "a" * 300),
            "beside": (1, ("one",), (1, 2)),
        },
    ),
)


@pytest.mark.parametrize(("call", "parameter", "value"), rows(*CALLS))
def test_a_bad_value_is_refused_in_one_sentence(call: Call, parameter: str, value: Any, world: World) -> None:
    check_refused(call, parameter, value, world)


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.name)
def test_the_other_arguments_are_good(call: Call, world: World) -> None:
    check_accepted(call, world)
