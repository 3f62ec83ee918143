"""Bad values of every option of every command: exit 2, one sentence, nothing on standard output."""

# every row of a table takes the world, whether it needs it or not

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from nichechain import NichechainError
from nichechain.cli import COMMANDS, main, module_of

from .table import World, check_sentence

# Words that are no numbers, and numbers that are none of ours, by what an option takes.
_COUNT = ("0", "-1", "1.5", "three", "nan", "")
_NATURAL = ("-1", "1.5", "three", "nan", "")
_REAL = ("three", "")
_POSITIVE = ("0", "-1", "nan", "inf", *_REAL)
_SHARE = ("-0.1", "1.1", "nan", *_REAL)
_UNKNOWN = ("no-such-thing", "3", "")
_MEMORY = ("-1", "two", "2TB", "1.5.2GB", "")
_WORKERS = ("0", "-1", "three", "threads:0", "processes:x", "ray:x")
_NICHE = ("9,9", "-1", "a", "0,", "0;0", "1,2,3", "999", "")
_GRID = ("0x2", "2", "axb", "2x", "-1x2", "1000000x1000000", "2x2x2", "")
_BOUNDS = ("0,1", "1,0,0,1", "0,nan,0,1", "a,b,c,d", "0,1,0", "")
_PATH = ("/no/such/folder", "no-such-archive")
_STEPS = ("3:1", "0:0", "-1:2", "three", "9999:", "")
_SCORES = {"l": _COUNT, "lineages": _COUNT, "seed": _NATURAL}
_ESTIMATOR = {"estimator": _UNKNOWN}

Bad = Mapping[str, Sequence[str]]

_WALKS: dict[str, Sequence[str]] = {
    "domain": _UNKNOWN,
    "out": ("{archive}/meta.json",),
    "runs": _COUNT,
    "offspring": _COUNT,
    "mutation": _UNKNOWN,
    "scale": _POSITIVE,
    "step_bound": ("rescaled", "rescaled:0", "no-such-kind:1", "rescaled:x"),
    "k": _COUNT,
    "archive_limit": _COUNT,
    "archive_scope": _UNKNOWN,
    "states": _COUNT,
    "litter": _COUNT,
    "initialisation": ("no-such-thing", "normal:0", "normal:x", "orthogonal", "elites:/no/such/folder"),
    "grid": _GRID,
    "bounds": _BOUNDS,
    "seed": _NATURAL,
    "domain_seed": _NATURAL,
    "options": ("joints", "joints=0", "no_such_option=3", "=3"),
    "steps": _NATURAL,
    "workers": _WORKERS,
    "cache_memory": _MEMORY,
}
_LEVEL = ("no-such-thing", "2", "0", "-0.5", "nan")
_KDE = {"bandwidth": _POSITIVE, "mode": _UNKNOWN, "decay": ("0", "1.1", "nan", *_REAL)}

