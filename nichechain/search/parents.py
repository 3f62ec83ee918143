"""Parents by curiosity: the score of each elite, and the selection that follows it.

The curiosity score is the propensity of an elite to have children that enter the archive: it begins
at 0, rises by 1 with every child that becomes the elite of its niche, be it of an empty one or in
place of another, and falls by 1/2 with every child that does not (Cully and Demiris 2018, IEEE
Transactions on Evolutionary Computation 22:245-259).

It belongs to the elite, not to its niche: an elite that is replaced takes its score along, and the
next one begins at 0. A child counts for its own parent, even where that has been replaced between
the draw and the evaluation. The elite of the outside state is one of the archive here, a parent as
good as any. A child whose evaluation failed did not enter. Each birth is judged as if offered
alone, after all births before it, as the column ``accepted`` of the births says. So scores are a
fold over births in any order, and a search that goes on from its births has the bits of one that
never stopped.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE, check_columns
from nichechain.core.checks import check_choice
from nichechain.core.errors import NichechainError
from nichechain.search.selection import Told

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ENTERED, REFUSED = 1.0, -0.5
FLOOR = 0.1
"""The score that an elite is drawn by where its own is lower.

It keeps every elite a parent. Scores are sums of 1 and -1/2, so an elite at the floor, as all are at
the start, is drawn a fifth as often as one of the least score above it.
"""


class CuriousParents:
    """Elites in proportion to their score so far, or to ``FLOOR`` where that is larger."""

    def __init__(self) -> None:
        self._scores: dict[int, float] = {}

    def tell(self, births: Told) -> None:
        """What became of some births."""
        for uid, entered in zip(births.parent_uid.tolist(), births.accepted.tolist(), strict=True):
            if uid != NONE:
                self._scores[uid] = self._scores.get(uid, 0.0) + (ENTERED if entered else REFUSED)

    def begin(self, step: int) -> None:
        """Nothing is to be prepared."""

    def scores(self, uid: Ints) -> Floats:
        """Score of each of some elites, (K,)."""
        return np.array([self._scores.get(one, 0.0) for one in uid.tolist()])

    def weights(self, niche: Ints, uid: Ints) -> Floats | None:  # noqa: ARG002
        """Weight of each of some elites, (K,)."""
        return np.maximum(self.scores(uid), FLOOR)


def curiosity(births: pd.DataFrame, by: Literal["elite", "niche"] = "elite") -> pd.DataFrame:
    """Curiosity scores of all that were parents.

    Parameters
    ----------
    births : DataFrame
        Such as of :meth:`nichechain.Archive.births`.
    by : {"elite", "niche"}
        One row for every elite that had children, or for every niche, all elites that it ever had
        together: its score is then not reset where an elite is replaced.

    Returns
    -------
    DataFrame
        Columns ``run`` and ``uid`` (by elite), ``niche`` (the state that the children were born
        from), ``children``, ``entered``, ``score`` = entered - (children - entered)/2, and ``rate``
        = entered/children. A score grows with the number of children; the rate does not.

    Raises
    ------
    NichechainError
        If the births do not say who was accepted, or by elite who the parents were.
    """
    keys = {"elite": ["run", "parent_uid", "parent_niche"], "niche": ["parent_niche"]}
    check_choice("by", by, keys)
    check_columns(births, *keys[by], "accepted", "parent_uid")
    children = births[births["parent_niche"].notna()]
    for name, meaning in (("accepted", "which children entered the archive"), ("parent_uid", "who had them")):
        if children[name].isna().any() and (name == "accepted" or by == "elite"):
            raise NichechainError(f"the births do not say {meaning}: column {name} has nulls")
    grouped = children.groupby(keys[by], sort=True)["accepted"].agg(children="size", entered="sum")
    found = grouped.reset_index().rename(columns={"parent_uid": "uid", "parent_niche": "niche"})
    # Plain numbers: births have nullable ones, and here nothing is null.
    found = found.astype(np.int64)
    refused = found["children"] - found["entered"]
    return found.assign(
        score=ENTERED * found["entered"] + REFUSED * refused, rate=found["entered"] / found["children"]
    )
