"""Bad values of every option of every command: exit 2, one sentence, nothing on standard output."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from nichechain import NichechainError
from nichechain.cli import COMMANDS, main, module_of

from .commands import FREE, TABLE
from .table import World, check_sentence


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