TABLE: tuple[tuple[str, str, tuple[str, ...], Bad], ...] = (
    (
        "build",
        "BuildCommand",
        ("arm", "--evaluations", "20", "--initial", "5", "--grid", "2x2", "--out", "{fresh}"),
        {
            "domain": ("no-such-thing", "3", "gym:", "gym:NoSuch-v0"),
            "evaluations": _COUNT,
            "grid": _GRID,
            "niches": ("cvt:0", "cvt", "cvt:x", "400", "voronoi:4"),
            "niches_seed": _NATURAL,
            "bounds": _BOUNDS,
            "initial": _COUNT,
            "batch": _COUNT,
            "mutation": _UNKNOWN,
            "scale": _POSITIVE,
            "df": (*_POSITIVE, "3"),
            "step_bound": ("rescaled", "rescaled:0", "no-such-kind:1", "rescaled:x", "rescaled:nan"),
            "layer_scales": ("0", "a", "1,nan", "1,1", ""),
            "selection": (*_UNKNOWN, "reach:0.7", "reach:0.7,uniform:0.7", "reach:a,uniform:0.5"),
            "temperature": _POSITIVE,
            "selection_l": _COUNT,
            "selection_lineages": _COUNT,
            "lineage_share": ("1", *_SHARE),
            "lineage_length": ("1", *_COUNT),
            "lineage_brood": _COUNT,
            "replacement": _UNKNOWN,
            "objective": ("l-evolvability", *_UNKNOWN),
            "offspring": _COUNT,
            "objective_l": _COUNT,
            "objective_lineages": ("11", *_COUNT),
            "outside": _UNKNOWN,
            "seed": _NATURAL,
            "seeds": ("3..1", "a", "0..", "1,1", "-1", "1.5", ""),
            "domain_seed": _NATURAL,
            "descriptor": ("final-xy",),
            "controller": ("mlp:4", "lstm"),
            "steps": ("0", "three", "5"),
            "noise": ("action", "action:x", "action:-1", "wind:1"),
            "repeats": _COUNT,
            "options": ("joints", "joints=0", "no_such_option=3", "=3", "joints=1.5"),
            "workers": _WORKERS,
            "cache_memory": _MEMORY,
            "max_failed": _SHARE,
            "out": ("{archive}", "{archive}/meta.json"),
        },
    ),
    (
        "calibrate",
        "CalibrateCommand",
        ("{spare}", "--rollouts", "4"),
        {
            "path": (*_PATH, "{imported}", "{merged}", "{unfinished}"),
            "rollouts": _COUNT,
            "brood": _COUNT,
            "workers": _WORKERS,
            "cache_memory": _MEMORY,
            "max_failed": _SHARE,
        },
    ),
    (
        "compare",
        "CompareCommand",
        ("{archive}", "{archive}", "--resamples", "2"),
        {
            "first": (*_PATH, "no-such-*", ""),
            "second": (*_PATH, "{other}", "no-such-*", "{archive},{spare}"),
            "steps": _STEPS,
            "min_births": (*_NATURAL, "10000"),
            "resamples": ("1", *_COUNT),
            "draws": _COUNT,
            "format": _UNKNOWN,
            **_SCORES,
        },
    ),
    ("completion", "CompletionCommand", ("bash",), {"shell": _UNKNOWN}),
    ("domains", "DomainsCommand", (), {}),
    (
        "estimate",
        "EstimateCommand",
        ("{archive}",),
        {
            "path": _PATH,
            "steps": _STEPS,
            "estimator": _UNKNOWN,
            "min_births": _NATURAL,
            "seed": _NATURAL,
            "format": _UNKNOWN,
            # Without --compare and --stability these are nobody's.
            "folds": ("5",),
            "thin": ("birth", *_UNKNOWN),
            "repeats": ("3",),
            "out": ("file.png",),
        },
    ),
    (
        "estimate",
        "EstimateCommand",
        ("{archive}", "--compare"),
        {"folds": ("1", *_COUNT, "100000"), "seed": ("-1",)},
    ),
    (
        "estimate",
        "EstimateCommand",
        ("{archive}", "--stability", "--repeats", "1"),
        {"repeats": _COUNT, "min_births": ("100000",), "out": ("file.txt", "/no/such/folder/file.png")},
    ),
    (
        "evolvability",
        "EvolvabilityCommand",
        ("{archive}", "--draws", "2"),
        {
            "path": _PATH,
            "steps": _STEPS,
            "niche": _NICHE,
            "elite": _NICHE,
            "top": _COUNT,
            "method": _UNKNOWN,
            "convention": _UNKNOWN,
            "estimator": _UNKNOWN,
            "unvisited": ("self", *_UNKNOWN),
            # Without --elite it is nobody's.
            "offspring": ("3", *_NATURAL),
            "meta": ("3", *_COUNT),
            "rank": _UNKNOWN,
            "min_births": _NATURAL,
            "draws": _COUNT,
            "uncertainty": _UNKNOWN,
            "repeats": _COUNT,
            "format": _UNKNOWN,
            **_SCORES,
        },
    ),
    (
        "evolvability",
        "EvolvabilityCommand",
        ("{archive}", "--elite", "{niche}"),
        {"workers": _WORKERS, "cache_memory": _MEMORY, "offspring": _NATURAL, "rank": ("elites",)},
    ),
    (
        "evolvability",
        "EvolvabilityCommand",
        ("{archive}", "--elite", "{niche}", "--meta", "3"),
        {"meta": ("1", *_COUNT), "offspring": _COUNT, "l": ("3",), "draws": _COUNT},
    ),
    (
        "watch",
        "WatchCommand",
        ("{archive}", "--niche", "{niche}", "--out", "{fresh}.png"),
        {"path": _PATH, "niche": _NICHE, "out": ("file.txt", "/no/such/folder/file.png", "file")},
    ),
    (
        "explore",
        "ExploreCommand",
        ("{archive}", "--out", "{fresh}"),
        {
            "path": _PATH,
            "steps": _STEPS,
            "out": ("/no/such/folder/page.html", "{archive}"),
            "draws": _COUNT,
            "films": ("/no/such/folder", "{archive}/meta.json"),
            "beside": _PATH,
            **_SCORES,
            **_ESTIMATOR,
        },
    ),
    (
        "import",
        "ImportCommand",
        ("{log}", "--grid", "3x2", "--bounds", "0,1,0,1", "--out", "{fresh}"),
        {
            "log": ("/no/such/log.csv", "{archive}/meta.json", "{archive}"),
            "grid": _GRID,
            "niches": ("{log}",),
            "bounds": _BOUNDS,
            "out": ("{archive}",),
            "outside": _UNKNOWN,
            **dict.fromkeys(
                (
                    "objective",
                    "parent",
                    "child",
                    "run",
                    "uid",
                    "elite",
                    "step",
                    "lineage",
                    "child_behavior",
                    "parent_behavior",
                ),
                ("no_such_column",),
            ),
            "names": ("x", "x,y,z"),
        },
    ),
    ("info", "InfoCommand", ("{archive}",), {"path": _PATH, "format": _UNKNOWN}),
    (
        "landscape",
        "LandscapeCommand",
        ("{archive}", "--offspring", "2", "--elites", "1", "--out", "{fresh}.csv"),
        {
            "path": _PATH,
            "offspring": ("1", *_COUNT),
            "mutation": _UNKNOWN,
            "scale": _POSITIVE,
            "step_bound": ("rescaled", "rescaled:0", "no-such-kind:1"),
            "elites": _COUNT,
            "share": ("0", *_SHARE),
            "min_births": _NATURAL,
            "top": _NATURAL,
            "by": _UNKNOWN,
            "map": ("no-such-thing", "ratio,no-such-thing", ""),
            "workers": _WORKERS,
            "cache_memory": _MEMORY,
            "out": ("/no/such/folder/table.csv", "{archive}"),
            **_SCORES,
        },
    ),
    ("list", "ListCommand", ("{archive}",), {"folder": ("/no/such/folder",), "format": _UNKNOWN}),
    (
        "merge",
        "MergeCommand",
        ("{archive}", "{again}", "--out", "{fresh}"),
        {"paths": (*_PATH, "{archive}", "{other}"), "out": ("{archive}",)},
    ),
    (
        "plot",
        "PlotCommand",
        ("{archive}", "reach", "--niche", "{niche}", "--out", "{fresh}.png"),
        {
            "path": _PATH,
            "steps": _STEPS,
            "kind": _UNKNOWN,
            "out": ("file.txt", "/no/such/folder/file.png", "file"),
            "l": _COUNT,
            "lineages": _COUNT,
            "niche": _NICHE,
            "dpi": ("0", "9", "2001", "-5", "1.5", "three"),
            **_ESTIMATOR,
        },
    ),
    (
        "plot",
        "PlotCommand",
        ("{archive}", "reachability", "--out", "{fresh}.png"),
        {"threshold": ("-0.1", "1.1", "nan", *_REAL), "niche": ("0,0",)},
    ),
    (
        "plot",
        "PlotCommand",
        ("{archive}", "evolvability", "--out", "{fresh}.png"),
        {"min_births": _NATURAL, "threshold": ("0.5",)},
    ),
    (
        "study selection",
        "SelectionCommand",
        ("arm", "--evaluations", "20", "--initial", "5", "--grid", "2x2", "--out", "{fresh}"),
        {
            "domain": ("no-such-thing", "3", "gym:", "gym:NoSuch-v0"),
            "evaluations": _COUNT,
            "grid": _GRID,
            "niches": ("cvt:0", "cvt", "cvt:x", "400", "voronoi:4"),
            "niches_seed": _NATURAL,
            "bounds": _BOUNDS,
            "initial": _COUNT,
            "batch": _COUNT,
            "mutation": _UNKNOWN,
            "scale": _POSITIVE,
            "df": (*_POSITIVE, "3"),
            "step_bound": ("rescaled", "rescaled:0", "no-such-kind:1", "rescaled:x", "rescaled:nan"),
            "layer_scales": ("0", "a", "1,nan", "1,1", ""),
            "selections": (*_UNKNOWN, "reach", "uniform:1", "reach:0.7,uniform:0.7"),
            "runs": ("1", *_COUNT),
            "elites": _NATURAL,
            "offspring": ("1", *_COUNT),
            "temperature": _POSITIVE,
            "selection_l": _COUNT,
            "selection_lineages": _COUNT,
            "lineage_share": ("1", *_SHARE),
            "lineage_length": ("1", *_COUNT),
            "lineage_brood": _COUNT,
            "replacement": _UNKNOWN,
            "outside": _UNKNOWN,
            "seed": _NATURAL,
            "domain_seed": _NATURAL,
            "descriptor": ("final-xy",),
            "controller": ("mlp:4", "lstm"),
            "steps": ("0", "three", "5"),
            "noise": ("action", "action:x", "action:-1", "wind:1"),
            "repeats": _COUNT,
            "options": ("joints", "joints=0", "no_such_option=3", "=3", "joints=1.5"),
            "workers": _WORKERS,
            "cache_memory": _MEMORY,
            "out": ("{archive}/meta.json",),
        },
    ),
    (
        "study resume",
        "ResumeSearchesCommand",
        ("{selections}",),
        {"path": _PATH, "runs": ("1", *_COUNT), "workers": _WORKERS, "cache_memory": _MEMORY},
    ),
    ("study report", "ReportSearchesCommand", ("{selections}",), {"path": _PATH}),
    (
        "sweep",
        "SweepCommand",
        ("{archive}", "--sizes", "2", "--draws", "2"),
        {
            "path": _PATH,
            "steps": _STEPS,
            "sizes": ("0", "a", "2,-1", "2.5", "1000000", ""),
            "behavior": ("0", "9,9", "a,b", "nan,0", "0,0,0"),
            "min_births": _NATURAL,
            "draws": _COUNT,
            "out": ("file.txt", "/no/such/folder/file.png"),
            **_SCORES,
        },
    ),
    (
        "table",
        "TableCommand",
        ("{archive}", "--draws", "2"),
        {
            "path": _PATH,
            "steps": _STEPS,
            "by": _UNKNOWN,
            "top": _COUNT,
            "children": ("1", *_COUNT),
            "draws": _COUNT,
            "format": _UNKNOWN,
            **_SCORES,
            **_ESTIMATOR,
        },
    ),
    (
        "validate",
        "ValidateCommand",
        ("{archive}", "--out", "{fresh}", "--elites", "3", "--lineages", "1", "--permutations", "9"),
        {
            "path": _PATH,
            "elites": ("2", *_COUNT),
            "permutations": _COUNT,
            "workers": _WORKERS,
            "cache_memory": _MEMORY,
            "out": ("{archive}/meta.json",),
            **_SCORES,
        },
    ),
    (
        "verify",
        "VerifyCommand",
        ("{archive}",),
        {
            "path": _PATH,
            "sample": ("-1", "1.5", "some", ""),
            "seed": _NATURAL,
            "workers": _WORKERS,
            "cache_memory": _MEMORY,
        },
    ),
    (
        "walks pressure",
        "PressureCommand",
        ("arm", "--out", "{fresh}", "--runs", "2", "--steps", "1", "--offspring", "2"),
        {**_WALKS, "levels": (*_LEVEL, "selective,2", "selective,selective", ""), "metric": _UNKNOWN},
    ),
    (
        "walks pressure",
        "PressureCommand",
        ("arm", "--out", "{fresh}", "--runs", "2", "--steps", "1", "--metric", "kde"),
        _KDE,
    ),
    (
        "walks metrics",
        "MetricsCommand",
        ("arm", "--out", "{fresh}", "--runs", "2", "--steps", "1", "--offspring", "2"),
        {**_WALKS, **_KDE, "metrics": ("no-such-thing", "knn,no-such-thing", "knn,knn", ""), "level": _LEVEL},
    ),
    (
        "walks sensitivity",
        "SensitivityCommand",
        ("arm", "--out", "{fresh}", "--runs", "2", "--steps", "1", "--offspring", "2"),
        {
            **{name: values for name, values in _WALKS.items() if name != "scale"},
            "vary": _UNKNOWN,
            "level": _LEVEL,
            "metric": _UNKNOWN,
        },
    ),
    (
        "walks sensitivity",
        "SensitivityCommand",
        ("arm", "--out", "{fresh}", "--vary", "k", "--metric", "kde", "--runs", "2", "--steps", "1"),
        {**_KDE, "scale": _POSITIVE},
    ),
    (
        "walks population",
        "PopulationCommand",
        ("arm", "--out", "{fresh}", "--runs", "2", "--steps", "1", "--offspring", "2", "--states", "2"),
        {
            **_WALKS,
            **_KDE,
            "states": ("1", *_COUNT),
            "metrics": ("no-such-thing", "knn,no-such-thing", "knn,knn", ""),
            "level": _LEVEL,
        },
    ),
    (
        "walks resume",
        "ResumeCommand",
        ("{study}",),
        {"path": _PATH, "runs": _COUNT, "workers": _WORKERS, "cache_memory": _MEMORY},
    ),
    ("walks report", "ReportCommand", ("{study}",), {"path": _PATH}),
)

