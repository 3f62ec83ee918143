import sys
import threading
from contextlib import nullcontext

import pytest

from nichechain.cli import progress


@pytest.fixture(autouse=True)
def _first_line_at_once(_no_line_on_a_busy_machine, monkeypatch):
    monkeypatch.setattr(progress, "_FIRST_LINE", 0.0)


@pytest.mark.parametrize("quiet", [False, True])
def test_lines_unless_quiet(quiet, capsys, monkeypatch):
    monkeypatch.setattr(progress, "_LINE_EVERY", 0.0)
    with progress.quietly() if quiet else nullcontext(), progress.counting(200, "things") as tell:
        tell(50)
        tell(100)
    assert ("100 of 200 things" in capsys.readouterr().err) is not quiet


def test_quiet_ends_with_its_block(capsys, monkeypatch):
    monkeypatch.setattr(progress, "_LINE_EVERY", 0.0)
    with progress.quietly(), progress.spinner("waiting"):
        pass
    with progress.stages() as tell:
        tell("one", 1, 2)
    assert capsys.readouterr().err.startswith("one: 1 of 2")


def test_a_line_tells_no_pace_before_there_is_one(capsys, monkeypatch):
    monkeypatch.setattr(progress, "_LINE_EVERY", 0.0)
    with progress.counting(200, "things") as tell:
        tell(1)
        tell(200)
    first, last = capsys.readouterr().err.splitlines()
    assert first == "1 of 200 things"
    assert last.startswith("200 of 200 things, ")
    assert last.endswith("/s, 0 s left")


def test_the_first_line_comes_soon_and_the_next_when_some_time_is_over(capsys, monkeypatch):
    now = 0.0
    monkeypatch.setattr(progress.time, "monotonic", lambda: now)
    monkeypatch.setattr(progress, "_FIRST_LINE", 2.0)
    with progress.counting(200, "things") as tell:
        for now in (0.0, 1.9, 2.1, 11.9, 12.2):
            tell(int(10 * now))
    assert [line.split()[0] for line in capsys.readouterr().err.splitlines()] == ["21", "122"]


@pytest.mark.parametrize("quiet", [False, True])
def test_what_takes_long_is_said_without_a_terminal(quiet, capsys, monkeypatch):
    said = threading.Event()

    def print_and_tell(text):
        print(text, file=sys.stderr)
        said.set()

    monkeypatch.setattr(progress, "_say", print_and_tell)
    with progress.quietly() if quiet else nullcontext(), progress.spinner("waiting"):
        assert quiet or said.wait(60)
    assert capsys.readouterr().err == ("" if quiet else "waiting\n")


def test_what_is_over_soon_is_not_said(capsys, monkeypatch):
    monkeypatch.setattr(progress, "_FIRST_LINE", 3600.0)
    before = threading.active_count()
    with progress.spinner("waiting"):
        assert threading.active_count() == before + 1
    assert capsys.readouterr().err == ""
