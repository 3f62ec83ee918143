"""The record: its runs, its births as arrays, and what they must obey whatever they are a record of.

Nothing here takes a simulation or a random number.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.archive.read import Meta, calibrations_of
from nichechain.births.joins import repeated
from nichechain.births.table import NONE, Offspring
from nichechain.core.columns import Columnar
from nichechain.domains.base import Evaluation
from nichechain.niches import Niches
from nichechain.search.config import BuildConfig
from nichechain.search.elites import Elites
from nichechain.search.lineages import Calibration, UnderWay
from nichechain.verification.result import Check

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Births(Columnar):
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


_GROUP = "record"

# Names of checks that others build on.
COMPLETE = "births have a niche, or failed and have none"
_INITIAL = "initial births, and no others, have no parent"
_EARLIER = "parents are earlier births of the same run"
_BORN = "elites are births that did not fail"
_FOLLOW = "pending children follow the births"
_PARENTS = "pending children have parents, niche and depth"
_UNDER_WAY = "lineages under way are births that did not fail"
ROOTED = (_INITIAL, _EARLIER, _BORN, _FOLLOW, _PARENTS, _UNDER_WAY)
"""Without these a genotype cannot be traced to its root."""


def check_values(births: Births, niches: Niches) -> list[Check]:
    """Checks that hold for births of any origin: of what they are, and in which niche.

    Parameters
    ----------
    births : Births
    niches : Niches
    """
    finite = np.isfinite(births.behavior).all(axis=1)
    nothing = np.isnan(births.behavior).all(axis=1)
    complete = np.where(births.failed, births.child_niche == NONE, births.child_niche != NONE)
    # Logs of other programs may tell niches without behavior.
    complete &= np.where(births.failed, nothing, finite | nothing)
    inside = (births.child_niche >= NONE) & (births.child_niche < niches.states)
    inside &= (births.parent_niche >= NONE) & (births.parent_niche < niches.states)
    expected = births.child_niche.copy()
    behavior = births.behavior[finite]
    expected[finite] = niches.of(behavior)
    # Bounds are compared in the precision that behaviors came in, which a record keeps no word of.
    short = behavior.astype(np.float32)
    narrow = np.flatnonzero(finite)[(short == behavior).all(axis=1)]
    rounded = niches.of(short[(short == behavior).all(axis=1)])
    alike = rounded == births.child_niche[narrow]
    expected[narrow[alike]] = rounded[alike]
    return [
        Check.of(COMPLETE, _GROUP, ~complete, births.uid),
        Check.of("niches are states of the chain", _GROUP, ~inside, births.uid),
        Check.of(
            "a birth's niche is that of its behavior",
            _GROUP,
            (births.child_niche != expected)[finite],
            births.uid[finite],
        ),
    ]


def check_unique(births: Births) -> list[Check]:
    """Whether no uid occurs twice in a run."""
    return [Check.of("uids are unique", _GROUP, repeated(births.run, births.uid), births.uid)]


def check_runs(runs: list[Run], births: int) -> Check:
    """Whether the runs share the births among them, one after the other."""
    ends = [run.first_uid + run.births for run in runs]
    odd = [run.first_uid != end for run, end in zip(runs, [0, *ends], strict=False)]
    odd[-1] |= ends[-1] != births
    return Check.of("runs follow one another", _GROUP, odd, [run.first_uid for run in runs])


def check_ancestry(births: Births, runs: list[Run]) -> list[Check]:
    """Checks of who descends from whom, for births of searches.

    Parameters
    ----------
    births : Births
    runs : list of Run
    """
    uid = np.arange(len(births))
    run = np.full(len(births), NONE)
    first = np.zeros(len(births), np.int64)
    initial = np.zeros(len(births), bool)
    for one in runs:
        run[one.rows] = one.number
        first[one.rows] = one.first_uid
        initial[one.rows] = uid[one.rows] < one.first_uid + one.config.initial
    orphan = births.parent_uid == NONE
    earlier = orphan | ((births.parent_uid >= first) & (births.parent_uid < uid))
    known = earlier & ~orphan
    parent = births.parent_uid[known]
    # A birth that failed is in no niche, and can be nobody's parent.
    lost = births.failed[parent] | (births.parent_niche[known] != births.child_niche[parent])
    rootless = (births.parent_niche != NONE)[orphan] | (births.depth != 0)[orphan]
    return [
        Check.of("uids number the births from 0", _GROUP, births.uid != uid, uid),
        Check.of("births belong to the run that their uid says", _GROUP, births.run != run, uid),
        Check.of(_INITIAL, _GROUP, orphan != initial, uid),
        Check.of("initial births have depth 0 and no parent's niche", _GROUP, rootless, uid[orphan]),
        Check.of(_EARLIER, _GROUP, ~earlier, uid),
        Check.of("a parent's niche is the one that it was born in", _GROUP, lost, uid[known]),
        Check.of(
            "a birth is one generation deeper than its parent",
            _GROUP,
            births.depth[known] != births.depth[parent] + 1,
            uid[known],
        ),
    ]


def check_elites(elites: Elites, births: Births, niches: Niches) -> list[Check]:
    """Checks of elites against the births that they were, for births of searches.

    Parameters
    ----------
    elites : Elites
    births : Births
    niches : Niches
    """
    rows = np.clip(elites.uid, 0, max(0, len(births) - 1))
    was = births[rows] if len(births) else births
    there = (elites.uid == rows) & ~was.failed if len(births) else np.zeros(len(elites), bool)
    odd = {
        "an elite's niche is the one that it was born in": elites.niche != was.child_niche,
        "an elite's behavior is that of its birth": differs(elites.behavior, was.behavior),
        "an elite's objective is that of its birth": differs(elites.objective, was.objective),
        "an elite's depth is that of its birth": elites.depth != was.depth,
    }
    visited = np.unique(births.child_niche[births.child_niche != NONE])
    held, times = np.unique(elites.niche, return_counts=True)
    missing = np.setdiff1d(visited, held)
    # Of a niche without an elite, the first birth there is named.
    forgotten = np.isin(births.child_niche, missing)
    order = np.zeros(len(elites), bool)
    order[1:] = np.diff(elites.niche) <= 0
    outside = (elites.niche < 0) | (elites.niche >= niches.states)
    return [
        Check.of(_BORN, _GROUP, ~there, elites.uid),
        *(Check.of(name, _GROUP, wrong & there, elites.uid) for name, wrong in odd.items()),
        Check.of("elites are sorted by niche, one to each", _GROUP, order | outside, elites.uid),
        Check(
            "every niche that was reached has an elite",
            _GROUP,
            len(visited),
            len(missing),
            tuple(births.uid[forgotten][:1].tolist()),
        )
        if times.size or visited.size
        else Check("every niche that was reached has an elite", _GROUP, 0, 0),
    ]


def check_pending(pending: Offspring, births: Births, first: int) -> list[Check]:
    """Checks of children that wait to be evaluated.

    Parameters
    ----------
    pending : Offspring
    births : Births
    first : int
        Uid of the first that waits.
    """
    uid = np.arange(first, first + len(pending))
    parent: NDArray[np.int64] = pending.parent_uid
    orphan = parent == NONE
    # Those that wait have parents of before their step, so none of them waits itself.
    earlier = orphan | ((parent >= 0) & (parent < len(births)))
    known = earlier & ~orphan
    lost = np.zeros(len(pending), bool)
    at: Ints = parent[known]
    lost[known] = (pending.parent_niche[known] != births.child_niche[at]) | (
        pending.depth[known] != births.depth[at] + 1
    )
    return [
        Check.of(_FOLLOW, _GROUP, pending.uid != uid, uid),
        Check.of(_PARENTS, _GROUP, ~earlier | lost, uid),
    ]


def check_lineages(lineages: UnderWay, births: Births) -> list[Check]:
    """Checks of lineages under way against the births that they stand at.

    Parameters
    ----------
    lineages : UnderWay
    births : Births
    """
    at = np.clip(lineages.uid, 0, max(0, len(births) - 1))
    there = (lineages.uid == at) & ~births.failed[at]
    odd = (lineages.niche != births.child_niche[at]) | (lineages.depth != births.depth[at])
    return [
        Check.of(_UNDER_WAY, _GROUP, ~there, lineages.uid),
        Check.of(
            "lineages under way have the niche and depth of their births", _GROUP, odd & there, lineages.uid
        ),
    ]