# What has no bad value: flags, and texts that may be anything.
FREE = {
    "unit": "any text",
    **dict.fromkeys(
        (
            "all_births",
            "compare",
            "drawn",
            "force",
            "fresh_only",
            "json",
            "lowest",
            "other_niche",
            "paired",
            "resume",
            "self_adaptive",
            "speed",
            "stability",
            "strict",
        ),
        "a flag",
    ),
    # Shown and tried where a search is built alone.
    "selection": "a study has several",
    "objective": "a study of selections has the domain's",
    "objective_l": "a study of selections has the domain's",
    "objective_lineages": "a study of selections has the domain's",
    "max_failed": "a study takes the default",
    "seeds": "a study has runs",
}


def _rows() -> list[Any]:
    return [
        pytest.param(command, kind, given, option, value, id=f"{command} {option} {value!r}")
        for command, kind, given, bad in TABLE
        for option, values in bad.items()
        for value in dict.fromkeys(values)
    ]


def _dataclass(command: str, kind: str) -> Any:
    return getattr(module_of(command.split()[0]), kind)


def _words(command: str, kind: str, given: Sequence[str], option: str, value: str) -> list[str]:
    """The command line with this value for the option, or for the positional argument of that name."""
    fields = [field.name for field in dataclasses.fields(_dataclass(command, kind))]
    positional = list(_POSITIONAL.get(command, ("path",)))
    words = list(given)
    if option in positional:
        words[positional.index(option)] = value
        return [*command.split(), *words]
    assert option in fields
    name = f"--{option.replace('_', '-')}"
    if name in words:
        at = words.index(name)
        del words[at : at + 2]
    # Values that begin with a dash are values all the same.
    return [*command.split(), *words, f"{name}={value}" if value.startswith("-") else name, *_one(value)]


