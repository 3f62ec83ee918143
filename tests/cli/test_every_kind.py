"""Every kind of archive through every command: an answer, or one sentence that says why there is none."""

from __future__ import annotations

from pathlib import Path

import pytest

from nichechain.archive.archive import load
from nichechain.cli import main

from .kinds import KINDS, QUESTIONS, made

# Each question is asked of one kind in the fast suite, and of all in the slow one.
DIAGONAL = [(KINDS[k % len(KINDS)], question) for k, question in enumerate(QUESTIONS)]
ALL = [(kind, question) for kind in KINDS for question in QUESTIONS]


@pytest.fixture(scope="session")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("kinds")


def words(root: Path, kind: str, question: str, out: Path) -> list[str]:
    """The command line that asks that question."""
    folder = made(root, kind)
    archive = load(folder)
    births = out / "births.csv"
    if "{births}" in QUESTIONS[question]:
        archive.births().to_csv(births, index=False)
    places = archive.elites.niche if len(archive.elites) else archive.counts.visits.argsort()[-1:]
    niche = archive.niches.label(int(places[0]))
    known = {"archive": folder, "other": made(root, "other"), "niche": niche, "out": out, "births": births}
    return [word.format(**known) for word in QUESTIONS[question]]


def ask(root: Path, kind: str, question: str, out: Path, capsys: pytest.CaptureFixture[str]) -> int:
    """Ask, and hold what is said against what may be said."""
    asked = words(root, kind, question, out)
    capsys.readouterr()
    status = main(asked)
    said = capsys.readouterr()
    assert status in (0, 1, 2)
    assert "Traceback" not in said.out + said.err
    assert "nan" not in said.out.split()
    errors = [line for line in said.err.splitlines() if line.startswith("nichechain: error: ")]
    if status == 2:
        assert len(errors) == 1, said.err
        assert said.err.rstrip().endswith(errors[0])
        assert len(errors[0]) < 500
    else:
        # Only verification has a no for an answer.
        assert status == 0 or question == "verify"
        assert not errors
    return status


@pytest.mark.parametrize(("kind", "question"), DIAGONAL)
def test_an_answer_or_a_sentence(
    kind: str, question: str, root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ask(root, kind, question, tmp_path, capsys)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "question"), ALL)
def test_an_answer_or_a_sentence_to_all(
    kind: str, question: str, root: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ask(root, kind, question, tmp_path, capsys)
