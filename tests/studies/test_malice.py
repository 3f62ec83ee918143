"""The folder of a study that somebody else has written into."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from nichechain import ArchiveError, Threads, domains
from nichechain.cli import main
from nichechain.studies import Condition, Study, read_study, run

ARM = domains.make("arm")
STUDY = Study("pressure", "arm", (Condition("a", offspring=2),), 2, 1, (2, 2), ARM.bounds)


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("walked")
    with Threads(1) as threads:
        run(STUDY, folder, threads)
    return folder


@pytest.fixture
def folder(walked: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(walked, tmp_path / "study"))


def test_unfinished_files_of_others_stay(tmp_path: Path) -> None:
    """A study may share its folder with work of whoever asked for it."""
    names = ("draft.tmp", "notes/draft.tmp", "births/mine.tmp", "births/a-0000-0001.parquet.tmp")
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("mine")
    with Threads(1) as threads:
        run(STUDY, tmp_path, threads)
    assert [name for name in names if (tmp_path / name).exists()] == list(names[:3])


def forge(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    path = folder / "study.json"
    values = json.loads(path.read_text())
    change(values)
    path.write_text(json.dumps(values))


@pytest.mark.parametrize(
    "change",
    [
        lambda v: v["study"]["conditions"][0].update(label="a" * 900),
        lambda v: v["study"]["conditions"][0].update(level=[1]),
        lambda v: v["study"].update({"\x1b[31m": 1}),
        lambda v: v["study"].update(shape=[10**30, 10**30]),
        lambda v: v["study"].update(shape=3),
        lambda v: v["study"].update(bounds=[[0, 10**400], [0, 1]]),
        lambda v: v["study"].update(conditions=[[]]),
        lambda v: v["study"].update(domain={}),
        lambda v: v["study"].update(runs=10**30),
        lambda v: v.update(study=[]),
        lambda v: v.update(format="\x1b[31m" * 100),
        lambda v: v.update(unit="a" * 2000),
    ],
)
@pytest.mark.parametrize("verb", ["report", "resume"])
def test_a_forged_study_is_refused_in_one_sentence(
    change: Callable[[dict[str, Any]], object], verb: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    forge(folder, change)
    assert main(["walks", verb, str(folder)]) == 2
    said = capsys.readouterr()
    assert all(c.isprintable() or c == "\n" for c in said.out + said.err)
    (error,) = (line for line in said.err.splitlines() if line.startswith("nichechain: error: "))
    assert len(error) < 500


def test_a_terminal_obeys_nothing_of_a_study(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def change(values: dict[str, Any]) -> None:
        values["unit"] = "\x1b[31m$m$[/]"
        values["versions"] = {"\x9b31m": "\x07"}

    forge(folder, change)
    assert main(["walks", "report", str(folder)]) == 0
    said = capsys.readouterr()
    assert all(c.isprintable() or c == "\n" for c in said.out + said.err)


@pytest.mark.parametrize("content", [b"[" * 100_000, b" " * 2_000_000, b"\xff", b"1", None])
def test_what_is_no_study_is_refused(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "study.json"
    if content is None:
        # A reader of a pipe would wait for ever.
        os.mkfifo(path)
    else:
        path.write_bytes(content)
    with pytest.raises(ArchiveError, match="is no study of walks, or damaged"):
        read_study(tmp_path)
