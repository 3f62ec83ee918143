"""A batch cut into pieces for workers far away, and put together again."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, replace

from nichechain.domains.base import Evaluation

LOSSES = 3
"""Workers that are lost over a row before we take the row for the cause."""

_SHARES = 4
_LARGEST = 16


@dataclass(frozen=True)
class Piece:
    """Rows ``start`` to ``stop`` of a batch, and how many workers they have cost."""

    start: int
    stop: int
    losses: int = 0

    def __len__(self) -> int:
        return self.stop - self.start


class Pieces:
    """Rows of a batch that wait, are out, or are done.

    Pieces shrink with what is left (guided self-scheduling: C. Polychronopoulos and D. Kuck, IEEE
    Transactions on Computers C-36, 1987): large ones first, for few messages, then single chunks,
    for workers to finish together.

    Parameters
    ----------
    rows : int
        Size of the batch.
    chunk : int
        Rows of the smallest piece.
    workers : int
        Among how many to share.
    """

    def __init__(self, rows: int, chunk: int, workers: int) -> None:
        self._rows = rows
        self._chunk = chunk
        self._workers = workers
        self._cut = 0
        self._returned: deque[Piece] = deque()
        self._done: dict[int, Evaluation] = {}
        self.left = rows

    def take(self, *, idle: bool = True) -> Piece | None:
        """The next piece to evaluate; None while all are out or done.

        One that a worker was at when it was lost is for an idle worker only.
        """
        if self._returned:
            return self._returned.popleft() if idle or not self._returned[0].losses else None
        waiting = self._rows - self._cut
        if not waiting:
            return None
        share = math.ceil(waiting / (_SHARES * self._workers * self._chunk))
        start = self._cut
        self._cut = min(self._rows, start + self._chunk * min(share, _LARGEST))
        return Piece(start, self._cut)

    def finish(self, piece: Piece, evaluation: Evaluation) -> None:
        """Keep what became of a piece."""
        self._done[piece.start] = evaluation
        self.left -= len(piece)

    def put_back(self, piece: Piece) -> None:
        """Have a piece evaluated elsewhere whose turn had not come when its worker was lost."""
        self._returned.append(piece)

    def lose(self, piece: Piece) -> bool:
        """Have a piece evaluated elsewhere that a worker was at when it was lost.

        It comes back in chunks, then in rows, so that the one that kills, if one does, is alone.

        Returns
        -------
        bool
            False if it is one row that has cost ``LOSSES`` workers: that row kills whoever
            evaluates it, and does not come back.
        """
        losses = piece.losses + 1
        if losses >= LOSSES and len(piece) == 1:
            return False
        size = self._chunk if losses == 1 else 1
        for start in range(piece.start, piece.stop, size):
            stop = min(start + size, piece.stop)
            self._returned.append(replace(piece, start=start, stop=stop, losses=losses))
        return True

    def evaluation(self) -> Evaluation:
        """The rows of the whole batch, in order, once none is left."""
        return Evaluation.concatenate([self._done[start] for start in sorted(self._done)])
