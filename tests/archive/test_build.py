"""A build leaves the same bytes behind, however it was run."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import FrameType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from nichechain.archive import filling as building
from nichechain.archive import read, write
from nichechain.archive.building import BuildProgress, build
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.domains import Evaluation, PlanarArm
from nichechain.domains.base import Domain
from nichechain.execution import Threads
from nichechain.search import elites, map_elites
from nichechain.search.config import BuildConfig

from ..arms import RoughArm

CONFIG = BuildConfig(
    "arm", (9, 7), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=3000, initial=100, batch=64, scale=0.3, seed=5
)
SHORT = replace(CONFIG, evaluations=333, initial=50, batch=32)


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a folder but the lock."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


def built(folder: Path, *budgets: int, config: BuildConfig = CONFIG, workers: int = 1) -> dict[str, bytes]:
    for evaluations in budgets or (config.evaluations,):
        with Threads(workers) as executor:
            build(replace(config, evaluations=evaluations), folder, executor, domain=RoughArm())
    return content(folder)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return built(tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return built(tmp_path_factory.mktemp("short"), config=SHORT)


@pytest.mark.parametrize("workers", [2, 4])
def test_bytes_do_not_depend_on_the_workers(workers: int, whole: dict[str, bytes], tmp_path: Path) -> None:
    assert built(tmp_path, workers=workers) == whole


@pytest.mark.parametrize(
    "budgets",
    [(30, 777, 3000), (1, 2, 99, 100, 101, 3000), (164, 3000), (2999, 3000), (3000, 3000)],
    ids=str,
)
def test_bytes_do_not_depend_on_extensions(
    budgets: tuple[int, ...], whole: dict[str, bytes], tmp_path: Path
) -> None:
    assert built(tmp_path, *budgets) == whole


def test_bytes_do_not_depend_on_extensions_with_many_parts(
    whole: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(write, "PART_ROWS", 250)
    once = built(tmp_path / "once")
    assert len([name for name in once if name.startswith("births/")]) == 12
    assert built(tmp_path / "often", 30, 250, 251, 777, 1000, 3000) == once
    monkeypatch.setattr(building, "CHECKPOINT_SECONDS", -1.0)
    monkeypatch.setattr(building, "_COMMIT_SHARE", 1e9)
    assert built(tmp_path / "committed", 777, 3000, workers=2) == once
    elites = next(name for name in whole if name.startswith("elites"))
    assert once[elites] == whole[elites]


@pytest.mark.parametrize("replacement", ["first", "newest", "objective"])
@pytest.mark.parametrize("outside", ["state", "absorb", "clip"])
def test_bytes_do_not_depend_on_extensions_in_any_mode(
    replacement: Any, outside: Any, tmp_path: Path
) -> None:
    config = replace(CONFIG, evaluations=500, replacement=replacement, outside=outside)
    once = built(tmp_path / "once", config=config)
    assert built(tmp_path / "often", 30, 133, 500, config=config, workers=2) == once


def test_another_seed_gives_other_bytes(whole: dict[str, bytes], tmp_path: Path) -> None:
    other = built(tmp_path, config=replace(CONFIG, seed=6))
    assert other.keys() == whole.keys()
    assert all(other[name] != whole[name] for name in whole)


class Failing:
    """An executor that raises at one of its calls, before or after the evaluation."""

    def __init__(self, error: BaseException, call: int, after: bool) -> None:
        self.error, self.call, self.after = error, call, after

    def evaluate(
        self, domain: Domain, genotypes: NDArray[np.float32], on_done: Callable[[int], None] | None = None
    ) -> Evaluation:
        self.call -= 1
        if self.call == -1 and not self.after:
            raise self.error
        with Threads(2) as executor:
            evaluation = executor.evaluate(domain, genotypes, on_done)
        if self.call == -1:
            raise self.error
        return evaluation


@pytest.mark.parametrize("error", [RuntimeError("broken"), KeyboardInterrupt()], ids=["error", "interrupt"])
@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize("call", [0, 1, 4, 9])
def test_resumes_after_the_executor_raised(
    error: BaseException, after: bool, call: int, short: dict[str, bytes], tmp_path: Path
) -> None:
    with pytest.raises(type(error)):
        build(SHORT, tmp_path, Failing(error, call, after), domain=RoughArm())
    # What was finished is kept: the initial births, then whole batches.
    if call == 0:
        assert not read.is_archive(tmp_path)
    else:
        assert read.read_meta(tmp_path).births == 50 + 32 * (call - 1)
    assert built(tmp_path, config=SHORT) == short


class Interrupted(RoughArm):
    """An arm that raises in one of its evaluations, in whichever thread."""

    def __init__(self, error: BaseException, call: int) -> None:
        super().__init__()
        self.error = error
        self.calls = itertools.count(-call)

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        if next(self.calls) == 0:
            raise self.error
        return super().evaluate(genotypes)


@pytest.mark.parametrize("error", [MemoryError("broken"), KeyboardInterrupt()], ids=["error", "interrupt"])
@pytest.mark.parametrize("call", [0, 3, 10, 25, 60])
def test_resumes_after_the_domain_raised(
    error: BaseException, call: int, short: dict[str, bytes], tmp_path: Path
) -> None:
    with Threads(2) as executor, pytest.raises(type(error)):
        build(SHORT, tmp_path, executor, domain=Interrupted(error, call))
    assert built(tmp_path, config=SHORT) == short


@pytest.mark.parametrize("call", [0, 1, 2, 7])
def test_resumes_after_an_interrupt_while_keeping(
    call: int, short: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Half a batch in the archive must not be committed."""
    calls = itertools.count()
    put = elites.EliteArchive.put

    def interrupted(self: Any, winners: Any) -> Any:
        result = put(self, winners)
        if next(calls) == call:
            raise KeyboardInterrupt
        return result

    with monkeypatch.context() as patch:
        patch.setattr(elites.EliteArchive, "put", interrupted)
        with Threads(1) as executor, pytest.raises(KeyboardInterrupt):
            build(SHORT, tmp_path, executor, domain=RoughArm())
    assert built(tmp_path, config=SHORT) == short


