"""Bad input of domains, mutation operators, niches and controllers."""

# ruff: noqa: ARG005  # every row of a table takes the world, whether it needs it or not
from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from nichechain.domains import PlanarArm
from nichechain.variation import Bound
from nichechain.variation.noise import CauchyNoise

from .table import (
    NOT_A_NUMBER,
    POSITIVE,
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

_BOX = ((0.0, 1.0), (0.0, 2.0))


def _file(world: World, name: str, text: str) -> Any:
    path = world.folder / name
    path.write_text(text)
    return path


_BAD_BOUNDS = (
    ((0.0, 1.0),),
    ((0.0, 0.0), (0.0, 1.0)),
    ((1.0, 0.0), (0.0, 1.0)),
    ((0.0, np.nan), (0.0, 1.0)),
    ((0.0, np.inf), (0.0, 1.0)),
    (0.0, 1.0),
    ((0.0,), (1.0,)),
    (("a", "b"), ("c", "d")),
    "0,1,0,1",
    None,
)
_BEHAVIOR = (np.zeros(2), np.zeros((1, 3)), [[np.nan, 0.0]], [[np.inf, 0.0]], 1.0, *RAGGED)
_BAD_NICHE = (-1, 6, (9, 9), (0,), "0,0", 1.5, None)
_GENOTYPES = (np.zeros(10), np.zeros((2, 9)), np.zeros((1, 2, 10)), 1.0, "three", [[0.0], [0.0, 1.0]])
_NOISE = (-0.1, np.inf, *NOT_A_NUMBER)

CALLS = (
    Call(
        "GridNiches",
        lambda w: {"shape": (3, 2), "bounds": _BOX},
        {
            "shape": ((3,), (0, 2), (-1, 2), (), (2.5, 2), ("a", 2), 3, "3x2", None, (10**6, 10**6)),
            "bounds": _BAD_BOUNDS,
            "outside": UNKNOWN,
            "epsilon": (-1e-6, float("inf"), *NOT_A_NUMBER),
        },
    ),
    Call(
        "niches.read_centroids",
        lambda w: {"path": _file(w, "good.csv", "0.1,0.2\n0.3,0.4\n")},
        {
            "path": (
                "/no/such/file.csv",
                *(
                    Made(lambda w, name=name, text=text: _file(w, name, text), name)
                    for name, text in (
                        ("a.json", "[]"),
                        ("b.csv", "x\na,b\n"),
                        ("c.npy", "no"),
                        ("d.txt", ""),
                    )
                ),
            )
        },
    ),
    Call(
        "domains.watch",
        lambda w: {"domain": PlanarArm(joints=2), "genotype": [0.1, 0.2]},
        {"genotype": ([], [0.1], [[0.1, 0.2]], [np.nan, 0.0], ["a", "b"])},
    ),
    Call("niches.GridNiches.of", lambda w: {"self": w.niches, "behavior": [[0, 0]]}, {"behavior": _BEHAVIOR}),
    Call("niches.GridNiches.flat", lambda w: {"self": w.niches, "niche": 0}, {"niche": _BAD_NICHE}),
    Call("niches.GridNiches.index", lambda w: {"self": w.niches, "flat": 0}, {"flat": (-1, 6, "0", 1.5)}),
    Call(
        "niches.GridNiches.label",
        lambda w: {"self": w.niches, "state": 0},
        {"state": (-1, 7, "0", 1.5, 1j * np.eye(2))},
    ),
    Call(
        "niches.GridNiches.as_grid",
        lambda w: {"self": w.niches, "values": np.zeros(6)},
        {"values": (np.zeros(5), np.zeros((6, 2)), 1.0)},
    ),
    Call(
        "niches.CVTNiches",
        lambda w: {"centroids": [[0.2, 0.3], [0.7, 1.1]], "bounds": _BOX},
        {
            "centroids": (
                [],
                [0.2, 0.3],
                [[0.2, 0.3, 0.4]],
                [[0.2, 0.3], [0.2, 0.3]],
                [[2.0, 0.3]],
                [[np.nan, 0.3]],
                *RAGGED,
            ),
            "bounds": _BAD_BOUNDS,
            "outside": UNKNOWN,
        },
    ),
    Call(
        "niches.CVTNiches.tessellated",
        lambda w: {"number": 3, "bounds": _BOX},
        {"number": (*whole(0), 10**12), "bounds": (*_BAD_BOUNDS[1:], ()), "seed": SEED, "outside": UNKNOWN},
    ),
    Call("niches.CVTNiches.of", lambda w: {"self": w.cvt, "behavior": [[0, 0]]}, {"behavior": _BEHAVIOR}),
    Call(
        "niches.CVTNiches.flat", lambda w: {"self": w.cvt, "niche": 0}, {"niche": (-1, 3, (0, 0), "0", 1.5)}
    ),
    Call("niches.CVTNiches.index", lambda w: {"self": w.cvt, "flat": 0}, {"flat": (-1, 3, "0", 1.5)}),
    Call(
        "niches.CVTNiches.label",
        lambda w: {"self": w.cvt, "state": 0},
        {"state": (-1, 4, "0", 1.5, 1j * np.eye(2))},
    ),
    Call(
        "niches.one_hot",
        lambda w: {"behavior": [[0, 0]], "niches": w.niches},
        {"behavior": (np.zeros((1, 3)), [], [[np.inf, 0.0]], 1.0, *RAGGED)},
    ),
    Call(
        "niches.parse_shape",
        lambda w: {"text": "3x2"},
        {"text": ("", "0x2", "3,2", "3x", "-1x2", "axb", b"3x2", np.eye(2))},
    ),
    Call(
        "niches.parse_bounds",
        lambda w: {"text": "0,1,0,2"},
        {"text": ("", "0,1,0", "1,0,0,2", "0,inf", "0,nan", "a,b", b"0,1", 3)},
    ),
    Call(
        "niches.parse_niche",
        lambda w: {"text": "1,2"},
        {"text": ("", "a", "1;2", "0.5", b"1,2", np.eye(2))},
    ),
    Call(
        "niches.parse_niches",
        lambda w: {"text": "cvt:4"},
        {"text": ("", "4", "cvt:0", "cvt:x", "grid:4", b"cvt:4", np.array(["cvt:4"]))},
    ),
    Call("domains.make", lambda w: {"name": "arm"}, {"name": ("no-such-thing", 3, b"arm"), "seed": SEED}),
    Call(
        "domains.make",
        lambda w: {"name": "arm", "joints": 3},
        {
            "joints": whole(0),
            "noise": ("action", "action:x", "wind:1", 3),
            "repeats": whole(0),
            "length": (3,),
        },
    ),
    Call("domains.PlanarArm", lambda w: {}, {"joints": whole(0), "seed": SEED}),
    Call("domains.LinearMap", lambda w: {}, {"seed": SEED}),
    Call("domains.CosinusMap", lambda w: {}, {"seed": SEED}),
    Call(
        "domains.PlanarArm.sample",
        lambda w: {"self": w.arm, "n": 2, "seed": 0},
        {"n": (10**30, *whole(-1)), "seed": SEED},
    ),
    Call(
        "domains.PlanarArm.evaluate",
        lambda w: {"self": w.arm, "genotypes": w.genotypes},
        {"genotypes": _GENOTYPES},
    ),
    Call(
        "domains.LinearMap.sample",
        lambda w: {"self": w.linear, "n": 2, "seed": 0},
        {"n": (10**30, *whole(-1)), "seed": SEED},
    ),
    Call(
        "domains.LinearMap.evaluate",
        lambda w: {"self": w.linear, "genotypes": [[0, 0]]},
        {"genotypes": _GENOTYPES},
    ),
    Call(
        "domains.CosinusMap.evaluate",
        lambda w: {"self": w.linear, "genotypes": [[0, 0]]},
        {"genotypes": _GENOTYPES},
    ),
    Call(
        "domains.GymDomain",
        lambda w: {"env_id": "MountainCarContinuous-v0", "descriptor": "final-observation:0", "steps": 2},
        {
            "env_id": ("NoSuch-v0", "no such thing", 3, np.eye(2)),
            "descriptor": ("no-such-thing", "final-observation:99", "final-observation:x"),
            "bounds": (((1.0, 0.0),), ((0.0, np.nan),), "0,1"),
            "names": (("x", "y", "z"), (3,), np.array(3)),
            "controller": ("lstm", "mlp:x", "mlp:0", np.eye(2)),
            "steps": whole(0),
            "seed": SEED,
            "repeats": whole(0),
            "observations": (("no-such-key",), np.array(3)),
            "env_options": ({"no_such_option": 1}, np.eye(2)),
        },
    ),
    *(
        Call(
            f"domains.{name}",
            lambda w: {},
            {"seed": SEED, "controller": ("lstm", "mlp:x", "mlp:0"), "cache_memory": whole(-1)},
        )
        for name in ("FetchPickAndPlace", "FetchPush", "FetchReach", "FetchSlide")
    ),
    Call("domains.Noise", lambda w: {}, {"observation": _NOISE, "action": _NOISE, "initial": _NOISE}),
    Call(
        "domains.Noise.parse",
        lambda w: {"text": "action:0.1"},
        {"text": ("", "action", "action:x", "wind:1", b"action:0.1", np.eye(2))},
    ),
    Call(
        "domains.Noisy",
        lambda w: {"domain": w.arm, "noise": w.noise},
        {"repeats": whole(0)},
    ),
    Call(
        "domains.WithSensitivity",
        lambda w: {"domain": w.noisy, "axes": ("x", "sensitivity")},
        {
            "axes": ((), ("x",), ("x", "x", "sensitivity"), ("x", "wind"), np.array(3), (3, "sensitivity")),
            "most": POSITIVE,
        },
    ),
    Call("variation.cauchy", lambda w: {}, {"scale": POSITIVE}),
    Call("variation.gaussian", lambda w: {}, {"scale": POSITIVE}),
    Call("variation.student_t", lambda w: {}, {"scale": POSITIVE, "df": POSITIVE}),
    Call("variation.uniform_ball", lambda w: {}, {"scale": POSITIVE}),
    Call("variation.noise_of", lambda w: {"name": "student-t"}, {"name": UNKNOWN, "df": POSITIVE}),
    Call("variation.noise_of", lambda w: {"name": "cauchy"}, {"df": (3.0,)}),
    Call(
        "variation.make",
        lambda w: {"name": "student-t", "scale": 1.0},
        {"name": UNKNOWN, "scale": POSITIVE, "df": POSITIVE},
    ),
    Call(
        "variation.make",
        lambda w: {"name": "uniform-ball", "scale": 1.0},
        {"bound": (Bound("per-coordinate", 1.0),)},
    ),
    Call("variation.Bound", lambda w: {"kind": "rescaled", "size": 1.0}, {"kind": UNKNOWN, "size": POSITIVE}),
    Call(
        "variation.AdditiveMutation",
        lambda w: {"noise": CauchyNoise(), "layers": (2, 3), "layer_scales": (1.0, 0.5)},
        {
            "scale": POSITIVE,
            "layers": ((2,), (2, 3, 4), np.array(3), (None, 3)),
            "layer_scales": ((1.0,), (1.0, 0.0), (1.0, np.nan), (1.0, "three"), np.array(3), (None, 1.0)),
        },
    ),
    Call(
        "variation.SelfAdaptiveMutation",
        lambda w: {"noise": CauchyNoise(), "layers": (2, 3)},
        {"layers": ((), (0, 2), (1.5, 2), ("a",), np.array(3), np.array([2**64 - 1, 0], np.uint64))},
    ),
    Call(
        "variation.SelfAdaptiveDomain",
        lambda w: {"domain": w.arm, "step_sizes": (1.0,)},
        {"step_sizes": ((0.0,), (-1.0,), (np.nan,), ("three",), (), np.array(3), 1j * np.eye(2))},
    ),
    Call(
        "variation.polynomial.PolynomialMutation",
        lambda w: {"low": 0.0, "high": 1.0},
        {
            "low": (1.0, 2.0, *NOT_A_NUMBER),
            "high": (0.0, *NOT_A_NUMBER),
            "eta": (-1.0, np.inf, *NOT_A_NUMBER),
        },
    ),
    Call(
        "domains.policies.controllers.MLP",
        lambda w: {"sizes": (3, 4, 2)},
        {
            "sizes": ((3,), (3, 0, 2), (3, -1, 2), (), (3, 1.5, 2), ("a", 2), np.array(3)),
            "hidden": ("sigmoid", ("relu", "relu"), ("sigmoid",), np.array(3)),
            "output": UNKNOWN,
        },
    ),
    Call(
        "domains.policies.controllers.MLP.actions",
        lambda w: {"self": w.mlp, "genotype": np.zeros(20), "observations": np.zeros((1, 3))},
        {
            "genotype": (np.zeros(3), np.zeros((1, 20)), *RAGGED),
            "observations": (np.zeros(3), np.zeros((1, 2)), *RAGGED),
        },
    ),
    Call(
        "domains.policies.controllers.MLP.sample",
        lambda w: {"self": w.mlp, "n": 1, "seed": 0},
        {"n": (10**30, *whole(-1)), "seed": SEED},
    ),
    Call(
        "domains.policies.controllers.MLP.module",
        lambda w: {"self": w.mlp, "genotype": np.zeros(20)},
        {"genotype": (np.zeros(3),)},
    ),
)


@pytest.mark.parametrize(("call", "parameter", "value"), rows(*CALLS))
def test_a_bad_value_is_refused_in_one_sentence(call: Call, parameter: str, value: Any, world: World) -> None:
    check_refused(call, parameter, value, world)


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.name)
def test_the_other_arguments_are_good(call: Call, world: World) -> None:
    check_accepted(call, world)
