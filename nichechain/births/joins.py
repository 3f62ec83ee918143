"""Births joined with themselves: who a birth is among all runs, and in which row a parent stands.

A birth's uid is its number within its run, so that two runs have the same ones.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError

Ints = NDArray[np.int64]


def across_runs(run: Ints, *uids: Ints) -> tuple[Ints, ...]:
    """Uids as numbers that no two births of different runs share.

    Parameters
    ----------
    run : (N,) int64 array
    *uids : (N,) int64 arrays
        Of births or of their parents, in the runs given; ``NONE`` for none.

    Returns
    -------
    tuple of (N,) int64 arrays
        The uids themselves where there is one run; those of later runs are counted on from those of
        earlier ones. ``NONE`` stays ``NONE``.
    """
    runs, which = np.unique(run, return_inverse=True)
    size = np.zeros(runs.size, np.int64)
    for uid in uids:
        np.maximum.at(size, which, uid + 1)
    offset = (np.cumsum(size) - size)[which]
    return tuple(np.where(uid == NONE, NONE, uid + offset) for uid in uids)


def parent_rows(run: Ints, uid: Ints, parent_uid: Ints) -> Ints:
    """In which row the parent of each birth stands, (N,); ``NONE`` for one without a parent.

    Parameters
    ----------
    run, uid, parent_uid : (N,) int64 arrays
        Births in any order; ``NONE`` for null.

    Raises
    ------
    NichechainError
        If a parent is not among the births.
    """
    birth, parent = across_runs(run, uid, parent_uid)
    row = np.full(birth.size, NONE, np.int64)
    born = parent != NONE
    order = np.argsort(birth)
    place = np.minimum(np.searchsorted(birth, parent[born], sorter=order), max(0, birth.size - 1))
    row[born] = order[place]
    lost = np.flatnonzero(birth[row[born]] != parent[born])
    if lost.size:
        orphan = np.flatnonzero(born)[lost[0]]
        raise NichechainError(
            f"birth {uid[orphan]} of run {run[orphan]} has parent {parent_uid[orphan]}, "
            "but there is no such birth"
        )
    return row


def repeated(run: Ints, uid: Ints) -> NDArray[np.bool_]:
    """Which births bear the uid of an earlier one of their run, (N,)."""
    _, first = np.unique(np.stack([run, uid]), axis=1, return_index=True)
    again = np.ones(run.size, bool)
    again[first] = False
    return again
