"""The help of commands: in groups, in whole lines, as wide as the terminal."""

import dataclasses
import re

import pytest

from nichechain.cli import COMMANDS, described, main, module_of
from nichechain.cli.build import BuildCommand
from nichechain.cli.study import SelectionCommand


def shown(capsys, monkeypatch, *words, width=80):
    monkeypatch.setenv("COLUMNS", str(width))
    with pytest.raises(SystemExit) as stopped:
        main([*words, "--help"])
    assert stopped.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", sorted(set(COMMANDS) - {"walks", "study"}))
def test_help_fits_the_terminal(command, capsys, monkeypatch):
    # A line of usage may name many choices.
    lines = shown(capsys, monkeypatch, command).splitlines()[1:]
    begin = lines.index("try:") if "try:" in lines else len(lines)
    assert max(map(len, lines[:begin])) <= 80


@pytest.mark.parametrize("command", sorted(set(COMMANDS) - {"walks", "study"}))
def test_help_says_defaults_in_words(command, capsys, monkeypatch):
    text = " ".join(shown(capsys, monkeypatch, command, width=110).split())
    for wrong in ("{None}", "(default: None)", "(default: )", "(default: required", ") (default:"):
        assert wrong not in text


def test_options_of_build_come_in_groups(capsys, monkeypatch):
    text = shown(capsys, monkeypatch, "build")
    # Where it is not known whether boxes can be drawn, a title stands over a line.
    titles = re.findall(r"^ (\w[\w ]*?) +\n -{10}", text, re.MULTILINE)
    assert titles == [
        "positional arguments",
        "options",
        *(f"{title} options" for title in BuildCommand.GROUPS),
    ]
    # Each option stands in one place.
    for field in dataclasses.fields(BuildCommand):
        option = f"--{field.name.replace('_', '-')}"
        assert field.name == "domain" or len(re.findall(rf"^  {option}\s", text, re.M)) == 1, option
    assert text.index("try:") > text.index("running options")
    assert len(BuildCommand.EXAMPLES) == 2


def test_groups_name_options_that_there_are():
    for command in (BuildCommand, SelectionCommand):
        names = [name for group in command.GROUPS.values() for name in group]
        assert len(names) == len(set(names))
        assert set(names) <= {field.name for field in dataclasses.fields(command)}


def test_every_option_says_what_it_is():
    # These are told where their type is made.
    shared = {"path", "beside", "estimator", "workers", "cache_memory", "steps"}
    kinds = [kind for name in COMMANDS for kind in vars(module_of(name)).values()]
    for kind in kinds:
        if isinstance(kind, type) and dataclasses.is_dataclass(kind) and kind.__name__.endswith("Command"):
            names = {field.name for field in dataclasses.fields(kind)}
            assert names <= shared | set(described.helps(kind)), kind


def test_a_text_in_one_line():
    assert described.helps(BuildCommand)["seeds"].startswith("Several searches that differ in their seed")
    assert "\n" not in "".join(described.helps(BuildCommand).values())
    assert "``" not in "".join(described.helps(BuildCommand).values())


def test_defaults_are_those_of_an_instance():
    default = BuildCommand("arm", scale=0.25, grid="3x3")
    found = described.Described(BuildCommand, default)
    assert found.command(found.type()) == default
