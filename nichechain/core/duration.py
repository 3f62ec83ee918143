"""What takes long says so before it begins."""

from __future__ import annotations

import warnings

_LONG = 600.0
"""Seconds of which whoever asks is told before."""


def warn_if_long(seconds: float, remedy: str, *, stacklevel: int = 3) -> None:
    """Say so where an answer could take over ten minutes.

    Parameters
    ----------
    seconds : float
        What a processor is guessed to need.
    remedy : str
        What would take less.
    stacklevel : int
        As :func:`warnings.warn` has it: by default it is whoever called the caller that is told.
    """
    if seconds > _LONG:
        warnings.warn(f"this could take {_said(seconds)}: {remedy}", stacklevel=stacklevel)


def _said(seconds: float) -> str:
    """So long, in the largest of minutes, hours and days of which there are two."""
    for size, unit in ((86_400.0, "days"), (3_600.0, "hours")):
        if seconds >= 2.0 * size:
            return f"{seconds / size:,.0f} {unit}" if seconds < 1e6 * size else "for ever"
    return f"{seconds / 60.0:.0f} minutes"
