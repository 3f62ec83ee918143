"""Who becomes an elite among births that came in a batch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def one_by_one(
    cell: NDArray[np.int64],
    objective: NDArray[np.floating],
    entered: NDArray[np.bool_],
    *,
    ties: bool = False,
) -> NDArray[np.bool_]:
    """Who would have become an elite, births of a batch being offered one by one.

    Programs say who is better than the elites before the batch, of which all but one are not kept.

    Parameters
    ----------
    cell : (n,) int64 array
    objective : (n,) array
    entered : (n,) bool array
        Who is better than the elite of its cell before the batch.
    ties : bool
        Whether of equals in a batch the last stays, not the first.
    """
    best: dict[int, float] = {}
    accepted = entered.copy()
    for row in np.flatnonzero(entered).tolist():
        niche, value = int(cell[row]), float(objective[row])
        least = best.get(niche, -np.inf)
        accepted[row] = value > least or (ties and value == least)
        if accepted[row]:
            best[niche] = value
    return accepted
