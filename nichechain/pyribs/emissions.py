"""Solutions between ``ask`` and ``tell``: from whom each came, until it comes back as a birth."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE

Ints = NDArray[np.int64]


class Emissions:
    """What emitters have emitted in one iteration and what of it has come back.

    Solutions are known again by what they are, in whatever order they come. Those that were changed
    on their way, such as clipped to bounds, are known by their place, where all came back in order.
    """

    def __init__(self) -> None:
        self._source: list[tuple[int, int]] = []
        self._taken: list[bool] = []
        self._at: dict[bytes, deque[int]] = defaultdict(deque)
        self._back = 0

    def emit(self, keys: Iterable[bytes], emitter: int, parents: Ints) -> None:
        """Note solutions of one emitter, and their parents (n,)."""
        for key, parent in zip(keys, parents.tolist(), strict=True):
            self._at[key].append(len(self._source))
            self._source.append((emitter, parent))
            self._taken.append(False)

    def take(self, keys: list[bytes], *, single: bool = False) -> tuple[Ints, Ints]:
        """Emitter and parent of solutions that came back, each (n,); ``NONE`` for strangers.

        Parameters
        ----------
        keys : list of bytes
        single : bool
            Solutions come one by one.
        """
        place = [self._known(key) for key in keys]
        expected = range(self._back, self._back + len(keys))
        in_order = all(at in (NONE, right) for at, right in zip(place, expected, strict=True))
        whole = single or len(keys) == len(self._source)
        if in_order and whole:
            for row, right in enumerate(expected):
                if place[row] == NONE and right < len(self._source) and not self._taken[right]:
                    place[row] = right
                    self._taken[right] = True
        self._back += len(keys)
        nobody = (NONE, NONE)
        sources = [nobody if at == NONE else self._source[at] for at in place]
        emitter, parent = np.array(sources, np.int64).reshape(-1, 2).T
        return emitter, parent

    def _known(self, key: bytes) -> int:
        """Where an untaken solution like it was emitted, ``NONE`` if nowhere; it is taken."""
        waiting = self._at.get(key)
        while waiting:
            at = waiting.popleft()
            if not self._taken[at]:
                self._taken[at] = True
                return at
        return NONE
