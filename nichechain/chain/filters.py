"""Counts of some of the births only: of one run, a window of steps, those accepted, those of lineages."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from nichechain.births.table import LINEAGE, check_columns
from nichechain.chain.counts import TransitionCounts
from nichechain.core.checks import as_tuple, check_whole, shown
from nichechain.core.errors import NichechainError
from nichechain.niches import Niches

COUNTED = ("run", "uid", "parent_uid", "parent_niche", "child_niche", "step", "accepted", LINEAGE)
"""Columns of births that counts are made of."""


def counts_of(
    births: pa.Table,
    niches: Niches,
    *,
    run: int | None = None,
    steps: tuple[int, int] | None = None,
    accepted: bool = False,
    lineages: bool | None = None,
) -> TransitionCounts:
    """Counts of births.

    Parameters
    ----------
    births : pyarrow.Table
        Columns of :mod:`nichechain.births.table`; elites of different runs are kept apart.
    niches : Niches
        The niches that the states of the births belong to.
    run : int, optional
        Only births of this run.
    steps : (int, int), optional
        Only births from the first of these steps up to, and without, the second.
    accepted : bool
        Only births that became the elite of their niche. Their T is that of the children that a
        search kept, not of all that parents have.
    lineages : bool, optional
        Only births whose parent is the latest of an unselected lineage, counted as others are, or
        only all others.

    Returns
    -------
    TransitionCounts
        Niches that only other births fell in count as never filled.

    Raises
    ------
    NichechainError
        If there is no such run, the window is empty, or births do not say what is asked about.
    """
    check_columns(births, "run", "parent_uid", "parent_niche", "child_niche", "step", "accepted")
    if run is not None:
        births = births.filter(pc.equal(births["run"], _run(births, run)))
    if steps is not None:
        births = within_steps(births, steps)
    if accepted:
        births = births.filter(_said(births, "accepted", "whether they were accepted"))
    if lineages is not None:
        check_columns(births, LINEAGE)
        flag = births[LINEAGE].fill_null(False)
        # What is asked for by name is counted like any other births.
        births = births.filter(flag if lineages else pc.invert(flag)).drop_columns([LINEAGE])
    return TransitionCounts.from_births(births, niches)


def within_steps(births: pa.Table, steps: tuple[int, int]) -> pa.Table:
    """Births from the first of these steps up to, and without, the second.

    Raises
    ------
    NichechainError
        If the window is empty, or births do not say their step.
    """
    numbers = as_tuple("steps", steps)
    if len(numbers) != 2 or not all(isinstance(step, (int, np.integer)) for step in numbers):
        raise NichechainError(f"steps are {shown(steps)}, but must be a window such as (0, 100)")
    first, end = numbers
    if not 0 <= first < end:
        raise NichechainError(f"steps are {first} to {end}, but must be a window such as (0, 100)")
    step = _said(births, "step", "their step")
    return births.filter(pc.and_(pc.greater_equal(step, first), pc.less(step, end)))


def _run(births: pa.Table, run: int) -> int:
    check_whole(run=run)
    known = pc.unique(births["run"]).to_pylist()
    if run not in known:
        raise NichechainError(
            f"run is {run}, but there are runs {min(known, default=0)} to {max(known, default=0)}"
        )
    return run


def _said(births: pa.Table, column: str, what: str) -> pa.ChunkedArray:
    """A column that must not have nulls."""
    values = births[column]
    if values.null_count:
        raise NichechainError(f"{values.null_count} births do not say {what}, so none can be chosen by it")
    return values