def _one(value: str) -> list[str]:
    return [] if value.startswith("-") else [value]


_POSITIONAL = {
    "build": ("domain",),
    "compare": ("first", "second"),
    "completion": ("shell",),
    "domains": (),
    "import": ("log",),
    "list": ("folder",),
    "merge": ("first", "paths"),
    "plot": ("path", "kind"),
    "study selection": ("domain",),
    "walks pressure": ("domain",),
    "walks metrics": ("domain",),
    "walks sensitivity": ("domain",),
    "walks population": ("domain",),
}


def _filled(words: Sequence[str], world: World) -> list[str]:
    places = {
        "archive": world.archive.folder,
        "again": world.again,
        "other": world.other,
        "spare": world.spare,
        "imported": world.imported,
        "merged": world.merged,
        "unfinished": world.unfinished,
        "log": world.log,
        "study": world.study,
        "selections": world.selections,
        "fresh": world.fresh(),
        "niche": ",".join(map(str, world.elite.niche)),
    }
    return [word.format(**places) if "{" in word else word for word in words]


@pytest.mark.parametrize(("command", "kind", "given", "option", "value"), _rows())
def test_a_bad_value_ends_in_one_sentence(
    command: str,
    kind: str,
    given: tuple[str, ...],
    option: str,
    value: str,
    world: World,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    words = _filled(_words(command, kind, given, option, value), world)
    try:
        status = main(words)
    except SystemExit as stopped:
        # The parser of options refuses words that are no numbers, and unknown names, itself.
        status = stopped.code
        said = capsys.readouterr()
        assert (status, said.out) == (2, "")
        assert value in said.err or option.replace("_", "-") in said.err or option.upper() in said.err
        assert "Traceback" not in said.err
        return
    said = capsys.readouterr()
    assert (status, said.out) == (2, ""), said
    message = said.err.splitlines()[-1]
    assert message.startswith("nichechain: error: ")
    check_sentence(message)
    assert "Traceback" not in said.err
    with pytest.raises((NichechainError, OSError)):
        main([*words, "--debug"])


def test_every_option_of_every_command_is_in_the_table() -> None:
    assert {command.split()[0] for command, *_ in TABLE} == set(COMMANDS)
    tried: dict[Any, set[str]] = {}
    for command, kind, _, bad in TABLE:
        tried.setdefault(_dataclass(command, kind), set()).update(bad)
    for kind, options in tried.items():
        missing = {field.name for field in dataclasses.fields(kind)} - options - set(FREE)
        assert not missing, f"{kind.__name__}: no bad value is tried of {', '.join(sorted(missing))}"
