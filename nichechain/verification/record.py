"""What a record must obey whatever it is a record of: no simulation, no random number."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE, Offspring
from nichechain.niches import Niches
from nichechain.search.elites import Elites
from nichechain.search.lineages import Lineages
from nichechain.verification.result import Check
from nichechain.verification.runs import Births, Ints, Run, differs

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
    expected[finite] = niches.of(births.behavior[finite])
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
    pairs = np.stack([births.run, births.uid])
    _, first = np.unique(pairs, axis=1, return_index=True)
    again = np.ones(len(births), bool)
    again[first] = False
    return [Check.of("uids are unique", _GROUP, again, births.uid)]


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


def check_lineages(lineages: Lineages, births: Births) -> list[Check]:
    """Checks of lineages under way against the births that they stand at.

    Parameters
    ----------
    lineages : Lineages
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
