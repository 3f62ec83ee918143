"""Who counts as the parent of what an emitter emits."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError
from nichechain.pyribs.strategies import StrategyParent, centre, is_strategy

Ints = NDArray[np.int64]
StrategyConvention = Literal["mean", "restart"]


class Parents:
    """Parents of what emitters emit, each by its own convention (:class:`Recording` tells of them).

    Parameters
    ----------
    emitters : list of emitters of pyribs
    convention : {"mean", "restart"}
        Of evolution strategies.
    """

    def __init__(self, emitters: list[Any], convention: StrategyConvention) -> None:
        self._emitters = emitters
        self._of_strategies = convention
        self._elites_each: dict[int, int] = {}
        # Births of the last points whose gradients an emitter asked for.
        self._points: dict[int, list[int]] = {}
        self._strategies = {
            number: StrategyParent() for number, emitter in enumerate(emitters) if is_strategy(emitter)
        }

    def of(self, number: int, name: str, size: int, drawn: list[Ints]) -> Ints:
        """Births that the solutions of an emitter come from, (size,).

        Parameters
        ----------
        number : int
            Of the emitter.
        name : {"ask", "ask_dqd"}
        size : int
            Solutions.
        drawn : list of (n,) int64 arrays
            Births of the elites that it has drawn for them.

        Raises
        ------
        NichechainError
            If it drew none, or a number of them that tells nothing.
        """
        if number in self._strategies:
            strategy = self._strategies[number]
            if self._of_strategies == "restart":
                return np.full(size, strategy.restart)
            return np.full(size, strategy.nearest(centre(self._emitters[number])))
        points = self._points.get(number, [])
        if name == "ask_dqd":
            self._points[number] = []
        emitter = self._emitters[number]
        elites = np.concatenate(drawn) if drawn else np.empty(0, np.int64)
        if not elites.size:
            if emitter.archive.empty or not size:
                return np.full(size, NONE)
            if len(points) != size:
                raise NichechainError(
                    f"{type(emitter).__name__} drew no elites from an archive that has some, "
                    "so the parents of its solutions are not known: leave it out of the recording"
                )
            return np.array(points, np.int64)
        if elites.size % size:
            raise NichechainError(
                f"{type(emitter).__name__} drew {elites.size} elites for {size} solutions, "
                "so their parents are not known: it must draw as many, or a multiple"
            )
        self._elites_each[number] = elites.size // size
        return elites[:size]

    def born(
        self, emitter: Ints, solution: NDArray[Any], uid: Ints, fine: NDArray[np.bool_], step: int
    ) -> None:
        """Births have come of emitters (n,); some were not fine, and failed."""
        for number, strategy in self._strategies.items():
            own = (emitter == number) & fine
            if own.any():
                strategy.born(solution[own].reshape(np.count_nonzero(own), -1), uid[own], step)
        for number, points in self._points.items():
            # A point that failed has no niche that a branch could come from.
            points += np.where(fine, uid, NONE)[emitter == number].tolist()

    def told(self, number: int, drawn: list[Ints]) -> None:
        """An emitter was told; a strategy draws an elite meanwhile only to restart from it."""
        if number in self._strategies and drawn:
            (uid,) = drawn[-1].tolist()
            self._strategies[number].restarted(uid)

    def conventions(self) -> list[dict[str, str]]:
        """For every emitter its class and who counts as the parent of what it emits."""
        return [
            {"emitter": type(emitter).__name__, "parent": self._convention(number)}
            for number, emitter in enumerate(self._emitters)
        ]

    def _convention(self, number: int) -> str:
        if number in self._strategies:
            return {
                "mean": "the birth of its last batch nearest to its mean, or the elite of a restart since",
                "restart": "the last elite that it restarted from",
            }[self._of_strategies]
        branches = "; of a branch, the solution that it branches at" if number in self._points else ""
        match self._elites_each.get(number, 0):
            case 0:
                return f"none: it drew no elites{branches}"
            case 1:
                return f"the elite that was drawn{branches}"
            case several:
                return f"the first of {several} elites that were drawn{branches}"
