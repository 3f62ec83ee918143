"""What is measured of a search: niches filled, quality, and whether curious elites are the evolvable ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.archive.archive import Archive
from nichechain.births.table import NONE, niches_of
from nichechain.core.randomness import Purpose, keyed
from nichechain.core.ranks import rank_correlation
from nichechain.evolvability.coverage import rarefied_coverage
from nichechain.execution import Executor
from nichechain.niches import Niches
from nichechain.search.parents import CuriousParents
from nichechain.search.selection import Told
from nichechain.steering.online import OnlineChain
from nichechain.steering.reach import many_lineages
from nichechain.variation.unborn import litters

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_SHARES = (0.25, 0.5, 0.75, 1.0)
"""Of the births of a search: when curiosity and l-evolvability are compared."""
_CHILDREN = 3
"""Children that an elite must have had to have a curiosity score worth comparing."""
_FEWEST = 10
_TARGETS = 200
"""Niches, evenly spread over all, that l-evolvability counts here: it is only ranked."""
_L, _LINEAGES = 5, 100


def measure(
    archive: Archive,
    executor: Executor,
    *,
    elites: int,
    offspring: int,
    on_done: Callable[[int], None] | None = None,
) -> pa.Table:
    """What a finished search did, one row for each step.

    Parameters
    ----------
    archive : Archive
    executor : Executor
    elites, offspring : int
        How many elites of the end are checked, on how many offspring each.
    on_done : callable, optional
        Told how many more of these have been evaluated.

    Returns
    -------
    pyarrow.Table
        ``births`` so far; niches ``filled``; ``best``, the sum over filled niches of the best objective of
        their births, and ``least``, the least of these, null where the domain has none; at some steps
        ``curiosity``, the rank correlation of curiosity score and 5-evolvability over elites that had
        children; at the last step ``offspring_niches``, the mean number of niches that the offspring of an
        elite land in.
    """
    births = archive.table()
    told = Told.of(births)
    objective = births["objective"].fill_null(np.nan).to_numpy()
    ends = np.append(np.flatnonzero(np.diff(told.step)), len(told) - 1)
    filled, best, least = _courses(told.child_niche, objective, len(archive.niches), ends)
    curious = np.full(ends.size, np.nan)
    for share in _SHARES:
        row = int(np.searchsorted(ends, share * len(told) - 1))
        curious[row] = curiosity_agrees(told[: ends[row] + 1], archive.niches)
    checked = np.full(ends.size, np.nan)
    if elites:
        checked[-1] = _offspring_niches(archive, executor, elites, offspring, on_done)
    return pa.table(
        {
            "births": ends + 1,
            "filled": filled,
            **{
                name: pa.array(values, mask=np.isnan(values))
                for name, values in (
                    ("best", best),
                    ("least", least),
                    ("curiosity", curious),
                    ("offspring_niches", checked),
                )
            },
        }
    )


def _courses(child: Ints, objective: Floats, niches: int, ends: Ints) -> tuple[Ints, Floats, Floats]:
    """Niches filled, and sum and least of their best objectives, at the ends of steps (K,)."""
    best: dict[int, float] = {}
    found = []
    start = 0
    for end in ends.tolist():
        landed = zip(child[start : end + 1].tolist(), objective[start : end + 1].tolist(), strict=True)
        for niche, value in landed:
            if niche != NONE and niche < niches:
                best[niche] = max(best.get(niche, value), value)
        start = end + 1
        values = np.array(list(best.values()), np.float64)
        found.append((len(best), values.sum(), values.min() if values.size else np.nan))
    filled, total, least = np.array(found).T
    return filled.astype(np.int64), total, least


def curiosity_agrees(births: Told, niches: Niches) -> float:
    """Rank correlation of curiosity score and 5-evolvability of the elites after some births of a search.

    Parameters
    ----------
    births : Told
        Of one search, from its first, each with its row for a number.
    niches : Niches

    Returns
    -------
    float
        NaN where fewer than ten elites have had three children, or all are alike.
    """
    parents, chain = CuriousParents(), OnlineChain(niches)
    parents.tell(births)
    chain.tell(births)
    if not chain.births:
        return float("nan")
    chain.settle()
    inside = births.accepted & (births.child_niche < len(niches))
    # The last that was accepted is the elite.
    elite = dict(zip(births.child_niche[inside].tolist(), np.flatnonzero(inside).tolist(), strict=True))
    children = np.bincount(births.parent_uid[births.parent_uid != NONE], minlength=len(births))
    state = np.array([niche for niche, uid in elite.items() if children[uid] >= _CHILDREN], np.int64)
    if state.size < _FEWEST:
        return float("nan")
    scores = parents.scores(np.array([elite[niche] for niche in state.tolist()]))
    targets = np.unique(np.linspace(0, len(niches) - 1, min(_TARGETS, len(niches))).astype(np.int64))
    evolvability = many_lineages(chain, targets, _L, _LINEAGES)[state]
    if np.ptp(scores) == 0.0 or np.ptp(evolvability) == 0.0:
        return float("nan")
    return rank_correlation(scores, evolvability)[0]


def _offspring_niches(
    archive: Archive,
    executor: Executor,
    elites: int,
    offspring: int,
    on_done: Callable[[int], None] | None,
) -> float:
    """Niches that fresh offspring of an elite land in, the mean over some elites: their 1-evolvability."""
    niches, seed = archive.niches, archive.config.seed
    occupied = np.flatnonzero(archive.elites.niche < len(niches))
    rng = keyed(seed, Purpose.CHECKED)
    chosen = rng.choice(occupied, size=min(elites, occupied.size), replace=False)
    if not chosen.size:
        return float("nan")
    unborn = litters(archive.mutate, Purpose.OFFSPRING, archive.elites.genotype[chosen], seed, offspring)
    evaluation = executor.evaluate(archive.domain, unborn, on_done)
    landed = niches_of(evaluation, niches)
    found = []
    for row in landed.reshape(chosen.size, offspring):
        counts = np.bincount(row[row != NONE], minlength=niches.states)
        number = int(counts.sum())
        found.append(rarefied_coverage(counts, number, counted=len(niches)) if number else 0.0)
    return float(np.mean(found))
