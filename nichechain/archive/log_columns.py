"""Columns of another program's log as births."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import ArrayLike, NDArray

from nichechain import births
from nichechain.births.joins import repeated
from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError
from nichechain.niches import Niches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_UNKNOWN = "the log has no child"


@dataclass(frozen=True)
class Columns:
    """Which columns of a log are what.

    Parameters
    ----------
    parent, child : str or tuple of str
        One name: states by their number, the niches of the grid in C order and then the outside
        state. A tuple of names: behavior, one column for each axis, or one column of lists. A null,
        NaN or -1 parent is that of an initial birth; a null or NaN child failed.
    run : str, optional
        What tells runs apart: whole numbers or words, renumbered in sorted order.
    uid : str, optional
        Number of the child within its run; by default births are numbered in the order of the log.
    elite : str, optional
        Number of the parent within its run, which tells siblings from cousins; null or -1 for none.
    step : str, optional
        Step of the search.
    lineage : str, optional
        True or 1 where the parent was not selected but is the latest birth of a lineage; by default
        nowhere.
    objective : str, optional
        Objective of the child; by default it is not known.
    """

    parent: str | tuple[str, ...] = "parent_niche"
    child: str | tuple[str, ...] = "child_niche"
    run: str | None = None
    uid: str | None = None
    elite: str | None = None
    step: str | None = None
    lineage: str | None = None
    objective: str | None = None

    @property
    def names(self) -> list[str]:
        """All columns that are read."""
        of_states = [
            [given] if isinstance(given, str) else list(given) for given in (self.parent, self.child)
        ]
        given = (self.run, self.uid, self.elite, self.step, self.lineage, self.objective)
        others = [name for name in given if name is not None]
        return list(dict.fromkeys([*of_states[0], *of_states[1], *others]))


@dataclass(frozen=True)
class LogReader:
    """Reads columns of a log, and says in which row something is wrong.

    Parameters
    ----------
    table : pyarrow.Table
    niches : Niches
    """

    table: pa.Table
    niches: Niches

    def births(self, columns: Columns) -> pa.Table:
        """The rows as births."""
        size, dimensions = len(self.table), len(self.niches.bounds)
        parent, _ = self._states(columns.parent, whole=True)
        child, behavior = self._states(columns.child)
        run = self._runs(columns.run)
        uid = self._whole(columns.uid, lowest=0) if columns.uid else _within_runs(run)
        elite = self._whole(columns.elite, lowest=NONE, nulls=True) if columns.elite else np.full(size, NONE)
        step = self._whole(columns.step, lowest=0, nulls=True) if columns.step else np.full(size, NONE)
        if columns.uid:
            _check_unique(run, uid, columns.uid)
        lost = (parent != NONE) & (elite == NONE) if columns.elite else np.zeros(size, bool)
        if lost.any():
            raise NichechainError(
                f"row {_row(lost)} has a parent's niche but no {columns.elite}: "
                "leave the column out, or fill it"
            )
        lineage = self._yes(columns.lineage) if columns.lineage else np.zeros(size, bool)
        orphan = lineage & (parent == NONE)
        if orphan.any():
            raise NichechainError(
                f"row {_row(orphan)} has {columns.lineage} but no parent, which every birth of a lineage has"
            )
        gone = child == NONE
        nothing = pa.nulls(size)
        objective = nothing
        if columns.objective:
            worth = self._numbers(columns.objective)
            objective = pa.array(worth, mask=gone | ~np.isfinite(worth))
        failed = np.where(gone, _UNKNOWN, "")
        arrays = [
            run,
            uid,
            pa.array(elite, mask=(elite == NONE) | (parent == NONE)),
            # How many generations lie behind a birth, and who was accepted, a log does not say.
            nothing,
            pa.array(parent, mask=parent == NONE),
            pa.array(child, mask=gone),
            *(
                nothing if behavior is None else pa.array(behavior[:, axis], mask=gone)
                for axis in range(dimensions)
            ),
            objective,
            nothing,
            pa.array(failed, pa.string(), mask=~gone),
            pa.array(step, mask=step == NONE),
            lineage,
        ]
        schema = births.schema(dimensions)
        try:
            cast = [pa.array(array).cast(kind.type) for array, kind in zip(arrays, schema, strict=True)]
        except pa.ArrowInvalid as error:
            raise NichechainError(f"a number is too large to be imported: {error}") from error
        return pa.Table.from_arrays(cast, schema=schema)

    def _states(self, given: str | tuple[str, ...], *, whole: bool = False) -> tuple[Ints, Floats | None]:
        """States, and behavior where that is what is given; ``whole`` ones have all of it or none."""
        if isinstance(given, str):
            state = self._whole(given, lowest=NONE if whole else 0, nulls=True)
            odd = state >= self.niches.states
            if odd.any():
                at = _row(odd)
                raise NichechainError(
                    f"row {at} has {given} {state[at - 1]}, but states run from 0 to {self.niches.states - 1}"
                )
            return state, None
        axes = len(self.niches.bounds)
        if len(given) == 1 and _are_lists(self.table[given[0]].type):
            behavior, kinds = self._lists(given[0], axes), [self.table[given[0]].type.value_type]
        else:
            if len(given) != axes:
                raise NichechainError(
                    f"behavior has columns {', '.join(given)}, but the grid has {axes} axes"
                )
            behavior = np.stack([self._numbers(name) for name in given], axis=1)
            kinds = [self.table[name].type for name in given]
        missing = np.isnan(behavior)
        half = missing.any(axis=1) & ~missing.all(axis=1)
        # A parent without any is that of an initial birth; half a behavior is a mistake.
        if whole and half.any():
            raise NichechainError(f"row {_row(half)} has only some of {', '.join(given)}: give all or none")
        known = ~missing.any(axis=1)
        state = np.full(len(behavior), NONE, np.int64)
        endless = known & np.isinf(behavior).any(axis=1)
        if endless.any():
            raise NichechainError(f"row {_row(endless)} has an infinite behavior, which belongs to no niche")
        narrow = all(pa.types.is_float32(kind) for kind in kinds)
        state[known] = self.niches.of(behavior[known].astype(np.float32 if narrow else np.float64))
        return state, behavior

    def _lists(self, name: str, axes: int) -> Floats:
        """A column of lists, each of a number for each axis or nothing at all, (N, axes)."""
        column = self.table[name].combine_chunks()
        length = pc.list_value_length(column).fill_null(0).to_numpy(zero_copy_only=False)
        odd = (length != axes) & (length != 0)
        if odd.any():
            at = _row(odd)
            raise NichechainError(
                f"row {at} has {length[at - 1]} numbers in {name}, but must have {axes}, one for each axis"
            )
        values = pc.list_flatten(column)
        if not (pa.types.is_integer(values.type) or pa.types.is_floating(values.type)):
            raise NichechainError(f"column {name!r} has values of type {column.type}, but must have numbers")
        behavior = np.full((len(column), axes), np.nan)
        flat = values.cast(pa.float64()).fill_null(np.nan).to_numpy(zero_copy_only=False)
        behavior[length == axes] = flat.reshape(-1, axes)
        return behavior

    def _numbers(self, name: str) -> Floats:
        column = self.table[name]
        if not (
            pa.types.is_integer(column.type)
            or pa.types.is_floating(column.type)
            or column.null_count == len(column)
        ):
            raise NichechainError(f"column {name!r} has values of type {column.type}, but must have numbers")
        numbers: Floats = column.cast(pa.float64()).fill_null(np.nan).to_numpy().astype(np.float64)
        return numbers

    def _whole(self, name: str, *, lowest: int, nulls: bool = False) -> Ints:
        column = self.table[name]
        # Numbers beyond 2**53 would not survive being floating-point.
        if pa.types.is_integer(column.type) and not column.null_count:
            if pa.types.is_uint64(column.type) and (pc.max(column).as_py() or 0) >= 2**63:
                raise NichechainError(f"{name} has {pc.max(column)}, but a whole number is less than 2**63")
            whole: Ints = column.to_numpy().astype(np.int64)
            none = np.zeros(whole.size, bool)
        else:
            values = self._numbers(name)
            none = np.isnan(values)
            odd = ~none & ~((values == np.floor(values)) & (np.abs(values) < 2.0**63))
            if odd.any():
                raise NichechainError(
                    f"row {_row(odd)} has {name} {values[odd][0]:g}, but must have a whole number below 2**63"
                )
            whole = np.where(none, NONE, values).astype(np.int64)
        low = ~none & (whole < lowest)
        if low.any():
            raise NichechainError(f"row {_row(low)} has {name} {whole[low][0]}, but must not be negative")
        if none.any() and not nulls:
            raise NichechainError(f"row {_row(none)} has no {name}, but every birth must have one")
        return whole

    def _yes(self, name: str) -> NDArray[np.bool_]:
        column = self.table[name]
        if pa.types.is_boolean(column.type):
            said: NDArray[np.bool_] = column.fill_null(False).to_numpy().astype(bool)
            return said
        number = self._whole(name, lowest=0, nulls=True)
        odd = number > 1
        if odd.any():
            raise NichechainError(
                f"row {_row(odd)} has {name} {number[odd][0]}, but must have true or false, or 1 or 0"
            )
        one: NDArray[np.bool_] = number == 1
        return one

    def _runs(self, name: str | None) -> Ints:
        if name is None:
            return np.zeros(len(self.table), np.int64)
        column = self.table[name]
        if column.null_count:
            raise NichechainError(
                f"row {_row(column.is_null().to_numpy())} has no {name}, but every birth must have one"
            )
        if pa.types.is_nested(column.type):
            raise NichechainError(f"column {name!r} has values of type {column.type}, but must name runs")
        if pa.types.is_floating(column.type) and pc.any(pc.is_nan(column)).as_py():
            odd = pc.is_nan(column).to_numpy()
            raise NichechainError(f"row {_row(odd)} has no {name}, but every birth must have one")
        known = column.combine_chunks().dictionary_encode()
        # Numbers in the order of the runs' names, not of their first rows.
        order = np.argsort(pc.array_sort_indices(known.dictionary).to_numpy())
        run: Ints = order[known.indices.to_numpy()].astype(np.int64)
        return run


def _are_lists(kind: pa.DataType) -> bool:
    kinds = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
    return any(each(kind) for each in kinds)


def _within_runs(run: Ints) -> Ints:
    """Numbers from 0 within each run."""
    order = np.argsort(run, kind="stable")
    births = np.bincount(run)
    uid = np.empty_like(run)
    uid[order] = np.arange(run.size) - np.repeat(np.cumsum(births) - births, births)
    return uid


def _check_unique(run: Ints, uid: Ints, name: str) -> None:
    again = repeated(run, uid)
    if again.any():
        raise NichechainError(
            f"row {_row(again)} has {name} {uid[again][0]} again, but births of a run differ in it"
        )


def _row(odd: ArrayLike) -> int:
    """Number of the first odd row, the first being row 1."""
    return int(np.argmax(odd)) + 1
