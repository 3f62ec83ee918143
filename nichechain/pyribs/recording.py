"""Births of a search that pyribs runs: which elite each solution came from."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable
from functools import partial
from typing import Any, Literal, get_args

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain import births
from nichechain.births.table import NONE, Offspring
from nichechain.core.checks import check_choice
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Evaluation
from nichechain.niches import Niches
from nichechain.niches.base import is_inside, precision_of
from nichechain.niches.ribs import niches_of
from nichechain.pyribs.strategies import StrategyParent, centre, is_strategy

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
StrategyConvention = Literal["mean", "restart"]
Outside = Literal["state", "clip"]

_NOT_FINITE = "objective or measures are not finite"


def record(
    scheduler: Any, *, outside: Outside = "state", strategy_parent: StrategyConvention = "mean"
) -> Recording:
    """Record a scheduler of pyribs from now on.

    Parameters
    ----------
    scheduler : ribs.schedulers.Scheduler or BanditScheduler
        Its archive must be a GridArchive or CVTArchive.
    outside, strategy_parent
        See :class:`Recording`.

    Returns
    -------
    Recording

    Raises
    ------
    NichechainError
        If the archive is of another kind, or is being recorded already.
    """
    emitters = getattr(scheduler, "emitter_pool", None)
    if emitters is None:
        emitters = scheduler.emitters
    return Recording(scheduler.archive, emitters, outside=outside, strategy_parent=strategy_parent)


class Recording:
    """The births of a search of pyribs, as they happen.

    It looks on as emitters draw elites and as solutions are added. The search is the one that it
    would be without, bit for bit, but for one thing: solutions with an objective or measures that
    are not finite become failed births, where pyribs would raise for the whole batch.

    Parameters
    ----------
    archive : ribs.archives.GridArchive or CVTArchive
        Where emitters draw their elites from. Elites that it holds already become initial births.
    emitters : iterable of ribs.emitters.EmitterBase
    outside : {"state", "clip"}
        Where measures out of range belong. pyribs puts them in the nearest cell without a word;
        ``state`` records them in a state of their own, ``clip`` in that cell. A solution that pyribs
        keeps in an edge cell may be drawn as an elite either way, and its children then come from
        the state that it is recorded in.
    strategy_parent : {"mean", "restart"}
        Whom the solutions of an evolution strategy come from, since it draws no elites for them.
        ``mean``: of the births of the emitter's last batch, the one nearest to its mean; where it
        has restarted since, the elite that it restarted from. ``restart``: always the last elite
        that it restarted from. Solutions before there is such a one are initial births.

    Raises
    ------
    NichechainError
        If the archive is of another kind, or is being recorded already.

    Notes
    -----
    Parents are exact for emitters that draw as many elites as they emit solutions (GaussianEmitter,
    GeneticAlgorithmEmitter with an operator of one parent, :class:`MutationEmitter`). Of those that
    draw a multiple (IsoLineEmitter, whose first n elites get the isotropic noise and whose second n
    the directions), the first n count. What an emitter emits while the archive is empty are initial
    births, as are solutions that no emitter made. Which convention holds is part of the archive.
    """

    def __init__(
        self,
        archive: Any,
        emitters: Iterable[Any],
        *,
        outside: Outside = "state",
        strategy_parent: StrategyConvention = "mean",
    ) -> None:
        check_choice("outside", outside, get_args(Outside))
        check_choice("strategy_parent", strategy_parent, get_args(StrategyConvention))
        if isinstance(getattr(archive.__dict__.get("add"), "__self__", None), Recording):
            raise NichechainError("the archive is being recorded already: use that recording")
        self.niches: Niches = niches_of(archive, outside)
        self.archive = archive
        self.emitters = list(emitters)
        self.strategy_parent = strategy_parent
        self._clip = outside == "clip"
        self._step = 0
        self._told = False
        self._niche: list[int] = []
        self._depth: list[int] = []
        self._uid_at: dict[int, int] = {}
        self._tables: list[pa.Table] = []
        # Where solutions that were emitted and not yet added come from.
        self._emitted: dict[bytes, deque[tuple[int, int]]] = defaultdict(deque)
        self._drawn: list[Ints] = []
        self._elites_each: dict[int, int] = {}
        self._strategies = {
            number: StrategyParent() for number, emitter in enumerate(self.emitters) if is_strategy(emitter)
        }
        if not archive.empty:
            self._record_elites()
        # Instances are overlaid, not classes, so that other archives and emitters stay as they are.
        for name in ("add", "add_single", "sample_elites", "clear"):
            setattr(archive, name, getattr(self, f"_{name}"))
        for number, emitter in enumerate(self.emitters):
            for name in ("ask", "ask_dqd"):
                setattr(emitter, name, partial(self._ask, number, name))
            emitter.tell = partial(self._tell, number)

    def __repr__(self) -> str:
        return f"Recording({len(self)} births, {len(self.archive)} of {len(self.niches)} cells filled)"

    def __len__(self) -> int:
        """Number of births."""
        return len(self._niche)

    def births(self) -> pa.Table:
        """The births so far, with the columns of :mod:`nichechain.births.table`."""
        empty = births.schema(self.archive.measure_dim).empty_table()
        return pa.concat_tables([empty, *self._tables])

    @property
    def step(self) -> int:
        """The last iteration, from 0."""
        return self._step

    def elites(self) -> tuple[Ints, Ints, Ints]:
        """Cells of the elites in pyribs' archive, and their births: uid and depth, each (K,)."""
        cells = self.archive.data("index").astype(np.int64)
        uid = np.array([self._uid_at[cell] for cell in cells.tolist()], np.int64)
        return cells, uid, np.array(self._depth, np.int64)[uid]

    def conventions(self) -> list[dict[str, str]]:
        """For every emitter its class and who counts as the parent of what it emits."""
        return [
            {"emitter": type(emitter).__name__, "parent": self._convention(number)}
            for number, emitter in enumerate(self.emitters)
        ]

    def _convention(self, number: int) -> str:
        if number in self._strategies:
            return {
                "mean": "the birth of its last batch nearest to its mean, or the elite of a restart since",
                "restart": "the last elite that it restarted from",
            }[self.strategy_parent]
        match self._elites_each.get(number, 0):
            case 0:
                return "none: it drew no elites"
            case 1:
                return "the elite that was drawn"
            case several:
                return f"the first of {several} elites that were drawn"

    # What pyribs calls instead of its own.

    def _sample_elites(self, *args: Any, **kwargs: Any) -> Any:
        drawn = type(self.archive).sample_elites(self.archive, *args, **kwargs)
        self._drawn.append(drawn["index"].astype(np.int64))
        return drawn

    def _clear(self) -> None:
        type(self.archive).clear(self.archive)
        self._uid_at.clear()

    def _ask(self, number: int, name: str) -> Any:
        if self._told:
            self._told = False
            self._step += 1
            self._emitted.clear()
        emitter = self.emitters[number]
        self._drawn.clear()
        solutions = getattr(type(emitter), name)(emitter)
        parents = self._parents(number, len(solutions))
        for key, parent in zip(self._keys(solutions), parents.tolist(), strict=True):
            self._emitted[key].append((number, parent))
        return solutions

    def _tell(self, number: int, *args: Any, **kwargs: Any) -> Any:
        emitter = self.emitters[number]
        self._drawn.clear()
        result = type(emitter).tell(emitter, *args, **kwargs)
        if number in self._strategies and self._drawn:
            # While it is told, a strategy draws an elite only to restart from it.
            (cell,) = self._drawn[-1].tolist()
            self._strategies[number].restarted(self._uid_at[cell])
        return result

    def _add(self, solution: Any, objective: Any, measures: Any, **fields: Any) -> Any:
        solution, objective, measures = np.asarray(solution), np.asarray(objective), np.asarray(measures)
        add = partial(type(self.archive).add, self.archive)
        if not _are_batch(solution, objective, measures):
            # pyribs says what is wrong with it.
            return add(solution, None if objective.dtype == object else objective, measures, **fields)
        fine = self._finite(objective, measures)
        if fine.all():
            info = add(solution, objective, measures, **fields)
        else:
            info = {"status": np.zeros(len(fine), np.int32), "value": np.full(len(fine), np.nan)}
            if fine.any():
                rest = {name: np.asarray(values)[fine] for name, values in fields.items()}
                for name, values in add(solution[fine], objective[fine], measures[fine], **rest).items():
                    info[name][fine] = values
        self._record(solution, objective, measures, fine, np.asarray(info["status"]) > 0)
        return info

    def _add_single(self, solution: Any, objective: Any, measures: Any, **fields: Any) -> Any:
        solution, measures = np.asarray(solution)[None], np.asarray(measures)[None]
        one = np.asarray(objective)[None]
        add_single = partial(type(self.archive).add_single, self.archive)
        if not _are_batch(solution, one, measures):
            return add_single(solution[0], objective, measures[0], **fields)
        fine = self._finite(one, measures)
        if fine[0]:
            info = add_single(solution[0], objective, measures[0], **fields)
        else:
            info = {"status": np.int32(0), "value": np.float64(np.nan)}
        self._record(solution, one, measures, fine, np.array([info["status"] > 0]))
        return info

    # What is made of it.

    def _parents(self, number: int, size: int) -> Ints:
        """Births that the solutions of an emitter come from, (size,)."""
        if number in self._strategies:
            strategy = self._strategies[number]
            if self.strategy_parent == "restart":
                return np.full(size, strategy.restart)
            return np.full(size, strategy.nearest(centre(self.emitters[number])))
        drawn = np.concatenate(self._drawn) if self._drawn else np.empty(0, np.int64)
        if not drawn.size:
            if not self.archive.empty:
                raise NichechainError(
                    f"{type(self.emitters[number]).__name__} drew no elites from an archive that has some, "
                    "so the parents of its solutions are not known: leave it out of the recording"
                )
            return np.full(size, NONE)
        if drawn.size % size:
            raise NichechainError(
                f"{type(self.emitters[number]).__name__} drew {drawn.size} elites for {size} solutions, "
                "so their parents are not known: it must draw as many, or a multiple"
            )
        self._elites_each[number] = drawn.size // size
        return np.array([self._uid_at[cell] for cell in drawn[:size].tolist()], np.int64)

    def _keys(self, solutions: Any) -> list[bytes]:
        """Solutions by their bytes, as the archive stores them."""
        rows = np.ascontiguousarray(solutions, self.archive.dtypes["solution"])
        return [row.tobytes() for row in rows]

    @staticmethod
    def _finite(objective: NDArray[Any], measures: NDArray[Any]) -> NDArray[np.bool_]:
        fine: NDArray[np.bool_] = np.isfinite(objective) & np.isfinite(measures).all(axis=1)
        return fine

    def _record(
        self,
        solution: NDArray[Any],
        objective: NDArray[Any],
        measures: NDArray[Any],
        fine: NDArray[np.bool_],
        entered: NDArray[np.bool_],
    ) -> None:
        """Note births that the archive has just been offered."""
        self._told = True
        origins = [
            self._emitted[key].popleft() if self._emitted.get(key) else (NONE, NONE)
            for key in self._keys(solution)
        ]
        first = len(self)
        uid = np.arange(first, first + len(fine))
        cell = np.full(len(fine), NONE)
        state = cell.copy()
        if fine.any():
            cell[fine] = self.archive.index_of(measures[fine])
            state[fine] = cell[fine] if self._clip else self._states(measures[fine], cell[fine])
        parents = np.array([parent for _, parent in origins], np.int64)
        known = parents != NONE
        parent_niche, depth = np.full(len(fine), NONE), np.zeros(len(fine), np.int64)
        parent_niche[known] = [self._niche[parent] for parent in parents[known].tolist()]
        depth[known] = [self._depth[parent] + 1 for parent in parents[known].tolist()]
        self._niche += state.tolist()
        self._depth += depth.tolist()
        self._note_elites(solution, objective, measures, cell, entered, first)
        for number, strategy in self._strategies.items():
            own = np.array([emitter == number for emitter, _ in origins]) & fine
            if own.any():
                strategy.born(solution[own].reshape(np.count_nonzero(own), -1), uid[own], self._step)
        offspring = Offspring(
            np.empty((len(fine), 0), np.float32), uid, parents, parent_niche, depth, np.zeros(len(fine), bool)
        )
        evaluation = Evaluation(
            np.where(fine[:, None], measures, np.nan).astype(np.float64),
            np.where(fine, objective, np.nan).astype(np.float64),
            ~fine,
            tuple("" if good else _NOT_FINITE for good in fine),
        )
        accepted = _one_by_one(cell, objective, entered)
        self._tables.append(
            births.make_table(offspring, evaluation, child_niche=state, accepted=accepted, step=self._step)
        )

    def _states(self, measures: NDArray[Any], cell: Ints) -> Ints:
        """Cells as pyribs numbers them, and the outside state for what is out of range."""
        inside = is_inside(measures.astype(np.float64), self.niches.bounds, precision_of(measures))
        return np.where(inside, cell, len(self.niches))

    def _note_elites(
        self,
        solution: NDArray[Any],
        objective: NDArray[Any],
        measures: NDArray[Any],
        cell: Ints,
        entered: NDArray[np.bool_],
        first: int,
    ) -> None:
        """Which of some births are elites now; an add tells neither cells nor which of several won."""
        rows = np.flatnonzero(entered)
        if not rows.size:
            return
        dtypes = self.archive.dtypes
        _, elites = self.archive.retrieve(measures[rows])
        same = np.all(
            [
                (solution[rows].astype(dtypes["solution"]) == elites["solution"])
                .reshape(len(rows), -1)
                .all(axis=1),
                objective[rows].astype(dtypes["objective"]) == elites["objective"],
                (measures[rows].astype(dtypes["measures"]) == elites["measures"]).all(axis=1),
            ],
            axis=0,
        )
        # Of equals in a batch pyribs keeps the first, which here is written last.
        for row in rows[same][::-1].tolist():
            self._uid_at[int(cell[row])] = first + row

    def _record_elites(self) -> None:
        """Elites that were there before become initial births."""
        data = self.archive.data(["solution", "objective", "measures"])
        fine = np.ones(len(data["objective"]), bool)
        self._record(data["solution"], data["objective"], data["measures"], fine, fine)


def _are_batch(solution: NDArray[Any], objective: NDArray[Any], measures: NDArray[Any]) -> bool:
    """Whether solutions, objectives and measures are as many numbers as they should be."""
    numbers = all(np.issubdtype(values.dtype, np.number) for values in (objective, measures))
    shaped = solution.ndim >= 1 and objective.ndim == 1 and measures.ndim == 2
    return numbers and shaped and len(solution) == len(objective) == len(measures)


def _one_by_one(cell: Ints, objective: NDArray[Any], entered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Who would have become an elite, births of a batch being offered one by one.

    pyribs says who is better than the elites before the batch, of which all but one are not kept.
    """
    best: dict[int, float] = {}
    accepted = entered.copy()
    for row in np.flatnonzero(entered).tolist():
        niche, value = int(cell[row]), float(objective[row])
        accepted[row] = value > best.get(niche, -np.inf)
        if accepted[row]:
            best[niche] = value
    return accepted
