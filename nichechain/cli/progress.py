"""How commands show that they work: bars on a terminal, plain lines now and then elsewhere."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

    from nichechain.archive.archive import Archive
    from nichechain.archive.filling import BuildProgress
    from nichechain.chain import NicheChain

# Where there is no terminal to redraw: seconds before the first line, and between lines.
_FIRST_LINE, _LINE_EVERY = 2.0, 10.0


_QUIET = ContextVar("quiet", default=False)


@contextmanager
def quietly() -> Iterator[None]:
    """Show no progress within this block."""
    before = _QUIET.set(True)
    try:
        yield
    finally:
        _QUIET.reset(before)


def leave_at_next_interrupt() -> None:
    """Have Ctrl-C end the process at once: all is kept, and only a rollout is still waited for."""
    import os
    import signal

    signal.signal(signal.SIGINT, lambda *_: os._exit(130))


@contextmanager
def spinner(text: str) -> Iterator[None]:
    """Something that turns while a thing is done; one line where there is no terminal and it takes long."""
    shown = _console()
    if shown.is_terminal:
        with shown.status(text):
            yield
        return
    line = threading.Timer(_FIRST_LINE, _say, [text])
    line.daemon = True
    if not _QUIET.get():
        line.start()
    try:
        yield
    finally:
        line.cancel()


def estimated(archive: Archive, estimator: str = "empirical-bayes", **options: Any) -> NicheChain:
    """The chain of an archive, while something turns: a million births take a quarter of a minute."""
    with spinner("estimating T"):
        return archive.chain(estimator, **options)


@contextmanager
def build_progress(total: int, name: str = "") -> Iterator[Callable[[BuildProgress], None]]:
    """A bar of births on standard error; plain lines now and then where that is no terminal.

    Parameters
    ----------
    total : int
        Births that there will be.
    name : str
        Of which of several builds.

    Yields
    ------
    callable
        Told how far the build is.
    """
    shown, clock, lines = _console(), _Clock(), _Lines()
    if not shown.is_terminal:

        def line(now: BuildProgress) -> None:
            clock.begin(now.births)
            if lines.due():
                _say(
                    f"{name and name + ': '}{now.births} of {total} births, {now.filled} niches filled, "
                    f"{now.outside} outside, {now.failed} failed{clock.pace(now.births, total)}"
                )

        yield line
        return
    fields = ("{task.fields[rate]}/s", "{task.fields[filled]} niches", "{task.fields[outside]} outside")
    with _bar(shown, *fields, "{task.fields[failed]}", named=bool(name)) as bar:
        task = bar.add_task(name, total=total, rate="-", filled=0, outside=0, failed="")

        def tell(now: BuildProgress) -> None:
            clock.begin(now.births)
            bar.update(
                task,
                completed=now.births,
                rate=clock.rate(now.births),
                filled=now.filled,
                outside=now.outside,
                failed=f"{now.failed} failed" if now.failed else "",
            )

        yield tell


@contextmanager
def counting(total: int, what: str) -> Iterator[Callable[[int], None]]:
    """A bar with rate and time left, for anything that is counted; lines where it cannot be drawn.

    Parameters
    ----------
    total : int
        How many there will be.
    what : str
        Of what, such as ``evaluations``.

    Yields
    ------
    callable
        Told how many are done.
    """
    shown, clock, lines = _console(), _Clock(), _Lines()
    if not shown.is_terminal:

        def line(done: int) -> None:
            clock.begin(done)
            if lines.due():
                _say(f"{done} of {total} {what}{clock.pace(done, total)}")

        yield line
        return
    with _bar(shown, f"{what}, {{task.fields[rate]}}/s") as bar:
        task = bar.add_task("", total=total, rate="-")

        def draw(done: int) -> None:
            clock.begin(done)
            bar.update(task, completed=done, rate=clock.rate(done))

        yield draw


@contextmanager
def adding(total: int, what: str) -> Iterator[Callable[[int], None]]:
    """As :func:`counting`, but told how many more are done."""
    done = 0
    with counting(total, what) as tell:

        def more(number: int) -> None:
            nonlocal done
            done += number
            tell(done)

        yield more


@contextmanager
def stages() -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each stage of some work, on standard error; plain lines where that is no terminal.

    Yields
    ------
    callable
        Told the stage, and how many of how many are done.
    """
    shown, lines = _console(), _Lines()
    clocks: dict[str, _Clock] = {}
    if not shown.is_terminal:

        def line(stage: str, done: int, total: int) -> None:
            clock = clocks.setdefault(stage, _Clock())
            clock.begin(done)
            if done and lines.due():
                _say(f"{stage}: {done} of {total}{clock.pace(done, total)}")

        yield line
        return
    with _bar(shown, "{task.fields[rate]}/s", named=True) as bar:
        tasks: dict[str, TaskID] = {}

        def tell(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bar.add_task(stage, total=total, rate="-")
                clocks[stage] = _Clock()
                clocks[stage].begin(done)
            bar.update(tasks[stage], completed=done, rate=clocks[stage].rate(done))

        yield tell


def more(tell: Callable[[str, int, int], None], stage: str, total: int) -> Callable[[int], None]:
    """What tells a stage how many more are done."""
    done = 0

    def add(number: int) -> None:
        nonlocal done
        done += number
        tell(stage, done, total)

    return add


def _bar(shown: Console, *texts: str, named: bool = False) -> Progress:
    """A bar with such columns between how much is done and how long the rest will take."""
    from rich import progress

    return progress.Progress(
        *((progress.TextColumn("{task.description}"),) if named else ()),
        progress.BarColumn(bar_width=None),
        progress.MofNCompleteColumn(),
        *map(progress.TextColumn, texts),
        progress.TimeRemainingColumn(compact=True),
        progress.TextColumn("left"),
        console=shown,
    )


def _say(text: str) -> None:
    if not _QUIET.get():
        print(text, file=sys.stderr, flush=True)


def _console() -> Console:
    from nichechain.cli.marks import MarkedConsole

    return MarkedConsole(stderr=True, quiet=_QUIET.get())


class _Lines:
    """When the next line may be written."""

    def __init__(self) -> None:
        self._next = time.monotonic() + _FIRST_LINE

    def due(self) -> bool:
        """Whether it may now; the next one then waits its time."""
        now = time.monotonic()
        if now < self._next:
            return False
        self._next = now + _LINE_EVERY
        return True


class _Clock:
    """Births a second since it began."""

    def __init__(self) -> None:
        self._began: tuple[float, int] | None = None

    def begin(self, births: int) -> None:
        """Start the clock; later calls change nothing."""
        if self._began is None:
            self._began = time.monotonic(), births

    def _speed(self, births: int) -> float:
        assert self._began is not None
        began, first = self._began
        return (births - first) / max(1e-9, time.monotonic() - began)

    def rate(self, births: int) -> str:
        """Births a second, to three digits or so."""
        speed = self._speed(births)
        return f"{speed:.1f}" if speed < 100 else f"{speed:.0f}"

    def pace(self, births: int, total: int) -> str:
        """Rate and time left, to end a line with; nothing while nothing was done since the clock began."""
        speed = self._speed(births)
        return f", {self.rate(births)}/s, {(total - births) / speed:.0f} s left" if speed else ""
