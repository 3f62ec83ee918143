"""What the page knows of the search: how far it had come when, and who the elites' ancestors are."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nichechain.archive.archive import Archive
from nichechain.births.joins import parent_rows
from nichechain.births.table import NONE
from nichechain.evolvability.question import MOST_EXACT
from nichechain.plots.explorer.packing import packed

if TYPE_CHECKING:
    import pandas as pd

Ints = NDArray[np.int64]

_STAGES = 20
_STAGES_OF_MANY = 10
# Ancestors that a page has room for.
_MOST_ANCESTORS = 100_000
_NOWHERE = 65_535


def past(archive: Archive) -> dict[str, Any]:
    """Births in and out of every niche at some stages, and ancestors of the elites."""
    seen, whole = (archive.table(whole=whole).to_pandas(use_threads=False) for whole in (False, True))
    # Of a window of steps only its births are counted, but elites may be older, and their ancestors are.
    return {**_stages(archive, seen), **_ancestors(archive, whole)}


def _stages(archive: Archive, births: pd.DataFrame) -> dict[str, Any]:
    """Births so far, (stages, n), of children in a niche and of parents in it."""
    n, states = len(archive.niches), archive.niches.states
    order = np.argsort(_whole(births["step"]), kind="stable")
    child, parent = _whole(births["child_niche"])[order], _whole(births["parent_niche"])[order]
    stages = _STAGES if n <= MOST_EXACT else _STAGES_OF_MANY
    upto = np.unique(np.rint(np.linspace(0, child.size, stages + 1)[1:]).astype(np.int64))
    first = np.full(states, 0, np.int64)
    places = np.flatnonzero((child >= 0) & (child < states))
    seen, at = np.unique(child[places], return_index=True)
    first[seen] = places[at] + 1
    return {
        "stages": upto.tolist(),
        "visitsAt": packed(_upto(child, upto, n), np.uint32),
        "childrenAt": packed(_upto(parent, upto, n), np.uint32),
        "firstBirth": packed(first[:n], np.uint32),
    }


def _upto(state: Ints, upto: Ints, n: int) -> Ints:
    """How often each niche is among the first so many states, (stages, n)."""
    stage = np.searchsorted(upto, np.arange(state.size), side="right")
    inside = (state >= 0) & (state < n)
    number = np.bincount(stage[inside] * n + state[inside], minlength=upto.size * n)
    return number.reshape(upto.size, n).cumsum(axis=0)


def _ancestors(archive: Archive, births: pd.DataFrame) -> dict[str, Any]:
    """Births that elites descend from: the niche of each, and which of them its parent is.

    Of more than a page has room for, the latest are kept, so that lineages begin later than they did.
    """
    uid = _whole(births["uid"])
    elites = archive.elites
    inside = elites.niche < len(archive.niches)
    # Imported births may lack parents that are named, but then there are no elites.
    if inside.any():
        parent = parent_rows(_whole(births["run"]), uid, _whole(births["parent_uid"]))
    else:
        parent = np.full(uid.size, NONE)
    order = np.argsort(uid, kind="stable")
    found = order[np.searchsorted(uid, elites.uid[inside], sorter=order)] if inside.any() else parent[:0]
    kept = np.zeros(uid.size, bool)
    here = np.unique(found)
    while here.size and np.count_nonzero(kept) < _MOST_ANCESTORS:
        kept[here] = True
        here = np.unique(parent[here])
        here = here[here >= 0]
        here = here[~kept[here]]
    number = np.full(uid.size + 1, -1, np.int64)
    number[np.flatnonzero(kept)] = np.arange(np.count_nonzero(kept))
    # A parent that is not there has row -1, which is numbered -1 as well: the last place.
    ancestor = parent[kept]
    niche = _whole(births["child_niche"])[kept]
    holder = np.full(len(archive.niches), -1, np.int64)
    holder[elites.niche[inside]] = number[found]
    return {
        "ancestorParent": packed(number[ancestor], np.int32),
        "ancestorNiche": packed(np.where(niche < 0, _NOWHERE, niche), np.uint16),
        "eliteBirth": packed(holder, np.int32),
    }


def _whole(column: Any) -> Ints:
    values: Ints = column.fillna(NONE).to_numpy(np.int64)
    return values
