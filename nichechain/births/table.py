"""The births table: one row for every evaluated child, the currency of everything after.

Columns
-------
run : int32
    Number of the run within an archive.
uid : int64
    Number of the birth within its run, from 0; where runs were merged they are numbered on.
parent_uid : int64, null for the initial births
depth : int32
    Generations since an initial birth, which has depth 0.
parent_niche, child_niche : int32
    States of the chain; null where there is no parent, or where the child failed.
behavior_0, behavior_1, ... : float64, null where the child failed
objective : float64, null where the child failed, or where the search has none
accepted : bool
    Whether the child became its niche's elite, births being offered one by one. In a direct search for
    evolvability this is who filled an empty niche: who wins a contest does so later.
failed : string
    Why its evaluation failed, null where it did not.
step : int32
    Step of the search, 0 for the initial births.
lineage : bool
    Whether the parent is the latest birth of an unselected lineage, see
    :mod:`nichechain.search.lineages`; false where a parent was selected, or is nobody. Parts of an
    archive that have no such birth lack the column.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.core.columns import Columnar
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Evaluation
from nichechain.niches import Niches
from nichechain.variation.unborn import Unborn, grown

if TYPE_CHECKING:
    import pandas as pd

LINEAGE = "lineage"
"""The column that parts may lack."""

NONE = -1
"""Stands for a null uid or niche in the arrays of this package."""


@dataclass(frozen=True)
class Offspring(Columnar):
    """Genotypes on their way to be evaluated, and where they come from.

    Parameters
    ----------
    genotype : (N, P) float32 array or Unborn
        Unborn children where who evaluates is to grow them.
    uid : (N,) int64 array
    parent_uid, parent_niche : (N,) int64 arrays
        ``NONE`` for initial births.
    depth : (N,) int64 array
    lineage : (N,) bool array
        Whose parent is the latest birth of a lineage.
    """

    genotype: NDArray[np.float32] | Unborn
    uid: NDArray[np.int64]
    parent_uid: NDArray[np.int64]
    parent_niche: NDArray[np.int64]
    depth: NDArray[np.int64]
    lineage: NDArray[np.bool_]

    @classmethod
    def none(cls, length: int) -> Offspring:
        """No offspring, of genotypes of that length."""
        none = np.empty(0, np.int64)
        return cls(np.empty((0, length), np.float32), none, none, none, none, np.empty(0, bool))

    def grown(self) -> NDArray[np.float32]:
        """Their genotypes, all of them there, (N, P)."""
        return grown(self.genotype)


def schema(axes: int) -> pa.Schema:
    """Schema of the births of a domain with that many axes of behavior."""
    return pa.schema(
        [
            ("run", pa.int32()),
            ("uid", pa.int64()),
            ("parent_uid", pa.int64()),
            ("depth", pa.int32()),
            ("parent_niche", pa.int32()),
            ("child_niche", pa.int32()),
            *((f"behavior_{axis}", pa.float64()) for axis in range(axes)),
            ("objective", pa.float64()),
            ("accepted", pa.bool_()),
            ("failed", pa.string()),
            ("step", pa.int32()),
            (LINEAGE, pa.bool_()),
        ]
    )


def check_columns(births: pa.Table | pd.DataFrame, *names: str) -> None:
    """Refuse a table that lacks some of these columns.

    Raises
    ------
    NichechainError
        If it does.
    """
    there = births.column_names if isinstance(births, pa.Table) else getattr(births, "columns", None)
    if there is None:
        raise NichechainError(f"births are of type {type(births).__name__}, but must be a table with columns")
    missing = [name for name in names if name not in there]
    if missing:
        raise NichechainError(f"births have no column {missing[0]}, but need {', '.join(names)}")


def niches_of(evaluation: Evaluation, niches: Niches | None) -> NDArray[np.int64]:
    """State that each evaluated genotype landed in, (N,): ``NONE`` where it failed, or nothing is gridded."""
    state = np.full(len(evaluation), NONE, np.int64)
    if niches is not None:
        fine = ~evaluation.failed
        state[fine] = niches.of(evaluation.behavior[fine])
    return state


def make_table(
    offspring: Offspring,
    evaluation: Evaluation,
    *,
    child_niche: NDArray[np.int64],
    accepted: NDArray[np.bool_],
    step: int,
    run: int | NDArray[np.int64] = 0,
) -> pa.Table:
    """Births of one step as rows.

    Parameters
    ----------
    offspring : Offspring
    evaluation : Evaluation
    child_niche : (N,) int64 array
        ``NONE`` where the evaluation failed.
    accepted : (N,) bool array
    step : int
    run : int or (N,) int64 array
    """
    n = len(offspring)
    axes = evaluation.behavior.shape[1]
    failed = evaluation.failed
    columns = [
        np.broadcast_to(np.asarray(run, np.int32), n),
        offspring.uid,
        pa.array(offspring.parent_uid, mask=offspring.parent_uid == NONE),
        offspring.depth,
        pa.array(offspring.parent_niche, mask=offspring.parent_niche == NONE),
        pa.array(child_niche, mask=child_niche == NONE),
        *(pa.array(evaluation.behavior[:, axis], mask=failed) for axis in range(axes)),
        pa.array(evaluation.objective, mask=failed | np.isnan(evaluation.objective)),
        accepted,
        pa.array(evaluation.reasons, pa.string(), mask=~failed),
        np.full(n, step, np.int32),
        offspring.lineage,
    ]
    target = schema(axes)
    arrays = [pa.array(column).cast(field.type) for column, field in zip(columns, target, strict=True)]
    return pa.Table.from_arrays(arrays, schema=target)
