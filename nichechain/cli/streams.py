"""Standard streams as a command finds them: closed, full, or of few characters."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

from nichechain.core.text import printable


@contextmanager
def prepared() -> Iterator[None]:
    """What is missing is opened on nothing; progress that cannot be written stops no work."""
    _open_missing()
    before = sys.stderr, warnings.showwarning
    for stream in (sys.stdout, sys.stderr):
        # A stream of ASCII shows question marks for what it lacks.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    sys.stderr = _Forgiving(sys.stderr)
    warnings.showwarning = _say
    try:
        yield
    finally:
        sys.stderr, warnings.showwarning = before
        _let_go(sys.stderr)


def _let_go(stream: TextIO) -> None:
    """Drop what a full disk did not take, which Python would try to write again as it ends, and fail."""
    try:
        stream.flush()
    except OSError:
        with contextlib.suppress(OSError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, stream.fileno())
            os.close(nowhere)
            stream.flush()


def _open_missing() -> None:
    """Open closed streams on nothing, before another file is given their number."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            # The lowest free number is this one.
            os.open(os.devnull, os.O_RDWR)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w", closefd=False))


def _say(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    """A warning in one line, without the line of code that it came from."""
    del category
    print(f"nichechain: warning: {printable(str(message))}", file=sys.stderr, flush=True)


class _Forgiving:
    """Standard error that does not mind a full disk or a closed pipe."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write, if that is possible."""
        with contextlib.suppress(OSError):
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Flush, if that is possible."""
        with contextlib.suppress(OSError):
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)
