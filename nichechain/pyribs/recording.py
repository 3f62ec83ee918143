"""Births of a search that pyribs runs: which elite each solution came from."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from types import TracebackType
from typing import Any, Literal, get_args

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.births.acceptance import one_by_one
from nichechain.births.table import NONE
from nichechain.core.checks import check_choice, shown
from nichechain.core.errors import NichechainError
from nichechain.niches import Niches
from nichechain.niches.base import is_inside, precision_of
from nichechain.pyribs.batches import are_batch, finite, spread
from nichechain.pyribs.emissions import Emissions
from nichechain.pyribs.ledger import Ledger
from nichechain.pyribs.parents import Parents, StrategyConvention
from nichechain.pyribs.places import as_bytes, home_of, place_of
from nichechain.pyribs.strategies import check_draws

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Outside = Literal["state", "clip"]

_OF_ARCHIVES = ("add", "add_single", "sample_elites", "clear")
_OF_EMITTERS = ("ask", "ask_dqd", "tell", "tell_dqd")


class Recording:
    """The births of a search of pyribs, as they happen.

    It looks on as elites are drawn and solutions added. The search is the one that it would be
    without, bit for bit, but for one thing: solutions with an objective or measures that are not
    finite become failed births, where pyribs would raise for the whole batch.

    A loop of your own, without a scheduler, is recorded while its block runs::

        with Recording(archive) as recording:
            for _ in range(iterations):
                elites = archive.sample_elites(32)
                recording.parents(elites)
                archive.add(*evaluate(mutate(elites["solution"])))

    Parameters
    ----------
    archive : archive of pyribs
        What the search adds to. Elites that it holds already become initial births.
    emitters : iterable of ribs.emitters.EmitterBase
    result_archive : archive of pyribs, optional
        What the search adds to as well.
    niches : Niches, optional
        Where births are counted; by default the cells of ``archive``, or of ``result_archive`` where
        that is the one with cells (novelty search, density descent).
    outside : {"state", "clip"}
        Where measures out of range belong, unless ``niches`` say it. pyribs puts them in the nearest
        cell without a word; ``state`` records them in a state of their own, ``clip`` in that cell. A
        solution that pyribs keeps in an edge cell may be drawn as an elite either way, and its
        children then come from the state that it is recorded in.
    strategy_parent : {"mean", "restart"}
        Whom the solutions of an evolution strategy come from, since it draws no elites for them.
        ``mean``: of the births of the emitter's last batch, the one nearest to its mean; where it
        has restarted since, the elite that it restarted from. ``restart``: always the last elite
        that it restarted from. Solutions before there is such a one are initial births.

    Raises
    ------
    NichechainError
        If no archive has cells that last and no niches are given, an emitter draws no elites, or the
        archive is being recorded already.

    Notes
    -----
    Parents are exact for emitters that draw as many elites as they emit solutions (GaussianEmitter,
    GeneticAlgorithmEmitter with an operator of one parent, :class:`MutationEmitter`). Of those that
    draw a multiple (IsoLineEmitter, whose first n elites get the isotropic noise and whose second n
    the directions), the first n count. Branches of a GradientOperatorEmitter come from the solutions
    that they branch at. What an emitter emits while the archive is empty are initial births, as are
    solutions that no emitter made. Which convention holds is part of the archive.
    """

    def __init__(
        self,
        archive: Any,
        emitters: Iterable[Any] = (),
        *,
        result_archive: Any = None,
        niches: Niches | None = None,
        outside: Outside = "state",
        strategy_parent: StrategyConvention = "mean",
    ) -> None:
        check_choice("outside", outside, get_args(Outside))
        check_choice("strategy_parent", strategy_parent, get_args(StrategyConvention))
        if recording_of(archive) is not None:
            raise NichechainError("the archive is being recorded already: use that recording")
        self.archive = archive
        self.emitters = list(emitters)
        self.strategy_parent = strategy_parent
        check_draws(self.emitters, (archive, result_archive))
        self.home, self.niches = home_of(archive, result_archive, niches, outside)
        self._asked_for = (niches, outside, strategy_parent)
        self._step = 0
        self._told = self._busy = self._adding = False
        self._ledger = Ledger(len(self.niches.bounds))
        self._emissions = Emissions()
        self._drawn: list[Ints] = []
        self._announced: deque[int] = deque()
        self._parents = Parents(self.emitters, strategy_parent)
        drawn = [emitter.archive for emitter in self.emitters] or [archive]
        self._places = [place_of(each) for each in _distinct([self.home, *drawn])]
        known = [each for each in (archive, result_archive) if each is not None]
        self._filled = [each for each in known if each is archive or _among(each, [self.home, *drawn])]
        self._offered: list[Bools | None] = [None] * len(self._filled)
        self._record_elites()
        self._look_on(known)

    def __repr__(self) -> str:
        return f"Recording({len(self)} births, {len(self.home)} of {len(self.niches)} cells filled)"

    def __len__(self) -> int:
        """Number of births."""
        return len(self._ledger)

    def __enter__(self) -> Recording:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def stop(self) -> None:
        """Look on no more: what happens from now on is not recorded."""
        for each in (*self._filled, *(place.archive for place in self._places), *self.emitters):
            for name in (*_OF_ARCHIVES, *_OF_EMITTERS):
                vars(each).pop(name, None)

    def births(self) -> pa.Table:
        """The births so far, with the columns of :mod:`nichechain.births.table`."""
        return self._ledger.table()

    @property
    def step(self) -> int:
        """The last iteration, from 0."""
        return self._step

    def elites(self) -> tuple[Ints, Ints, Ints]:
        """Cells of the elites, and their births: uid and depth, each (K,)."""
        data = self.home.data(["index", "solution", "measures"])
        uid = self._places[0].births_of(data)
        return data["index"].astype(np.int64), uid, self._ledger.depths(uid)

    def conventions(self) -> list[dict[str, str]]:
        """For every emitter its class and who counts as the parent of what it emits."""
        return self._parents.conventions()

    def parents(self, elites: Any) -> None:
        """Say whose children the next solutions are that a loop of your own adds.

        Parameters
        ----------
        elites : dict or ints
            As ``archive.sample_elites`` or ``archive.data`` gives them, or the numbers of their
            cells: one for each solution that is added next, in order.

        Raises
        ------
        NichechainError
            If one of them is no elite of the archive.
        """
        place = next((each for each in self._places if each.archive is self.archive), self._places[0])
        if not isinstance(elites, dict):
            elites = place.at(elites)
        uid = place.births_of(elites)
        if (uid == NONE).any():
            raise NichechainError(
                f"parent {int(np.argmax(uid == NONE))} is no elite that was recorded: parents are elites as "
                "archive.sample_elites gives them, from the archive as it is now"
            )
        self._begin()
        self._announced = deque(uid.tolist())

    def check_settings(self, niches: Niches | None, outside: str, strategy_parent: str) -> None:
        """Refuse settings that this recording does not have.

        Raises
        ------
        NichechainError
            If one of them differs.
        """
        names = ("niches", "outside", "strategy_parent")
        given = (niches, outside, strategy_parent)
        for name, value, own in zip(names, given, self._asked_for, strict=True):
            if value != own:
                raise NichechainError(
                    f"{name} is {shown(value)}, "
                    f"but the scheduler is being recorded already, with {own!r}, which "
                    "must stay: stop() that recording first"
                )

    def _look_on(self, archives: list[Any]) -> None:
        """Overlay instances, not classes, so that other archives and emitters stay as they are."""
        for number, archive in enumerate(self._filled):
            archive.add = partial(self._add, number)
            archive.add_single = partial(self._add_single, number)
        for number, place in enumerate(self._places):
            if _among(place.archive, archives):
                place.archive.sample_elites = partial(self._sample_elites, number)
                place.archive.clear = partial(self._clear, number)
        for number, emitter in enumerate(self.emitters):
            for name in ("ask", "ask_dqd"):
                setattr(emitter, name, partial(self._ask, number, name))
            for name in ("tell", "tell_dqd"):
                setattr(emitter, name, partial(self._tell, number, name))

    # What pyribs calls instead of its own.

    def _sample_elites(self, number: int, *args: Any, **kwargs: Any) -> Any:
        place = self._places[number]
        drawn = type(place.archive).sample_elites(place.archive, *args, **kwargs)
        if self._busy:
            self._drawn.append(place.births_of(drawn))
        else:
            self._begin()
        return drawn

    def _clear(self, number: int) -> None:
        place = self._places[number]
        type(place.archive).clear(place.archive)
        if not self._adding:
            place.forget()

    def _begin(self) -> None:
        """An iteration begins where elites are drawn after births."""
        if self._told:
            self._told = False
            self._step += 1
            self._emissions = Emissions()

    @contextmanager
    def _drawing(self) -> Iterator[None]:
        self._drawn.clear()
        self._busy = True
        try:
            yield
        finally:
            self._busy = False

    def _ask(self, number: int, name: str) -> Any:
        self._begin()
        emitter = self.emitters[number]
        with self._drawing():
            solutions = getattr(type(emitter), name)(emitter)
        parents = self._parents.of(number, name, len(solutions), self._drawn)
        self._emissions.emit(self._keys(solutions), number, parents)
        return solutions

    def _tell(self, number: int, name: str, *args: Any, **kwargs: Any) -> Any:
        emitter = self.emitters[number]
        with self._drawing():
            result = getattr(type(emitter), name)(emitter, *args, **kwargs)
        self._parents.told(number, self._drawn)
        return result

    def _add(self, number: int, solution: Any, objective: Any, measures: Any, **fields: Any) -> Any:
        archive = self._filled[number]
        solution, measures = np.asarray(solution), np.asarray(measures)
        objective = None if objective is None else np.asarray(objective)
        add = partial(self._own, archive, "add")
        if not are_batch(solution, objective, measures):
            # pyribs says what is wrong with it.
            return add(solution, objective, measures, **fields)
        self._check_announced(len(measures))
        fine = finite(objective, measures)
        if fine.all():
            info = add(solution, objective, measures, **fields)
        else:
            some = {}
            if fine.any():
                rest = {name: np.asarray(values)[fine] for name, values in fields.items()}
                of_fine = None if objective is None else objective[fine]
                some = add(solution[fine], of_fine, measures[fine], **rest)
            info = spread(some, fine)
        self._offer(number, solution, objective, measures, fine, np.asarray(info["status"]) > 0)
        return info

    def _add_single(self, number: int, solution: Any, objective: Any, measures: Any, **fields: Any) -> Any:
        archive = self._filled[number]
        add_single = partial(self._own, archive, "add_single")
        if self._adding:
            # An archive that adds a batch one by one, or its elites again, tells of no birth by that.
            return add_single(solution, objective, measures, **fields)
        solution, measures = np.asarray(solution)[None], np.asarray(measures)[None]
        one = None if objective is None else np.asarray(objective)[None]
        if not are_batch(solution, one, measures):
            return add_single(solution[0], objective, measures[0], **fields)
        fine = finite(one, measures)
        if fine[0]:
            info = add_single(solution[0], objective, measures[0], **fields)
        else:
            info = {name: values[0] for name, values in spread({}, fine).items()}
        entered = np.atleast_1d(np.asarray(info["status"]) > 0)
        self._offer(number, solution, one, measures, fine, entered, single=True)
        return info

    def _own(self, archive: Any, name: str, *args: Any, **kwargs: Any) -> Any:
        """What the archive does itself."""
        before, self._adding = self._adding, True
        try:
            return getattr(type(archive), name)(archive, *args, **kwargs)
        finally:
            self._adding = before

    # What is made of it.

    def _keys(self, solutions: Any) -> list[bytes]:
        """Solutions by their bytes, as the archive of elites stores them."""
        return as_bytes(np.ascontiguousarray(solutions, self.home.dtypes["solution"]))

    def _check_announced(self, size: int) -> None:
        if self._announced and len(self._announced) < size:
            raise NichechainError(
                f"{size} solutions are added, but parents() named {len(self._announced)} parents: there must "
                "be one for each"
            )

    def _offer(
        self,
        number: int,
        solution: NDArray[Any],
        objective: NDArray[Any] | None,
        measures: NDArray[Any],
        fine: Bools,
        entered: Bools,
        *,
        single: bool = False,
    ) -> None:
        """Solutions are births once every archive of the search has been offered them."""
        self._offered[number] = entered
        if number < len(self._filled) - 1:
            return
        if any(each is None or len(each) != len(fine) for each in self._offered):
            raise NichechainError(
                f"{len(fine)} solutions were added to the result archive and not to the archive before it: "
                "add the same to both, as a scheduler does"
            )
        entry = dict(zip(map(id, self._filled), self._offered, strict=True))
        self._offered = [None] * len(self._filled)
        nobody = np.zeros(len(fine), bool)
        entries = [entry.get(id(place.archive), nobody) for place in self._places]
        self._record(solution, objective, measures, fine, entries, single=single)

    def _record(
        self,
        solution: NDArray[Any],
        objective: NDArray[Any] | None,
        measures: NDArray[Any],
        fine: Bools,
        entries: list[Any],
        *,
        single: bool = False,
    ) -> None:
        """Note births, of which ``entries`` tells who entered which place."""
        self._told = True
        size = len(fine)
        worth = np.zeros(size) if objective is None else objective
        if not _among(self.home, self._filled) and fine.any():
            entries[0] = np.zeros(size, bool)
            entries[0][fine] = self.home.add(solution[fine], worth[fine], measures[fine])["status"] > 0
        emitter, parents = self._emissions.take(self._keys(solution), single=single)
        if self._announced:
            parents = np.array([self._announced.popleft() for _ in range(size)], np.int64)
        uid = np.arange(len(self), len(self) + size)
        cell = np.full(size, NONE)
        state = cell.copy()
        if fine.any():
            cell[fine] = self.home.index_of(measures[fine])
            state[fine] = self._states(measures[fine], cell[fine])
        for place, entered in zip(self._places, entries, strict=True):
            place.note(solution, worth, measures, entered, len(self))
        self._parents.born(emitter, solution, uid, fine, self._step)
        told = np.full(size, np.nan) if objective is None else objective.astype(np.float64)
        accepted = one_by_one(cell, worth, entries[0])
        self._ledger.add(parents, measures.astype(np.float64), told, fine, state, accepted, self._step)

    def _states(self, measures: NDArray[Any], cell: Ints) -> Ints:
        """Cells as pyribs numbers them, and the outside state for what is out of range."""
        if self.niches.outside == "clip":
            return cell
        inside = is_inside(measures.astype(np.float64), self.niches.bounds, precision_of(measures))
        return np.where(inside, cell, len(self.niches))

    def _record_elites(self) -> None:
        """Elites that were there before become initial births."""
        for number, place in enumerate(self._places):
            if place.archive.empty:
                continue
            data = place.archive.data(["solution", "objective", "measures", "index"])
            new = place.births_of(data) == NONE
            solution, objective, measures = (
                data[name][new] for name in ("solution", "objective", "measures")
            )
            fine = np.ones(len(objective), bool)
            entries = [fine if each == number else ~fine for each in range(len(self._places))]
            if fine.size:
                self._record(solution, objective, measures, fine, entries)


def recording_of(searched: Any) -> Recording | None:
    """The recording of an archive, or of the archive of a scheduler, if there is one."""
    archive = getattr(searched, "archive", searched)
    overlay = vars(archive).get("add") if hasattr(archive, "__dict__") else None
    owner = getattr(getattr(overlay, "func", None), "__self__", None)
    return owner if isinstance(owner, Recording) else None


def _among(one: Any, several: Iterable[Any]) -> bool:
    """Whether an object is one of several; archives have no equality worth the name."""
    return any(each is one for each in several)


def _distinct(archives: list[Any]) -> list[Any]:
    return [each for number, each in enumerate(archives) if not _among(each, archives[:number])]
