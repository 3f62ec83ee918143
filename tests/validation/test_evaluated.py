"""Lineages that are interrupted go on where they were, to the same states."""

import numpy as np
import pytest

import nichechain as nc
from nichechain.cli import main
from nichechain.core.errors import NichechainError
from nichechain.core.unfinished import write_unfinished
from nichechain.execution import Threads
from nichechain.validation import evaluated, run_lineages

ASKED = {"l": 3, "lineages": 7, "offspring": 9, "seed": 4}
BIRTHS = 3 * (3 * 7 + 9)


@pytest.fixture(scope="module")
def threads():
    with nc.Threads(1) as pool:
        yield pool


@pytest.fixture
def roots(arm):
    return arm.elites.niche[[3, 12, 20]]


@pytest.fixture
def pieces(monkeypatch):
    """Pieces of 8 births, and how many births were evaluated; the fifth piece is interrupted."""
    for name in ("_FIRST_PIECE", "_LARGEST_PIECE"):
        monkeypatch.setattr(evaluated, name, 8)
    evaluate, sizes = Threads.evaluate, []

    def interrupted(self, domain, genotypes, on_done=None):
        sizes.append(len(genotypes))
        if len(sizes) == 5:
            raise KeyboardInterrupt
        return evaluate(self, domain, genotypes, on_done)

    monkeypatch.setattr(Threads, "evaluate", interrupted)
    return sizes


def stopped(arm, roots, threads, keep):
    with pytest.raises(KeyboardInterrupt):
        run_lineages(arm, roots, threads, **ASKED, keep=keep)


def test_nothing_is_evaluated_twice(arm, roots, threads, tmp_path, pieces):
    keep, told = tmp_path / "new" / "kept", []
    stopped(arm, roots, threads, keep)
    done = sum(pieces[:4])
    assert 0 < done < BIRTHS
    pieces.clear()
    pieces += [0] * 5  # no further interruption
    again = run_lineages(arm, roots, threads, **ASKED, keep=keep, on_done=told.append)
    # All that was kept was repeated by one birth, for a look.
    assert sum(pieces) == BIRTHS - done + 1
    assert sum(told) == BIRTHS
    whole = run_lineages(arm, roots, threads, **ASKED)
    np.testing.assert_array_equal(again.states, whole.states)
    np.testing.assert_array_equal(again.offspring, whole.offspring)


@pytest.mark.usefixtures("pieces")
def test_other_lineages_are_not_taken_for_these(arm, roots, threads, tmp_path, monkeypatch):
    keep = tmp_path / "kept"
    stopped(arm, roots, threads, keep)
    for other, said in (
        ({"seed": 5}, "differ in seed"),
        ({"l": 2, "lineages": 6}, "differ in l, lineages"),
    ):
        with pytest.raises(NichechainError, match=said):
            run_lineages(arm, roots, threads, **{**ASKED, **other}, keep=keep)
    with pytest.raises(NichechainError, match="differ in elites"):
        run_lineages(arm, roots[1:], threads, **ASKED, keep=keep)
    evaluate = type(arm.domain).evaluate

    def elsewhere(self, genotypes):
        found = evaluate(self, genotypes)
        return nc.Evaluation(-found.behavior, found.objective, found.failed)

    monkeypatch.setattr(type(arm.domain), "evaluate", elsewhere)
    with pytest.raises(NichechainError, match="behaves differently now"):
        run_lineages(arm, roots, threads, **ASKED, keep=keep)


@pytest.mark.parametrize("states", [np.zeros(2), np.zeros((2, 2), np.int64)])
def test_damaged(tmp_path, states):
    write_unfinished(tmp_path / "kept", {}, {"states": states})
    with pytest.raises(NichechainError, match="is damaged, remove it: its states are no whole numbers"):
        evaluated.Evaluated(tmp_path / "kept", {})


@pytest.mark.usefixtures("pieces")
def test_the_command_goes_on(arm, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ["--elites", "4", "--lineages", "3", "--l", "2", "--permutations", "5", "--workers", "1"]
    command = ["validate", str(arm.folder), *options, "--out"]
    assert main([*command, "parts"]) == 130
    assert "To go on, add --resume" in capsys.readouterr().out.replace("\n", " ")
    assert [path.name for path in tmp_path.iterdir()] == ["parts.partial"]
    assert main([*command, "parts"]) == 2
    assert "--resume goes on with it, --force starts over" in capsys.readouterr().err
    assert main([*command, "parts", "--resume"]) == 0
    assert main([*command, "whole"]) == 0
    assert not (tmp_path / "parts.partial").exists()
    for name in ("validation.json", "lineages.csv"):
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    (tmp_path / "parts.partial").write_bytes(b"something else")
    assert main([*command, "parts", "--resume"]) == 2
    assert main([*command, "parts", "--resume", "--force"]) == 2
    assert main([*command, "parts", "--force"]) == 0
