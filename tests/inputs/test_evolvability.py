"""Bad input of l-evolvability and of what is asked of a whole archive."""

# every row of a table takes the world, whether it needs it or not
from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from .table import (
    LINEAGES,
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

_BAD_NICHE = (-1, 7, (9, 9), (0,), "0,0", 1.5, None)
_SHARES = ([1.0], [0.5, 0.6, 0, 0, 0, 0], [-1.0, 2.0, 0, 0, 0, 0], [np.nan] * 6, *RAGGED)
_ASKED = {"method": UNKNOWN, "convention": UNKNOWN, "repeats": whole(0), "draws": whole(0), **LINEAGES}

CALLS = (
    Call("l_evolvability", lambda w: {"chain": w.estimated, "niche": 0}, {"niche": _BAD_NICHE, **_ASKED}),
    Call(
        "evolvability.l_evolvability",
        lambda w: {"chain": w.estimated, "offspring": [1.0, 0, 0, 0, 0, 0]},
        {"offspring": _SHARES, "niche": (0,)},
    ),
    Call("evolvability.Question", lambda _: {}, _ASKED),
    Call("niche_evolvability", lambda w: {"chain": w.estimated}, _ASKED),
    Call(
        "genotype_evolvability",
        lambda w: {"archive": w.archive, "elite": w.elite, "offspring": 2, "draws": 2},
        {
            "offspring": (10**30, *whole(-1)),
            "first_generation": UNKNOWN,
            "strength": POSITIVE,
            **_ASKED,
        },
    ),
    Call(
        "evolvability.meta_evolvability",
        lambda w: {"archive": w.archive, "elite": w.elite, "children": 3, "offspring": 2},
        {
            "children": whole(1),
            "offspring": (10**30, *whole(0)),
            "lineages": (3, *whole(0)),
            "seed": SEED,
        },
    ),
    Call(
        "elite_evolvability",
        lambda w: {"archive": w.archive, "draws": 2},
        {"strength": POSITIVE, "convention": UNKNOWN, "draws": whole(0), **LINEAGES},
    ),
    Call(
        "prior_sensitivity",
        lambda w: {"counts": w.counts, "draws": 1},
        {"convention": UNKNOWN, "draws": whole(0), "factor": (1.0, 0.5, np.inf, *NOT_A_NUMBER), **LINEAGES},
    ),
    Call(
        "bootstrap_elites",
        lambda w: {"counts": w.counts, "draws": 1, "resamples": 2},
        {"convention": UNKNOWN, "draws": whole(0), "resamples": whole(1), **LINEAGES},
    ),
    Call(
        "evolvability.NicheEvolvability.ranking",
        lambda w: {"self": w.scores, "chain": w.estimated},
        {"min_births": ("three", np.nan)},
    ),
)


@pytest.mark.parametrize(("call", "parameter", "value"), rows(*CALLS))
def test_a_bad_value_is_refused_in_one_sentence(call: Call, parameter: str, value: Any, world: World) -> None:
    check_refused(call, parameter, value, world)


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.name)
def test_the_other_arguments_are_good(call: Call, world: World) -> None:
    check_accepted(call, world)
