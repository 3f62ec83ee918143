"""Unselected lineages among births: which births belong to one, and which elite they all come from.

A lineage begins with the child of an elite, which is a birth like any, and goes on with births that the
column ``lineage`` flags. Lineages of one elite are a brood. A table of lineages has rows (brood, lineage,
generation, parent state, child state, begun), (L, 6) int64: generation 1 is the elite's child, and begun the
number that the first birth of the brood has in its run.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nichechain.births.joins import across_runs
from nichechain.births.table import NONE

Ints = NDArray[np.int64]

COLUMNS = 6
"""Of a table of lineages."""


def no_lineages() -> Ints:
    """The table of births without lineages."""
    return np.empty((0, COLUMNS), np.int64)


def lineages_of(
    run: Ints, uid: Ints, parent_uid: Ints, parent: Ints, child: Ints, flagged: NDArray[np.bool_]
) -> Ints:
    """The table of lineages of some births, sorted, (L, 6).

    Parameters
    ----------
    run, uid, parent_uid : (N,) int64 arrays
        Births in any order; ``NONE`` for null.
    parent, child : (N,) int64 arrays
        States, ``NONE`` for null.
    flagged : (N,) bool array
        Whether the parent is the latest birth of a lineage.

    Notes
    -----
    A lineage is left out where its first birth, or one between, is not among these births, as in a part
    of an archive. Births that failed are left out.
    """
    birth, elder = across_runs(run, uid, parent_uid)
    order = np.argsort(birth, kind="stable")
    rows = np.flatnonzero(flagged & (elder != NONE))
    if not rows.size:
        return no_lineages()
    place = np.minimum(np.searchsorted(birth, elder, sorter=order), birth.size - 1)
    above = np.where(birth[order[place]] == elder, order[place], NONE)
    generation, ancestor = np.ones(rows.size, np.int64), rows.copy()
    going = np.ones(rows.size, bool)
    while going.any():
        ancestor[going] = above[ancestor[going]]
        known = ancestor != NONE
        generation[going & known] += 1
        going &= known
        going[going] = flagged[ancestor[going]]
    whole = ancestor != NONE
    rows, ancestor, generation = rows[whole], ancestor[whole], generation[whole]
    first = np.unique(ancestor)
    rows = np.concatenate([first, rows])
    ancestor, generation = (
        np.concatenate([first, ancestor]),
        np.concatenate([np.ones_like(first), generation]),
    )
    kept = (parent[rows] != NONE) & (child[rows] != NONE)
    rows, ancestor, generation = rows[kept], ancestor[kept], generation[kept]
    _, brood = np.unique(elder[ancestor], return_inverse=True)
    _, lineage = np.unique(ancestor, return_inverse=True)
    begun = np.full(brood.max(initial=-1) + 1, np.iinfo(np.int64).max)
    np.minimum.at(begun, brood, uid[ancestor])
    columns = brood, lineage, generation, parent[rows], child[rows], begun[brood]
    table = np.stack(columns, axis=1).astype(np.int64)
    return table[np.lexsort(table.T[2::-1])]
