from contextlib import nullcontext

import pytest

from nichechain.cli import progress


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
