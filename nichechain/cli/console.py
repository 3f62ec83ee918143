"""What the commands share: reading options, tables, and a progress bar that suits logs too."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from nichechain.archive.filling import BuildProgress
    from nichechain.search.savings import Savings

Command = TypeVar("Command")

# Seconds between progress lines where there is no terminal to redraw.
_LINE_EVERY = 10.0


def parse(
    command: Callable[..., Command],
    arguments: Sequence[str],
    default: Command | None = None,
    name: str | None = None,
) -> Command:
    """Read a command's options; exits with status 2 and a message if they are not well-formed.

    Parameters
    ----------
    command : dataclass
    arguments : sequence of str
    default : instance, optional
        Values of the options that are not given.
    name : str, optional
        What the command is called, by default as its class without ``Command``.
    """
    import tyro

    name = name or called(command)
    if "--json" in arguments and any(f.name == "format" for f in fields(command)):  # type: ignore[arg-type]
        # The one spelling that every command with a table knows.
        place = list(arguments).index("--json")
        arguments = [*arguments[:place], "--format", "json", *arguments[place + 1 :]]
    given = {} if default is None else {"default": default}
    read: Command = tyro.cli(command, prog=f"nichechain {name}", args=list(arguments), **given)  # type: ignore[call-overload]
    return read


def called(command: Callable[..., Command]) -> str:
    """What users call a command, from the name of its class."""
    return command.__name__.removesuffix("Command").lower()


def option(metavar: str, default: str) -> Any:
    """How the help shows an option whose default is worked out later."""
    import tyro

    return tyro.conf.arg(metavar=metavar, help_behavior_hint=f"(default: {default})")


def console() -> Console:
    """Standard output, with colours only where it is a terminal that wants them."""
    from rich.console import Console

    return Console(highlight=False, soft_wrap=not sys.stdout.isatty())


def table(*columns: str, title: str | None = None) -> Table:
    """An empty table; columns after the first are right-aligned."""
    from rich import box
    from rich.table import Table

    made = Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)
    for number, column in enumerate(columns):
        made.add_column(column, justify="right" if number else "left")
    return made


def facts(rows: dict[str, str]) -> Table:
    """Names and values, one pair a line."""
    from rich.table import Table

    made = Table.grid(padding=(0, 2))
    made.add_column(style="dim")
    made.add_column(overflow="fold")
    for name, value in rows.items():
        made.add_row(name, value)
    return made


def physics(savings: Savings) -> dict[str, str]:
    """The line on physics that was not computed, where a domain kept count."""
    if not savings.steps:
        return {}
    share = savings.known / savings.steps
    return {"physics spared": f"{share:.0%} of {savings.steps} steps, known from earlier episodes"}


def leave_at_next_interrupt() -> None:
    """Have Ctrl-C end the process at once: all is kept, and only a rollout is still waited for."""
    import os
    import signal

    signal.signal(signal.SIGINT, lambda *_: os._exit(130))


def spinner(text: str) -> Any:
    """Something that turns while a thing is loaded; nothing where there is no terminal."""
    from rich.console import Console

    return Console(stderr=True).status(text)


@contextmanager
def build_progress(total: int) -> Iterator[Callable[[BuildProgress], None]]:
    """A progress bar on standard error; plain lines now and then where that is no terminal."""
    from rich.console import Console

    shown = Console(stderr=True)
    if shown.is_terminal:
        with _bar(shown, total) as tell:
            yield tell
    else:
        yield _lines(total)


@contextmanager
def _bar(shown: Console, total: int) -> Iterator[Callable[[BuildProgress], None]]:
    from rich import progress

    columns = (
        progress.BarColumn(bar_width=None),
        progress.MofNCompleteColumn(),
        progress.TextColumn("{task.fields[rate]}/s"),
        progress.TextColumn("{task.fields[filled]} niches"),
        progress.TextColumn("{task.fields[outside]} outside"),
        progress.TextColumn("{task.fields[failed]}"),
        progress.TimeRemainingColumn(compact=True),
        progress.TextColumn("left"),
    )
    with progress.Progress(*columns, console=shown) as bar:
        task = bar.add_task("", total=total, rate="-", filled=0, outside=0, failed="")
        clock = _Clock()

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


def _lines(total: int) -> Callable[[BuildProgress], None]:
    clock = _Clock()
    last = time.monotonic()

    def tell(now: BuildProgress) -> None:
        nonlocal last
        clock.begin(now.births)
        if time.monotonic() - last < _LINE_EVERY:
            return
        last = time.monotonic()
        left = clock.seconds_left(now.births, total)
        print(
            f"{now.births} of {total} births, {clock.rate(now.births)}/s, {now.filled} niches filled, "
            f"{now.outside} outside, {now.failed} failed, {left:.0f} s left",
            file=sys.stderr,
            flush=True,
        )

    return tell


@contextmanager
def counting(total: int, what: str) -> Iterator[Callable[[int], None]]:
    """A progress bar with rate and time left, for anything that is counted; lines where it cannot be drawn.

    Parameters
    ----------
    total : int
        How many there will be.
    what : str
        Of what, such as ``evaluations``.
    """
    from rich import progress
    from rich.console import Console

    shown = Console(stderr=True)
    clock = _Clock()
    if not shown.is_terminal:
        last = time.monotonic()

        def line(done: int) -> None:
            nonlocal last
            clock.begin(done)
            if time.monotonic() - last >= _LINE_EVERY:
                last = time.monotonic()
                left = clock.seconds_left(done, total)
                text = f"{done} of {total} {what}, {clock.rate(done)}/s, {left:.0f} s left"
                print(text, file=sys.stderr, flush=True)

        yield line
        return
    columns = (
        progress.BarColumn(bar_width=None),
        progress.MofNCompleteColumn(),
        progress.TextColumn(f"{what}, {{task.fields[rate]}}/s"),
        progress.TimeRemainingColumn(compact=True),
        progress.TextColumn("left"),
    )
    with progress.Progress(*columns, console=shown) as bar:
        task = bar.add_task("", total=total, rate="-")

        def draw(done: int) -> None:
            clock.begin(done)
            bar.update(task, completed=done, rate=clock.rate(done))

        yield draw


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

    def seconds_left(self, births: int, total: int) -> float:
        """Time that the rest will take at this speed."""
        speed = self._speed(births)
        return (total - births) / speed if speed else 0.0 if births >= total else float("inf")


@contextmanager
def stages() -> Iterator[Callable[[str, int, int], None]]:
    """A bar for each stage of some work, on standard error; plain lines where that is no terminal.

    Yields
    ------
    callable
        Told the stage, and how many of how many are done.
    """
    from rich import progress
    from rich.console import Console

    shown = Console(stderr=True)
    if not shown.is_terminal:
        yield _stage_lines()
        return
    columns = (
        progress.TextColumn("{task.description}"),
        progress.BarColumn(bar_width=None),
        progress.MofNCompleteColumn(),
        progress.TextColumn("{task.fields[rate]}/s"),
        progress.TimeRemainingColumn(compact=True),
        progress.TextColumn("left"),
    )
    with progress.Progress(*columns, console=shown) as bar:
        tasks: dict[str, progress.TaskID] = {}
        clocks: dict[str, _Clock] = {}

        def tell(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bar.add_task(stage, total=total, rate="-")
                clocks[stage] = _Clock()
                clocks[stage].begin(done)
            bar.update(tasks[stage], completed=done, rate=clocks[stage].rate(done))

        yield tell


def _stage_lines() -> Callable[[str, int, int], None]:
    clocks: dict[str, _Clock] = {}
    last = time.monotonic()

    def tell(stage: str, done: int, total: int) -> None:
        nonlocal last
        clock = clocks.setdefault(stage, _Clock())
        clock.begin(done)
        if not done or time.monotonic() - last < _LINE_EVERY:
            return
        last = time.monotonic()
        left = clock.seconds_left(done, total)
        print(
            f"{stage}: {done} of {total}, {clock.rate(done)}/s, {left:.0f} s left",
            file=sys.stderr,
            flush=True,
        )

    return tell
