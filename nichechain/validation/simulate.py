"""Births and lineages of a chain that is known: what a test must not mistake for a violation."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.births.table import NONE
from nichechain.chain.model import Matrix, NicheChain
from nichechain.core.checks import as_whole, check_at_least, check_choice, check_numbers, check_whole
from nichechain.core.errors import NichechainError
from nichechain.core.row_sampler import RowSampler
from nichechain.evolvability.coverage import entries
from nichechain.search.config import Replacement

if TYPE_CHECKING:
    import pandas as pd

Ints = NDArray[np.int64]

_MOST_BIRTHS = 10**8


def simulate_births(
    chain: NicheChain,
    births: int,
    rng: np.random.Generator,
    *,
    start: ArrayLike = 0,
    batch: int = 64,
    memory: float = 0.0,
    replacement: Replacement = "random",
) -> pd.DataFrame:
    """Births of a MAP-Elites run in which a child's niche depends on its parent's alone.

    Parents are drawn uniformly from the occupied states. Who is the elite of a state follows a rule of
    :class:`nichechain.search.BuildConfig`.

    Parameters
    ----------
    chain : NicheChain
        The law of birth.
    births : int
        Births in total, the initial ones among them.
    rng : numpy.random.Generator
    start : int or (k,) ints
        States of the initial births.
    batch : int
        Children of a step, at least 1.
    memory : float
        Probability that a child falls back to the state of its grandparent, if it has one: above
        0 the births are no chain's.
    replacement : {"random", "first", "newest", "objective"}
        Which birth of a state is its elite: each alike, the first, the last, or the best. An objective is
        that of the parent and a standard normal number.

    Returns
    -------
    DataFrame
        The columns of :mod:`nichechain.births.table` that lineages are joined by.

    Raises
    ------
    NichechainError
        If a number is out of range.
    """
    check_whole(births=births, batch=batch)
    check_numbers(memory=memory)
    first = np.atleast_1d(as_whole("start", start))
    if first.ndim != 1:
        raise NichechainError(f"start has shape {first.shape}, but must be one state or several")
    if not 0 <= first.min(initial=0) <= first.max(initial=0) < chain.states or not first.size:
        raise NichechainError(f"start is {first.tolist()}, but must be states from 0 to {chain.states - 1}")
    if births < first.size or batch < 1:
        raise NichechainError(
            f"births are {births} in batches of {batch}, but must be at least {first.size} and 1"
        )
    if births > _MOST_BIRTHS:
        raise NichechainError(f"births are {births}, but must be at most {_MOST_BIRTHS}, which take 6 GB")
    if not 0.0 <= memory <= 1.0:
        raise NichechainError(f"memory is {memory}, but must be a probability")
    check_choice("replacement", replacement, get_args(Replacement))
    sampler = RowSampler(entries(chain.T))
    columns = {
        name: np.full(births, NONE, np.int64) for name in ("parent_uid", "parent_niche", "child_niche")
    }
    parent, parent_niche, niche = columns.values()
    depth, step = np.zeros(births, np.int64), np.zeros(births, np.int64)
    elite = np.full(chain.states, NONE, np.int64)
    largest = np.full(chain.states, -np.inf)
    keys = np.zeros(births)
    done, number = 0, 0
    while done < births:
        here = slice(done, min(births, done + (batch if number else first.size)))
        size = here.stop - here.start
        if number:
            occupied = np.flatnonzero(elite != NONE)
            parent_niche[here] = occupied[rng.integers(occupied.size, size=size)]
            parent[here] = elite[parent_niche[here]]
            depth[here] = depth[parent[here]] + 1
            niche[here] = sampler.draw(parent_niche[here], rng)
            before = parent_niche[parent[here]]
            back = (rng.random(size) < memory) & (before != NONE)
            niche[here] = np.where(back, before, niche[here])
        else:
            niche[here] = first
        step[here] = number
        key: NDArray[np.float64]
        match replacement:
            case "random":
                key = rng.random(size)
            case "objective":
                key = rng.standard_normal(size)
                key += np.where(parent[here] == NONE, 0.0, keys[parent[here]])
            case _:
                key = np.arange(here.start, here.stop, dtype=np.float64)
                key = -key if replacement == "first" else key
        keys[here] = key
        # The last of several writes to one place stays, and that is the largest key.
        order = np.argsort(key)
        best = np.full(chain.states, NONE, np.int64)
        best[niche[here][order]] = order
        landed = np.flatnonzero(best != NONE)
        won = landed[key[best[landed]] > largest[landed]]
        elite[won] = done + best[won]
        largest[won] = key[best[won]]
        done, number = here.stop, number + 1
    return _frame(depth=depth, step=step, **columns)


def simulate_lineages(matrix: Matrix, first: ArrayLike, generations: int, rng: np.random.Generator) -> Ints:
    """Lineages without selection: each birth is the one parent of the next.

    Parameters
    ----------
    matrix : (S, S) row-stochastic array or sparse matrix
    first : (...) ints
        States of generation 1.
    generations : int
        l, at least 1.
    rng : numpy.random.Generator

    Returns
    -------
    (..., generations) int64 array
        States of generations 1 to l.

    Raises
    ------
    NichechainError
        If ``generations`` is below 1.
    """
    check_at_least(1, generations=generations)
    here = as_whole("first", first)
    if here.size and not 0 <= here.min() <= here.max() < matrix.shape[0]:
        raise NichechainError(f"first is {here.tolist()}, but must be states from 0 to {matrix.shape[0] - 1}")
    walks = RowSampler(entries(matrix)).walk(here.ravel(), generations, rng)
    return np.stack([states.reshape(here.shape) for states in walks], axis=-1)


def _frame(**columns: Ints) -> pd.DataFrame:
    import pandas as pd

    births = len(columns["depth"])
    frame = pd.DataFrame({"run": np.zeros(births, np.int64), "uid": np.arange(births), **columns})
    nullable = ["parent_uid", "parent_niche", "child_niche"]
    frame[nullable] = frame[nullable].astype("Int64").mask(frame[nullable] == NONE)
    return frame
