"""Workers outside this process, any of which may be lost: the loop that keeps them busy."""

from __future__ import annotations

import pickle
import traceback
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from time import monotonic
from types import TracebackType
from typing import NoReturn, Self

import numpy as np
from numpy.typing import NDArray

from nichechain.core.errors import NichechainError
from nichechain.domains.base import Domain, Evaluation
from nichechain.domains.memory import cache_memory_of, check_cache_memory, limit_cache
from nichechain.execution.base import LOOK_SECONDS, WORKER_DIED, all_failed, evaluate_rows
from nichechain.execution.growing import Letter, Receiver, Sender, by_parent
from nichechain.execution.pieces import LOSSES, Piece, Pieces
from nichechain.variation.unborn import Unborn

_AHEAD = 2
"""Pieces with a worker at a time: one under way, and the next, so that it never waits for us."""

_HOPELESS = 8
"""Rows that workers died of before any row came back, after which the domain is the cause."""

_PATIENCE = 300.0
"""Seconds without any worker, after which none is expected any more."""


@dataclass(frozen=True)
class Raised:
    """An exception on its way from a worker to the caller, where it will be raised again."""

    error: Exception
    trace: str

    @staticmethod
    def of(error: Exception) -> Raised:
        """The exception as something that surely can be sent."""
        trace = "".join(traceback.format_exception(error))
        try:
            # Not every exception that can be pickled can be made again from its pickle.
            pickle.loads(pickle.dumps(error))  # noqa: S301  # our own, a moment old
        except Exception:
            plain = RuntimeError(f"{type(error).__name__}: {error}")
            for note in getattr(error, "__notes__", ()):
                plain.add_note(note)
            return Raised(plain, trace)
        return Raised(error, trace)

    def again(self) -> NoReturn:
        """Raise it here, with a note of where it came from."""
        self.error.add_note(f"in a worker:\n{self.trace}")
        raise self.error


Outcome = Evaluation | Raised | None
Rows = NDArray[np.float32] | Letter


class Workbench:
    """A worker's side: its copy of the domain, and evaluations on it.

    Parameters
    ----------
    domain : bytes
        The pickled domain.
    cache_memory : int
        Bytes that its cache may take.
    """

    def __init__(self, domain: bytes, cache_memory: int) -> None:
        self._pickled = domain
        self._cache_memory = cache_memory
        self._domain: Domain | None = None
        self._receiver = Receiver()

    def prepare(self) -> Raised | None:
        """Unpack the domain; what it raised, if it did."""
        try:
            self._domain = pickle.loads(self._pickled)  # noqa: S301  # from our own driver
            limit_cache(self._domain, self._cache_memory)
        except Exception as error:
            return Raised.of(error)
        return None

    def evaluate(self, rows: Rows) -> Evaluation | Raised:
        """Rows of a batch, or what went so wrong that it is not for a row to bear."""
        if self._domain is None and (raised := self.prepare()) is not None:
            return raised
        assert self._domain is not None
        try:
            if isinstance(rows, Letter):
                return evaluate_rows(self._domain, self._receiver.unborn(rows))
            # A copy, for Ray's arrays are read-only, which a domain need not expect.
            return evaluate_rows(self._domain, rows.copy())
        except Exception as error:
            return Raised.of(error)


class Worker(ABC):
    """A worker as its fleet sees it; it does what it is sent in order.

    Attributes
    ----------
    ready : Future
        Done when the worker has the domain.
    sender : Sender
        What it has been told of unborn children.
    """

    ready: Future[Outcome]

    def __init__(self) -> None:
        self.sender = Sender()

    @abstractmethod
    def submit(self, rows: Rows) -> Future[Outcome]:
        """Send rows of a batch."""

    @abstractmethod
    def stop(self, *, kill: bool) -> None:
        """End the worker: kill it, whatever it is at, or let it leave if it is idle."""


