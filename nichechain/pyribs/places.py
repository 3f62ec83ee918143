"""The archives of a search of pyribs: whose cells are niches, and which births their elites are."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.core.checks import as_whole, shown
from nichechain.core.errors import NichechainError
from nichechain.niches import Niches
from nichechain.niches.ribs import empty_archive, niches_of

Ints = NDArray[np.int64]


def home_of(archive: Any, result_archive: Any, niches: Niches | None, outside: str) -> tuple[Any, Niches]:
    """The archive whose cells are the niches of the births, and these niches.

    Parameters
    ----------
    archive, result_archive : archives of pyribs
        Those of a scheduler; ``result_archive`` may be None.
    niches : Niches, optional
        In place of the cells of an archive: one is made that has them, and that the search does not know.
    outside : {"state", "clip"}

    Raises
    ------
    NichechainError
        If no archive has cells that last, and no niches are given.
    """
    from ribs.archives import CategoricalArchive, CVTArchive, GridArchive, SlidingBoundariesArchive

    if isinstance(archive, CategoricalArchive):
        raise NichechainError(
            "the measures of a CategoricalArchive are words, which no grid divides: number the categories "
            "and search with a GridArchive of one cell for each, or import a log that names niches by number"
        )
    if niches is not None:
        if not isinstance(niches, Niches):
            raise NichechainError(
                f"niches are {shown(niches)}, but must be niches of nichechain, such as GridNiches(...)"
            )
        if len(niches.bounds) != archive.measure_dim:
            raise NichechainError(
                f"niches have {len(niches.bounds)} axes, but the archive has {archive.measure_dim} measures: "
                "they must be as many"
            )
        return _passive(archive, result_archive, niches), niches
    for place in (archive, result_archive):
        if isinstance(place, (CVTArchive, GridArchive)):
            return place, niches_of(place, outside)
    if isinstance(archive, SlidingBoundariesArchive):
        raise NichechainError(
            "a SlidingBoundariesArchive moves its cells while it searches, so that no niche lasts: give "
            "niches, such as niches=GridNiches((20, 20), bounds), in which births are then counted"
        )
    if hasattr(archive, "sample_elites"):
        raise NichechainError(
            f"a {type(archive).__name__} has no cells that could be niches: give the scheduler a GridArchive "
            "or CVTArchive as its result_archive, or give niches"
        )
    return archive, niches_of(archive, outside)


def _passive(archive: Any, result_archive: Any, niches: Niches) -> Any:
    """An archive of the niches, for solutions like those of the search."""
    # An archive of densities keeps no solutions, and does not know how long they are.
    model = result_archive if result_archive is not None else archive
    return empty_archive(
        niches,
        solution_dim=model.solution_dim,
        solution_dtype=model.dtypes["solution"],
        objective_dtype=np.float64,
        measures_dtype=np.float64,
    )


class Place(ABC):
    """An archive that elites are drawn from, and which births they are.

    Parameters
    ----------
    archive : archive of pyribs
    """

    def __init__(self, archive: Any) -> None:
        self.archive = archive

    @abstractmethod
    def births_of(self, elites: dict[str, Any]) -> Ints:
        """Births that some elites are, as ``sample_elites`` and ``data`` give them; ``NONE`` if not known."""

    def at(self, numbers: Any) -> dict[str, Any]:
        """Elites by the numbers of their cells.

        Raises
        ------
        NichechainError
            If the archive has no cells.
        """
        raise NichechainError(
            f"parents are {type(numbers).__name__}, but must be elites as archive.sample_elites gives them: "
            f"a {type(self.archive).__name__} has no cells to number"
        )

    @abstractmethod
    def note(
        self,
        solution: NDArray[Any],
        objective: NDArray[Any],
        measures: NDArray[Any],
        entered: NDArray[np.bool_],
        first: int,
    ) -> None:
        """Some births, numbered from ``first``, have been offered, and some have entered."""

    @abstractmethod
    def forget(self) -> None:
        """The archive is empty again."""


class Cells(Place):
    """An archive of cells, each with at most one elite."""

    def __init__(self, archive: Any) -> None:
        super().__init__(archive)
        self._uid_at: dict[int, int] = {}

    def births_of(self, elites: dict[str, Any]) -> Ints:
        """Births of elites, by their cells."""
        cells = np.atleast_1d(elites["index"]).tolist()
        return np.array([self._uid_at.get(cell, NONE) for cell in cells], np.int64)

    def at(self, numbers: Any) -> dict[str, Any]:
        """Elites by the numbers of their cells.

        Raises
        ------
        NichechainError
            If they are no whole numbers.
        """
        return {"index": np.atleast_1d(as_whole("parents", numbers))}

    def note(
        self,
        solution: NDArray[Any],
        objective: NDArray[Any],
        measures: NDArray[Any],
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
        cell = elites["index"]
        # Of equals in a batch pyribs keeps the first, which here is written last.
        for row in np.flatnonzero(same)[::-1].tolist():
            self._uid_at[int(cell[row])] = first + int(rows[row])

    def forget(self) -> None:
        """No cell has an elite."""
        self._uid_at.clear()


class Crowd(Place):
    """An archive without lasting cells, such as one of novelty: elites are known by what they are.

    Parameters
    ----------
    archive : archive of pyribs
    returning : bool
        Whether solutions that did not enter may do so later.
    """

    def __init__(self, archive: Any, returning: bool = False) -> None:
        super().__init__(archive)
        self._returning = returning
        self._uid_of: dict[bytes, int] = {}

    def births_of(self, elites: dict[str, Any]) -> Ints:
        """Births of elites, by their solutions and measures."""
        keys = self._keys(elites["solution"], elites["measures"])
        return np.array([self._uid_of.get(key, NONE) for key in keys], np.int64)

    def note(
        self,
        solution: NDArray[Any],
        objective: NDArray[Any],
        measures: NDArray[Any],
        entered: NDArray[np.bool_],
        first: int,
    ) -> None:
        """Births that entered; who left again is never drawn, and does no harm."""
        del objective
        rows = np.flatnonzero(np.isfinite(measures).all(axis=1) if self._returning else entered)
        for row, key in zip(rows.tolist(), self._keys(solution[rows], measures[rows]), strict=True):
            self._uid_of[key] = first + row

    def forget(self) -> None:
        """Nobody is in it."""
        self._uid_of.clear()

    def _keys(self, solution: NDArray[Any], measures: NDArray[Any]) -> list[bytes]:
        dtypes = self.archive.dtypes
        return as_bytes(
            np.ascontiguousarray(solution, dtypes["solution"]),
            np.ascontiguousarray(measures, dtypes["measures"]),
        )


def place_of(archive: Any) -> Place:
    """How the elites of an archive are told apart."""
    from ribs.archives import CVTArchive, GridArchive, SlidingBoundariesArchive

    if isinstance(archive, (CVTArchive, GridArchive)):
        return Cells(archive)
    return Crowd(archive, returning=isinstance(archive, SlidingBoundariesArchive))


def as_bytes(*columns: NDArray[Any]) -> list[bytes]:
    """Rows of arrays (n, ...) as bytes that can be compared."""
    return [b"".join(part.tobytes() for part in parts) for parts in zip(*columns, strict=True)]
