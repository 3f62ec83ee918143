"""The runs of an archive and their births as arrays."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.archive.read import Meta, calibrations_of
from nichechain.births.table import NONE
from nichechain.domains.base import Evaluation
from nichechain.search.config import BuildConfig
from nichechain.search.lineages import Calibration

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Births:
    """Columns of :mod:`nichechain.births.table`, ``NONE`` and NaN for null.

    Parameters
    ----------
    run, uid, parent_uid, depth, parent_niche, child_niche, step : (N,) int64 arrays
    behavior : (N, B) float64 array
    objective : (N,) float64 array
    accepted, lineage : (N,) bool arrays
        False where null.
    failed : (N,) bool array
    reasons : (N,) array of str
        Empty where it did not fail.
    """

    run: Ints
    uid: Ints
    parent_uid: Ints
    depth: Ints
    parent_niche: Ints
    child_niche: Ints
    step: Ints
    behavior: Floats
    objective: Floats
    accepted: Bools
    lineage: Bools
    failed: Bools
    reasons: NDArray[np.object_]

    @classmethod
    def of(cls, table: pa.Table) -> Births:
        """The columns of a births table."""

        def whole(name: str) -> Ints:
            values: Ints = table[name].cast(pa.int64()).fill_null(NONE).to_numpy()
            return values

        def real(name: str) -> Floats:
            values: Floats = table[name].cast(pa.float64()).fill_null(np.nan).to_numpy()
            return values

        axes = [name for name in table.column_names if name.startswith("behavior_")]
        return cls(
            run=whole("run"),
            uid=whole("uid"),
            parent_uid=whole("parent_uid"),
            depth=whole("depth"),
            parent_niche=whole("parent_niche"),
            child_niche=whole("child_niche"),
            step=whole("step"),
            behavior=np.stack([real(name) for name in axes], axis=1),
            objective=real("objective"),
            accepted=table["accepted"].fill_null(False).to_numpy().astype(bool),
            lineage=table["lineage"].fill_null(False).to_numpy().astype(bool),
            failed=table["failed"].is_valid().to_numpy().astype(bool),
            reasons=np.array(table["failed"].fill_null("").to_pylist(), object),
        )

    def __len__(self) -> int:
        return len(self.uid)

    def __getitem__(self, rows: slice | Ints | Bools) -> Births:
        return Births(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @staticmethod
    def concatenate(parts: Sequence[Births]) -> Births:
        """The rows of several, in order."""
        names = Births.__dataclass_fields__
        return Births(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    @property
    def evaluation(self) -> Evaluation:
        """What became of them."""
        return Evaluation(self.behavior, self.objective, self.failed, tuple(self.reasons.tolist()))


@dataclass(frozen=True)
class Run:
    """One search among those of an archive.

    Parameters
    ----------
    number : int
    config : BuildConfig
    first_uid, births : int
        Its births are those from ``first_uid`` on.
    calibrations : tuple of Calibration
        Those births that were added to its build, by their numbers within the run.
    """

    number: int
    config: BuildConfig
    first_uid: int
    births: int
    calibrations: tuple[Calibration, ...] = ()

    @property
    def rows(self) -> slice:
        """Its births among all."""
        return slice(self.first_uid, self.first_uid + self.births)


def runs_of(meta: Meta) -> Iterator[Run]:
    """The searches that made an archive; none where its births come from another program.

    Raises
    ------
    NichechainError
        If the configuration of a merged run is none.
    """
    if meta.origin is None:
        yield Run(0, meta.config, 0, meta.births, meta.calibrations)
    elif meta.origin["kind"] == "merged":
        for number, run in enumerate(meta.origin["runs"]):
            config = BuildConfig.from_json(run["config"])
            births = int(run["births"])
            yield Run(number, config, int(run["first_uid"]), births, calibrations_of(run, births))


def differs(first: NDArray[np.generic], second: NDArray[np.generic]) -> Bools:
    """Which rows differ in a bit; NaN equals NaN, and 0 does not equal -0."""
    rows = len(first)
    if first.shape != second.shape or first.dtype != second.dtype:
        return np.ones(rows, bool)
    a, b = np.ascontiguousarray(first), np.ascontiguousarray(second)
    odd = a.view(f"u{a.itemsize}") != b.view(f"u{b.itemsize}") if a.dtype.kind == "f" else a != b
    if a.dtype.kind == "f":
        odd &= ~(np.isnan(a) & np.isnan(b))
    found: Bools = odd.reshape(rows, -1).any(axis=1) if rows else np.zeros(0, bool)
    return found


def largest_difference(first: NDArray[np.floating], second: NDArray[np.floating]) -> float | None:
    """The largest absolute difference where both are numbers; None if nowhere."""
    if first.shape != second.shape:
        return None
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(first.astype(np.float64) - second.astype(np.float64))
    known = apart[~np.isnan(apart)]
    return float(known.max()) if known.size else None