class Fleet(ABC):
    """An executor whose workers may be lost; their rows are evaluated elsewhere.

    A lost worker is replaced. A row that costs one worker after another has failed, and its reason
    is ``WORKER_DIED``. The domain travels to each worker once.
    """

    _lost: tuple[type[BaseException], ...]
    """What a worker's futures raise when it is no more."""

    def __init__(self, cache_memory: int | None = None) -> None:
        if cache_memory is not None:
            check_cache_memory(cache_memory)
        self._cache_memory = cache_memory
        self._cache_share = 0
        self._crew: list[Worker] = []
        self._domain: Domain | None = None
        self._proven = False

    @abstractmethod
    def _size(self) -> int:
        """How many workers there should be now."""

    @abstractmethod
    def _neighbours(self) -> int:
        """How many workers share the memory of a machine, at most."""

    @abstractmethod
    def _send(self, domain: bytes) -> None:
        """Take a pickled domain for the workers hired from now on."""

    @abstractmethod
    def _hire(self) -> Worker:
        """A new worker, on its way to being ready."""

    def evaluate(
        self,
        domain: Domain,
        genotypes: NDArray[np.float32] | Unborn,
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        """Evaluate genotypes (N, P), N at least 1, telling ``on_done`` of every finished piece's size.

        Raises
        ------
        NichechainError
            If no worker can be had, or workers die of every row, so that it is the domain's doing.
        """
        try:
            if domain is not self._domain:
                import cloudpickle

                self._dismiss(kill=False)
                self._send(cloudpickle.dumps(domain))
                memory = cache_memory_of(domain) if self._cache_memory is None else self._cache_memory
                self._cache_share = memory // self._neighbours()
                self._domain = domain
                self._proven = False
            size = self._size()
            back = None
            if isinstance(genotypes, Unborn):
                genotypes, back = by_parent(genotypes)
            pieces = Pieces(len(genotypes), domain.chunk, size)
            _Shift(self, domain, pieces, genotypes, on_done).work(size)
        except BaseException:
            # What is still out is of no use to anybody, and an interrupt must not wait for it.
            self._dismiss(kill=True)
            raise
        evaluation = pieces.evaluation()
        return evaluation if back is None else evaluation.take(back)

    def close(self) -> None:
        """End the workers."""
        self._dismiss(kill=False)

    def _dismiss(self, *, kill: bool) -> None:
        self._domain = None
        while self._crew:
            self._crew.pop().stop(kill=kill)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class _Shift:
    """The evaluation of one batch: who is at which pieces."""

    def __init__(
        self,
        fleet: Fleet,
        domain: Domain,
        pieces: Pieces,
        genotypes: NDArray[np.float32] | Unborn,
        on_done: Callable[[int], None] | None,
    ) -> None:
        import cloudpickle

        self._fleet = fleet
        self._domain = domain
        self._pieces = pieces
        self._genotypes = genotypes
        self._mutate = cloudpickle.dumps(genotypes.mutate) if isinstance(genotypes, Unborn) else b""
        self._on_done = on_done
        self._held: dict[Worker, deque[Piece]] = {}
        self._news: SimpleQueue[tuple[Worker, Piece | None, Future[Outcome]]] = SimpleQueue()
        self._false_starts = 0
        self._given_up = 0

    def work(self, size: int) -> None:
        """Until no row is left."""
        for worker in self._fleet._crew:
            self._watch(worker, None, worker.ready)
        while len(self._fleet._crew) < size:
            self._hire()
        while self._pieces.left:
            worker, piece, future = self._next()
            if worker not in self._fleet._crew:
                continue
            try:
                outcome = future.result()
            except self._fleet._lost as error:
                self._replace(worker, error)
                continue
            if isinstance(outcome, Raised):
                outcome.again()
            if piece is None:
                self._false_starts = 0
                self._held[worker] = deque()
            else:
                assert outcome is not None
                self._held[worker].remove(piece)
                self._fleet._proven = True
                self._finish(piece, outcome)
            self._supply(worker)

    def _next(self) -> tuple[Worker, Piece | None, Future[Outcome]]:
        """What happens next, or an error where no worker comes."""
        since = monotonic()
        while True:
            try:
                return self._news.get(timeout=min(LOOK_SECONDS, _PATIENCE))
            except Empty:
                if not self._held and monotonic() - since >= _PATIENCE:
                    raise NichechainError(
                        f"no worker could be started within {_PATIENCE:.0f} s: are there free processors?"
                    ) from None

    def _finish(self, piece: Piece, outcome: Evaluation) -> None:
        self._pieces.finish(piece, outcome)
        if self._on_done is not None:
            self._on_done(len(piece))

    def _watch(self, worker: Worker, piece: Piece | None, future: Future[Outcome]) -> None:
        future.add_done_callback(lambda done: self._news.put((worker, piece, done)))

    def _hire(self) -> None:
        worker = self._fleet._hire()
        self._fleet._crew.append(worker)
        self._watch(worker, None, worker.ready)

    def _supply(self, worker: Worker) -> None:
        held = self._held[worker]
        # A suspect has its worker to itself: a result that is lost on its way with the next piece's
        # worker would else look like a worker lost to it.
        while len(held) < _AHEAD and not any(piece.losses for piece in held):
            piece = self._pieces.take(idle=not held)
            if piece is None:
                break
            held.append(piece)
            rows = self._genotypes[piece.start : piece.stop]
            if isinstance(rows, Unborn):
                self._watch(worker, piece, worker.submit(worker.sender.letter(rows, self._mutate)))
            else:
                self._watch(worker, piece, worker.submit(rows))

    def _replace(self, worker: Worker, error: BaseException) -> None:
        """Hire for a lost worker, and give its pieces to the others."""
        self._fleet._crew.remove(worker)
        worker.stop(kill=True)
        held = self._held.pop(worker, None)
        if held is None:
            self._false_starts += 1
            if self._false_starts == LOSSES:
                raise NichechainError(f"{LOSSES} workers in a row died as they started: {error}") from error
        elif held:
            # It worked in order, so it was at the first; the others only waited.
            culprit = held.popleft()
            if not self._pieces.lose(culprit):
                self._give_up(culprit)
            for piece in held:
                self._pieces.put_back(piece)
        self._hire()
        for other in self._held:
            self._supply(other)

    def _give_up(self, piece: Piece) -> None:
        """Record a row as failed that no worker outlives."""
        self._given_up += 1
        if self._given_up == _HOPELESS and not self._fleet._proven:
            raise NichechainError(
                f"evaluating each of {_HOPELESS} rows has cost {LOSSES} workers, and none has come back: "
                "the domain crashes, or memory ran out"
            )
        self._finish(piece, all_failed(self._domain, len(piece), WORKER_DIED))