def interrupt_at(line: int, folder: Path, config: BuildConfig, function: str | None = None) -> bool:
    """Build, with an interrupt before one of the lines run; whether there was such a line.

    Lines are counted as they are run, in one function or in all that build, search and store.
    """
    files = {module.__file__ for module in (building, map_elites, elites, write)}
    lines = 0

    def trace(frame: FrameType, event: str, _argument: object) -> Any:
        nonlocal lines
        if frame.f_code.co_filename not in files or function not in (None, frame.f_code.co_name):
            return None
        if event == "line":
            lines += 1
            if lines == line:
                raise KeyboardInterrupt
        return trace

    before = sys.gettrace()
    with Threads(1) as executor:
        sys.settrace(trace)
        try:
            build(config, folder, executor, domain=RoughArm())
        except KeyboardInterrupt:
            return True
        finally:
            sys.settrace(before)
    return False


def check_interrupts(lines: range, folder: Path, monkeypatch: pytest.MonkeyPatch) -> int:
    """Interrupt at some lines, go on, and compare; how many of the lines there were."""
    monkeypatch.setattr(building, "CHECKPOINT_SECONDS", -1.0)
    monkeypatch.setattr(building, "_COMMIT_SHARE", 1e9)
    monkeypatch.setattr(write, "PART_ROWS", 40)
    config = replace(SHORT, evaluations=146)
    expected = built(folder / "whole", config=config)
    for count, line in enumerate(lines):
        if not interrupt_at(line, folder / str(line), config):
            return count
        if read.is_archive(folder / str(line)):
            meta = read.read_meta(folder / str(line))
            assert len(read.read_births(folder / str(line), meta)) == meta.births
        assert built(folder / str(line), config=config) == expected, f"interrupted at line event {line}"
    return len(lines)


def test_resumes_from_an_interrupt_at_any_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert check_interrupts(range(40, 100_000, 131), tmp_path, monkeypatch) > 10


def test_resumes_from_an_interrupt_at_every_line_of_a_step(tmp_path: Path) -> None:
    config = replace(SHORT, evaluations=60)
    expected = built(tmp_path / "whole", config=config)
    line = 1
    while interrupt_at(line, tmp_path / str(line), config, "advance"):
        assert built(tmp_path / str(line), config=config) == expected, f"interrupted at line event {line}"
        line += 1
    # The initial births and one batch, cut by the budget.
    assert line > 20


