"""Brackets of others are shown as they are."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from nichechain.cli import main
from nichechain.cli.marks import MarkedConsole
from nichechain.cli.output import facts

from ..archive.folder.samples import built, edited, written


def said(text: str) -> str:
    """What a terminal with colours is sent."""
    stream = io.StringIO()
    console = MarkedConsole(
        file=stream, force_terminal=True, color_system="standard", width=200, highlight=False
    )
    console.print(text)
    return stream.getvalue()


@pytest.mark.parametrize(
    "text",
    [
        "runs[a]",
        "[red",
        "[x][/x]",
        "[link=http://x]y",
        "[@click=f]",
        "a:smile:b",
        "\\[x]",
        "\\\\[/x]",
        "[/]",
        "x[/]",
    ],
)
def test_what_is_no_mark_of_ours_is_text(text: str) -> None:
    assert said(text) == f"{text}\n"


def test_our_marks_give_styles() -> None:
    assert said("[bold]Level[/]: [dim]of[/] x[b]") == "\x1b[1mLevel\x1b[0m: \x1b[2mof\x1b[0m x[b]\n"


def test_tables_show_brackets_as_they_are() -> None:
    stream = io.StringIO()
    MarkedConsole(file=stream, width=80).print(facts({"unit": "[/m]", "[b]": "a[i]"}))
    assert [line.split() for line in stream.getvalue().splitlines()] == [["unit", "[/m]"], ["[b]", "a[i]"]]


def test_a_folder_and_an_archive_with_brackets(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = edited(built(tmp_path / "good"), lambda meta: meta["versions"].update({"[/name]": "[/x] [y]"}))
    folder = written(tmp_path / "a[b]:smile:", files)
    assert main(["info", str(folder)]) == 0
    out = capsys.readouterr().out
    assert "a[b]:smile:" in out
    assert "[/name]" in out
    assert "[/x] [y]" in out
