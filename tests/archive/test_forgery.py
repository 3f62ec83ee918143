"""Metadata forged with right checksums, through every command: an answer or one clear sentence."""

from __future__ import annotations

import copy
import hashlib
import json
import random
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from nichechain.cli import main

from .folder.samples import CONFIG, built

# What somebody may write in place of any value.
_EVIL: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 2**31, 2**63, 10**30, -(10**30), 0.5, -0.0, 1e308, -1e308, 1e-320),
    *(float("nan"), float("inf"), float("-inf"), "", "0", "nan", "outside", "$x_{", "$x$", "\\frac"),
    *("\x1b[2J\x1b[31mred", "\x9b31m", "\x07\r\n", "‮abc", "a" * 5000, "../../etc/passwd", "/dev/zero"),
    *(
        [],
        [[]],
        {},
        {"kind": "merged"},
        {"kind": "merged", "runs": [{}]},
        {"kind": "imported"},
        [0, 1],
        [[0, 1]],
    ),
    *(["a", "a"], [1e308, -1e308], [[-1e308, 1e308], [0, 1]], [[0, 1]] * 6, [float("nan"), 0.0]),
)
COMMANDS: tuple[tuple[str, ...], ...] = (
    ("info", "{a}"),
    ("info", "{a}", "--json"),
    ("evolvability", "{a}", "--l", "2", "--lineages", "5", "--draws", "2", "--min-births", "1"),
    (
        "evolvability",
        "{a}",
        "--l",
        "2",
        "--elite",
        "4,4",
        "--draws",
        "2",
        "--offspring",
        "2",
        "--workers",
        "1",
    ),
    ("estimate", "{a}"),
    ("estimate", "{a}", "--compare", "--folds", "2"),
    ("compare", "{a}", "{b}", "--l", "2", "--lineages", "5", "--resamples", "2", "--min-births", "1"),
    ("verify", "{a}", "--sample", "2", "--workers", "1"),
    ("merge", "{a}", "{b}", "--out", "{out}/merged"),
    ("explore", "{a}", "--l", "2", "--draws", "2", "--out", "{out}/explore.html"),
    ("plot", "{a}", "elites", "--out", "{out}/elites.png", "--dpi", "30"),
    ("plot", "{a}", "transitions", "--out", "{out}/transitions.svg", "--dpi", "30"),
    ("plot", "{a}", "reachability", "--out", "{out}/graph.png", "--dpi", "30"),
    ("sweep", "{a}", "--sizes", "2", "--l", "2", "--draws", "2", "--min-births", "1"),
    (
        "validate",
        "{a}",
        "--elites",
        "3",
        "--lineages",
        "2",
        "--l",
        "1",
        "--out",
        "{out}/validation",
        "--permutations",
        "3",
        "--workers",
        "1",
    ),
    ("landscape", "{a}", "--offspring", "2", "--elites", "2", "--workers", "1", "--out", "{out}/l.csv"),
    ("build", "arm", "--resume", "--out", "{a}", "--evaluations", "460", "--workers", "1"),
)


def places(values: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to every value in a JSON value."""
    inner = (
        values.items() if isinstance(values, dict) else enumerate(values) if isinstance(values, list) else ()
    )
    return [
        *([path] if path else []),
        *(found for key, value in inner for found in places(value, (*path, key))),
    ]


def forged(meta: dict[str, Any], dice: random.Random) -> dict[str, Any]:
    """The metadata with one to three values replaced, removed or added, and a checksum that fits."""
    meta = copy.deepcopy(meta)
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        *way, last = dice.choice(places(meta))
        at: Any = meta
        for step in way:
            at = at[step]
        match dice.randrange(8):
            case 0:
                del at[last]
            case 1 if isinstance(at, dict):
                at[dice.choice(("\x1b[31m", "origin", "machine", "extra"))] = dice.choice(_EVIL)
            case 2 if isinstance(at[last], (int, float)) and not isinstance(at[last], bool):
                at[last] = at[last] * dice.choice((-1, 2, 0.5, 1e9)) + dice.choice((-1, 0, 1))
            case 3 if isinstance(at[last], list):
                at[last] = at[last] * 2 if dice.random() < 0.5 else at[last][:-1]
            case _:
                at[last] = copy.deepcopy(dice.choice(_EVIL))
    meta["sha256"] = hashlib.sha256(json.dumps(meta, indent=2).encode()).hexdigest()
    return meta


def campaign(folder: Path, rounds: int, seed: int, capsys: Any, commands: Any = COMMANDS) -> Counter[str]:
    """Forge, ask, compare what is said with what may be said; how often it was an answer."""
    files = built(folder / "b")
    meta = json.loads(files["meta.json"])
    del meta["sha256"]
    dice = random.Random(seed)
    outcomes: Counter[str] = Counter()
    for number in range(rounds):
        victim, out = folder / f"a{number}", folder / f"out{number}"
        out.mkdir()
        lie = forged(meta, dice)
        for name, content in {**files, "meta.json": json.dumps(lie, indent=2).encode()}.items():
            (victim / name).parent.mkdir(parents=True, exist_ok=True)
            (victim / name).write_bytes(content)
        command = [word.format(a=victim, b=folder / "b", out=out) for word in dice.choice(commands)]
        where = f"round {number} of seed {seed}: {command[:3]}"
        capsys.readouterr()
        try:
            status = main(command)
        except SystemExit as error:
            raise AssertionError(where) from error
        except Exception as error:
            changed = [
                path for path in places(lie) if path not in places(meta) or _at(lie, path) != _at(meta, path)
            ]
            raise AssertionError(
                f"{where}: {[(path, _at(lie, path)) for path in changed][:6]!r:.600}"
            ) from error
        said = capsys.readouterr()
        everything = said.out + said.err
        assert "Traceback" not in everything, where
        obeyed = [c for c in everything if not c.isprintable() and c != "\n"]
        assert not obeyed, (where, obeyed[:5])
        if status == 2:
            errors = [line for line in said.err.splitlines() if line.startswith("nichechain: error: ")]
            assert len(errors) == 1, (where, said.err[-600:])
            assert len(errors[0]) < 2500, (where, errors[0])
        outcomes[str(status)] += 1
    return outcomes


def _at(values: Any, path: tuple[Any, ...]) -> Any:
    for step in path:
        values = values[step]
    return values


def test_forged_metadata_are_refused_or_obeyed_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes = campaign(tmp_path, 40, 1, capsys, COMMANDS[:3])
    assert outcomes["2"] > 10
    assert CONFIG.evaluations == 450


@pytest.mark.slow
def test_two_thousand_forgeries_through_every_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    outcomes = campaign(tmp_path, 2000, 2, capsys)
    print(dict(outcomes))
    assert outcomes["2"] > 500