@pytest.mark.slow
def test_resumes_from_an_interrupt_at_many_lines(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert check_interrupts(range(1, 100_000, 5), tmp_path, monkeypatch) > 300


def test_resumes_after_many_interrupts(short: dict[str, bytes], tmp_path: Path) -> None:
    for attempt in range(30):
        try:
            build(SHORT, tmp_path, Failing(KeyboardInterrupt(), 1, bool(attempt % 2)), domain=RoughArm())
        except KeyboardInterrupt:
            continue
        break
    assert content(tmp_path) == short


def test_progress(tmp_path: Path) -> None:
    seen: list[BuildProgress] = []
    with Threads(2) as executor:
        build(SHORT, tmp_path, executor, domain=RoughArm(), on_progress=seen.append)
    births = [progress.births for progress in seen]
    assert births == sorted(births)
    assert (births[0], births[-1]) == (0, 333)
    assert max(np.diff(births)) == RoughArm.chunk
    rows = read.read_births(tmp_path, read.read_meta(tmp_path)).to_pandas()
    last = seen[-1]
    assert last.filled == rows["child_niche"][rows["child_niche"] < 63].nunique()
    assert last.outside == (rows["child_niche"] == 63).sum() > 0
    assert last.failed == rows["failed"].notna().sum() > 0
    # Going on, it begins where it stood.
    again: list[BuildProgress] = []
    with Threads(2) as executor:
        build(
            replace(SHORT, evaluations=340), tmp_path, executor, domain=RoughArm(), on_progress=again.append
        )
    assert again[0] == last
    assert again[-1].births == 340


def test_an_interrupt_in_the_progress_bar_loses_nothing(short: dict[str, bytes], tmp_path: Path) -> None:
    calls = itertools.count()

    def interrupt(_progress: BuildProgress) -> None:
        if next(calls) == 30:
            raise KeyboardInterrupt

    with Threads(1) as executor, pytest.raises(KeyboardInterrupt):
        build(SHORT, tmp_path, executor, domain=RoughArm(), on_progress=interrupt)
    assert built(tmp_path, config=SHORT) == short


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": 6}, "was begun with seed = 5: go on with that, or build elsewhere"),
        ({"scale": 1.0}, "scale = 0.3"),
        ({"shape": (9, 8)}, r"shape = \(9, 7\)"),
        ({"outside": "clip"}, "outside = state"),
        ({"replacement": "first", "batch": 2}, "begun with batch = 32, replacement = random"),
        ({"evaluations": 332}, "has 333 births already, more than the 332 asked for"),
    ],
)
def test_configurations_that_do_not_go_on(
    change: dict[str, Any], message: str, short: dict[str, bytes], tmp_path: Path
) -> None:
    built(tmp_path, config=SHORT)
    with Threads(1) as executor, pytest.raises(ArchiveError, match=message):
        build(replace(SHORT, **change), tmp_path, executor, domain=RoughArm())
    assert content(tmp_path) == short


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"domain": "ant"}, "domain is 'ant'"),
        ({"mutation": "levy"}, "mutation is 'levy'"),
        ({"scale": 0.0}, "scale is 0.0"),
        ({"shape": (9,)}, "grid has 1 axes but bounds have 2"),
        ({"shape": (9, 0)}, "every axis needs at least 1 cell"),
        ({"shape": (65_536, 65_536)}, "at most 10000000 cells"),
        ({"bounds": ((0.0, 0.0), (0.0, 1.0))}, "bounds are 0 to 0"),
        ({"outside": "ignore"}, "outside is 'ignore'"),
        ({"shape": (3, 3, 3), "bounds": ((0.0, 1.0),) * 3}, r"behavior has shape \(50, 2\)"),
    ],
)
def test_configurations_that_cannot_begin(change: dict[str, Any], message: str, tmp_path: Path) -> None:
    with Threads(1) as executor, pytest.raises(NichechainError, match=message):
        build(replace(SHORT, **change), tmp_path / "archive", executor)
    assert not read.is_archive(tmp_path / "archive")
    # What only the first births tell is known when there is a folder.
    assert (tmp_path / "archive").exists() == (len(change.get("shape", ())) > 2)


def test_domain_is_made_from_its_name(tmp_path: Path) -> None:
    config = replace(SHORT, evaluations=120)
    with Threads(1) as executor:
        build(config, tmp_path / "named", executor)
        build(config, str(tmp_path / "given"), executor, domain=PlanarArm())
    assert content(tmp_path / "named") == content(tmp_path / "given")


def test_commits_take_no_more_than_a_hundredth_of_the_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where one takes 5 s and a batch 1 s, the second comes 500 s after the first."""
    now = 0.0
    commits = []
    commit = write.Writer.commit

    class Clocked(Threads):
        def evaluate(
            self, domain: Domain, genotypes: NDArray[np.float32], on_done: Callable[[int], None] | None = None
        ) -> Evaluation:
            nonlocal now
            now += 1.0
            return super().evaluate(domain, genotypes, on_done)

    def slowly(writer: write.Writer, state: elites.SearchState) -> None:
        nonlocal now
        commits.append(now)
        now += 5.0
        commit(writer, state)

    monkeypatch.setattr(building, "time", SimpleNamespace(monotonic=lambda: now))
    monkeypatch.setattr(write.Writer, "commit", slowly)
    with Clocked(1) as executor:
        build(replace(SHORT, evaluations=600, initial=1, batch=1), tmp_path, executor)
    assert commits == [31.0, 31.0 + 5.0 + 501.0, 610.0]
