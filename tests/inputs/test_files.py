"""Bad input of what reads and writes files: archives, builds, merges, logs, exports; and of executors."""

# ruff: noqa: ARG005  # every row of a table takes the world, whether it needs it or not
from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import nichechain as nc
from nichechain.archive import Axes, Columns

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
    check_accepted,
    check_refused,
    rows,
    whole,
)

_NO_FOLDER = ("/no/such/folder", "no-such-archive")
_GONE = Made(lambda w: w.folder / "gone" / "file", "no-folder")


def _without(column: str) -> Made:
    return Made(lambda w: w.births.drop(columns=[column]), f"no-{column}")


def _written(name: str, content: str) -> Made:
    def write(w: World) -> Any:
        path = w.folder / name
        path.write_text(content)
        return path

    return Made(write, name)


def _configs(*changes: dict[str, Any]) -> tuple[Made, ...]:
    return tuple(
        Made(lambda w, change=change: dataclasses.replace(w.config, **change), str(change))
        for change in changes
    )


_ORPHAN = Made(lambda w: w.births.assign(parent_uid=w.births["parent_uid"].fillna(0) + 10_000), "orphans")

CALLS = (
    Call("load", lambda w: {"path": w.archive.folder}, {"path": (*_NO_FOLDER, "")}),
    Call(
        "Archive.elite",
        lambda w: {"self": w.archive, "niche": w.elite.niche},
        {"niche": (-1, 26, (9, 9), "0")},
    ),
    Call(
        "Archive.counts_of",
        lambda w: {"self": w.archive},
        {"run": (-1, 99, "first", 1j * np.eye(2)), "steps": ((3, 1), (-1, 2), (1,), "all", np.array(3))},
    ),
    Call("Archive.chain", lambda w: {"self": w.archive}, {"estimator": UNKNOWN}),
    Call(
        "BuildConfig",
        lambda w: {"domain": "arm", "shape": (3, 2), "bounds": ((0, 1), (0, 1))},
        {
            "shape": (("a", 2), 3, None, (2.5, 2), np.full((6, 6), 2**63, np.uint64)),
            "bounds": ("0,1", ((0,), (1,)), None, np.full((6, 6), 2**63, np.uint64)),
            "evaluations": whole(0),
            "initial": (10**18, *whole(0)),
            "batch": (10**18, *whole(0)),
            "mutation": ([1.0], None),
            "outside": (["state"],),
            "self_adaptive": (1, "no", []),
            "scale": ("three", None),
            "replacement": UNKNOWN,
            "seed": SEED,
            "domain_seed": SEED,
            "niches": UNKNOWN,
            "niches_seed": SEED,
            "domain_options": ("joints=3", {3: 3}, {"joints": None}, {"joints": np.nan}),
            "df": ("three",),
            "step_bound": ("rescaled", ("rescaled", "a"), ("rescaled",), np.array(3), 1.0),
            "layer_scales": (("a",), np.array(3), 1.0),
            "selection": (*UNKNOWN, "reach:0.7", "reach:0.7,uniform:0.7", "reach:a,uniform:0.5", 3, None),
            "temperature": ("three", 0.0, -1.0, np.nan),
            "selection_l": whole(0),
            "selection_lineages": whole(0),
            "objective": (*UNKNOWN, "l-evolvability"),
            "offspring": whole(0),
            "objective_l": whole(0),
            "objective_lineages": (11, *whole(0)),
            "lineage_share": (1.0, *SHARE),
            "lineage_length": whole(1),
            "lineage_brood": whole(0),
        },
    ),
    Call(
        "search.making.check_niches",
        lambda w: {"config": w.config},
        {
            "config": _configs(
                {"shape": (0, 2)},
                {"shape": (10**6, 10**6)},
                {"bounds": ((1, 0), (0, 1))},
                {"bounds": ((0, np.nan), (0, 1))},
                {"outside": "elsewhere"},
                {"niches": "cvt", "shape": (3,), "outside": "elsewhere"},
            )
        },
    ),
    Call(
        "search.making.make_mutation",
        lambda w: {"config": w.config, "domain": w.arm},
        {
            "config": _configs(
                {"mutation": "no-such-mutation"},
                {"scale": 0.0},
                {"scale": -1.0},
                {"scale": np.inf},
                {"scale": np.nan},
                {"df": 3.0},
                {"mutation": "student-t", "df": 0.0},
                {"step_bound": ("no-such-kind", 1.0)},
                {"step_bound": ("rescaled", 0.0)},
                {"layer_scales": (0.0,)},
                {"layer_scales": (1.0, 2.0, 3.0)},
            )
        },
    ),
    Call(
        "build",
        lambda w: {"config": w.config, "folder": w.archive.folder, "executor": w.here},
        {
            "config": (Made(lambda w: w.other_config, "other-config"),),
            "folder": (_written("a-file", ""),),
            "max_failed": SHARE,
        },
    ),
    Call(
        "calibrate",
        lambda w: {"archive": w.spare, "rollouts": 3, "executor": w.here},
        {
            "archive": (
                *_NO_FOLDER,
                Made(lambda w: w.imported, "imported"),
                Made(lambda w: w.merged, "merged"),
                Made(lambda w: w.unfinished, "unfinished"),
            ),
            "rollouts": (None, *whole(0)),
            "brood": whole(0),
            "max_failed": SHARE,
        },
    ),
    Call(
        "archive.merge.merge",
        lambda w: {"folders": (w.archive.folder, w.again), "out": w.fresh()},
        {
            "folders": (
                (),
                np.array(3),
                (3, 4),
                Made(lambda w: (w.archive.folder,), "one"),
                Made(lambda w: (w.archive.folder, w.archive.folder), "itself"),
                Made(lambda w: (w.archive.folder, w.other), "other-niches"),
                _NO_FOLDER,
            ),
            "out": (Made(lambda w: w.archive.folder, "an-archive"),),
        },
    ),
    Call(
        "archive.imported.import_births",
        lambda w: {"log": w.log, "folder": w.fresh(), "niches": w.niches},
        {
            "log": (
                "/no/such/log.csv",
                "/dev/zero",
                "a\0b.csv",
                _written("log.txt", ""),
                _written("empty.csv", ""),
                _written("header.csv", "parent_niche,child_niche\n"),
                _written("short.csv", "parent_niche\n1\n"),
                _written("words.csv", "parent_niche,child_niche\na,b\n"),
                _written("negative.csv", "parent_niche,child_niche\n-3,1\n"),
                _written("half.csv", "parent_niche,child_niche\n0.5,1\n"),
                _written("huge.csv", "parent_niche,child_niche\n99,1\n"),
                _written("bad.parquet", "PAR1"),
                _written("bad.csv.gz", "no"),
                3,
                Made(lambda w: w.folder, "no-parquet"),
                Made(lambda w: w.births.drop(columns=["child_niche"]), "no-child"),
            ),
            "folder": (Made(lambda w: w.archive.folder, "an-archive"),),
            "columns": (
                Columns(parent="no-such-column"),
                np.eye(2),
                Made(lambda w: Columns(lineage="child_niche"), "no-flag"),
            ),
            "axes": (Axes(names=("x",)),),
        },
    ),
    *(
        Call(
            f"archive.exports.{name}",
            lambda w: {"graph": w.archive.chain().graph(0.1), "path": w.folder / "graph"},
            {"path": (_GONE,)},
        )
        for name in ("write_graphml", "write_gexf", "write_dot", "write_edges")
    ),
    Call(
        "archive.exports.write_stn",
        lambda w: {"births": w.births, "niches": w.archive.niches, "path": w.folder / "stn.csv"},
        {
            "births": (_without("run"), _without("objective")),
            "niches": (Made(lambda w: w.niches, "other-niches"),),
            "path": (_GONE,),
        },
    ),
    Call(
        "archive.exports.write_phylogeny",
        lambda w: {"births": w.births, "niches": w.archive.niches, "path": w.folder / "tree.csv"},
        {
            "births": (_without("uid"), _ORPHAN),
            "niches": (Made(lambda w: w.niches, "other-niches"),),
            "path": (_GONE,),
        },
    ),
    Call("archive.exports.genealogy", lambda w: {"births": w.births}, {"births": (_without("uid"), _ORPHAN)}),
    Call(
        "archive.exports.write_genealogy",
        lambda w: {"births": w.births, "path": w.folder / "pairs.csv"},
        {"births": (_without("parent_uid"), _ORPHAN), "path": (_GONE,)},
    ),
    Call(
        "search.parents.curiosity",
        lambda w: {"births": w.births},
        {
            "births": (
                _without("accepted"),
                Made(lambda w: w.births.assign(accepted=None), "accepted-unknown"),
            ),
            "by": UNKNOWN,
        },
    ),
    Call(
        "validation.grid_size.sweep",
        lambda w: {"archive": w.archive, "sizes": (2,), "draws": 1},
        {
            "sizes": ((), (0,), (-1,), (2.5,), ("a",), ((2,),), (10**6,)),
            "behavior": ((0.0,), (9.0, 9.0), (np.nan, 0.0), *RAGGED),
            "min_births": ("three", np.nan),
            "draws": whole(0),
            "folds": whole(1),
            **LINEAGES,
        },
    ),
    Call(
        "verification.verify",
        lambda w: {"archive": w.archive, "sample": 2, "executor": w.here},
        {"archive": _NO_FOLDER, "sample": whole(-1), "seed": SEED},
    ),
    Call(
        "execution.make",
        lambda w: {"workers": "1"},
        {
            "workers": ("0", "-1", "threads:0", "threads:x", "processes:-1", "dask", "1.5", "ray:x", "three"),
            "cache_memory": ("-1", "two", "2TB", "1.5.2GB", ""),
        },
    ),
    Call("execution.Threads", lambda w: {"workers": 1}, {"workers": whole(0), "cache_memory": whole(-1)}),
    Call("Threads", lambda w: {"workers": 1}, {"workers": (0,)}),
    Call("execution.Processes", lambda w: {"workers": 1}, {"workers": whole(0), "cache_memory": whole(-1)}),
    Call(
        "pyribs.record",
        lambda w: {"scheduler": w.scheduler()},
        {
            "scheduler": (*UNKNOWN, Made(lambda w: w.scheduler().archive, "an archive")),
            "niches": (
                *UNKNOWN,
                Made(lambda w: nc.GridNiches((4,), ((0, 1),)), "one axis"),
            ),
            "outside": UNKNOWN,
            "strategy_parent": UNKNOWN,
        },
    ),
    Call(
        "pyribs.MutationEmitter",
        lambda w: {
            "archive": w.scheduler().archive,
            "mutate": w.mutate,
            "initial_solutions": np.zeros((1, 3)),
        },
        {
            "initial_solutions": (np.zeros(3), np.zeros((0, 3)), np.zeros((1, 2)), *RAGGED),
            "batch_size": whole(0),
            "seed": SEED,
        },
    ),
    Call("search.failures.Failures", lambda w: {}, {"most": (-0.1, 1.1, *NOT_A_NUMBER)}),
)


@pytest.mark.parametrize(("call", "parameter", "value"), rows(*CALLS))
def test_a_bad_value_is_refused_in_one_sentence(call: Call, parameter: str, value: Any, world: World) -> None:
    check_refused(call, parameter, value, world)


@pytest.mark.parametrize("call", CALLS, ids=lambda call: call.name)
def test_the_other_arguments_are_good(call: Call, world: World) -> None:
    check_accepted(call, world)
