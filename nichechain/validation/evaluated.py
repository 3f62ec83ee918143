"""Keep where births of lineages landed, so that an interruption loses little."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nichechain.core.errors import NichechainError
from nichechain.core.unfinished import read_unfinished, write_unfinished
from nichechain.variation.unborn import Unborn

Ints = NDArray[np.int64]
Told = Callable[[int], None]
Evaluate = Callable[[Unborn, Told | None], Ints]
"""Gives the states of births (n,), and tells how many more it has."""

# An interruption loses the births under way, so they go in pieces that take about so long.
_PIECE_SECONDS = 2.0
_FIRST_PIECE, _LARGEST_PIECE = 256, 65_536
_SAVE_SECONDS = 5.0


class Evaluated:
    """States that births landed in, in the order in which they are asked for.

    Parameters
    ----------
    path : Path, optional
        Where they are kept; nowhere by default.
    made_by : dict
        All that decides which births they are, and where these land, as plain values.
    on_done : callable, optional
        Told how many more are known.

    Raises
    ------
    NichechainError
        If the file is damaged, or what made it differs.
    """

    def __init__(self, path: Path | None, made_by: dict[str, Any], on_done: Told | None = None) -> None:
        self._path, self._made_by, self._on_done = path, made_by, on_done
        kept = read_unfinished(path, made_by, "lineages", "states")
        self._states: Ints = np.zeros(0, np.int64) if kept is None else kept["states"]
        if self._states.ndim != 1 or self._states.dtype != np.int64:
            raise NichechainError(f"{path} is damaged, remove it: its states are no whole numbers")
        self._used, self._piece, self._saved = 0, _FIRST_PIECE, monotonic()

    def of(self, births: Unborn, evaluate: Evaluate) -> Ints:
        """States of some births, (N,): those that are known, and the others by evaluating them.

        Parameters
        ----------
        births : Unborn
        evaluate : callable

        Raises
        ------
        NichechainError
            If the first birth that was kept lands elsewhere now.
        """
        start, end = self._used, self._used + len(births)
        kept = min(self._states.size, end) - start
        if kept > 0:
            if start == 0 and evaluate(births[:1], None)[0] != self._states[0]:
                raise NichechainError(
                    f"{self._path} holds lineages of a domain that behaves differently now: "
                    "start over, or remove it"
                )
            if self._on_done is not None:
                self._on_done(kept)
        try:
            while self._states.size < end:
                began, first = monotonic(), self._states.size - start
                landed = evaluate(births[first : first + self._piece], self._on_done)
                self._states = np.concatenate([self._states, landed])
                if monotonic() - began < _PIECE_SECONDS / 2:
                    self._piece = min(_LARGEST_PIECE, 2 * self._piece)
                if monotonic() - self._saved >= _SAVE_SECONDS:
                    self._save()
        finally:
            if kept < len(births):
                self._save()
        self._used = end
        return self._states[start:end]

    def _save(self) -> None:
        if self._path is not None and self._states.size:
            write_unfinished(self._path, self._made_by, {"states": self._states})
            self._saved = monotonic()
