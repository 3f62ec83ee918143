"""Loops that are compiled by numba, once for each machine where that is possible."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def compiled(function: Callable[..., Any]) -> Any:
    """The function as machine code, which leaves the interpreter to others while it runs.

    Notes
    -----
    The code is kept beside the source, or in the user's cache. Where neither can be written to, such as in a
    container for a user without a home, numba refuses to keep it, and it is compiled whenever it is needed.
    """
    try:
        return numba.njit(nogil=True, cache=True)(function)
    except RuntimeError:
        return numba.njit(nogil=True)(function)
