"""Batches of solutions as pyribs adds them, some of which may have no finite objective or measures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]

# What archives of pyribs tell of solutions that are added.
_TOLD = ("value", "novelty", "local_competition", "density", "discount")


def are_batch(solution: NDArray[Any], objective: NDArray[Any] | None, measures: NDArray[Any]) -> bool:
    """Whether solutions, objectives and measures are as many numbers as they should be."""
    given = (measures,) if objective is None else (measures, objective)
    numbers = all(np.issubdtype(values.dtype, np.number) for values in given)
    shaped = solution.ndim >= 1 and measures.ndim == 2 and (objective is None or objective.ndim == 1)
    return numbers and shaped and len({len(solution), *map(len, given)}) == 1


def finite(objective: NDArray[Any] | None, measures: NDArray[Any]) -> Bools:
    """Which rows have finite numbers, (n,); a search without an objective has measures alone."""
    fine: Bools = np.isfinite(measures).all(axis=1)
    return fine if objective is None else fine & np.isfinite(objective)


def spread(some: dict[str, Any], fine: Bools) -> dict[str, NDArray[Any]]:
    """What an archive told of the fine rows, for all rows: others did not enter, and have NaN."""
    whole: dict[str, NDArray[Any]] = {"status": np.zeros(len(fine), np.int32)}
    for name in some.keys() - {"status"} if some else _TOLD:
        whole[name] = np.full(len(fine), np.nan)
    for name, values in some.items():
        whole[name][fine] = values
    return whole
