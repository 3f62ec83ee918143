"""How many niches? The births of an archive, binned again into grids of other sizes.

Too few niches, and most children stay where their parent was: T is nearly diagonal. Too many, and
most niches are never visited, so that the rows of T rest on few births or none (the paper's remark
on the grid size in its section "Towards better evolvability definitions").
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.births.families import elites_of, folds_of
from nichechain.births.joins import parent_rows
from nichechain.births.table import NONE
from nichechain.chain import NicheChain, TransitionCounts, estimate
from nichechain.chain.families import counts_of_families, families_of
from nichechain.core.checks import as_floats, check_at_least, check_whole
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.niches import answer
from nichechain.evolvability.question import Question, Root
from nichechain.execution.side_by_side import side_by_side
from nichechain.niches import GridNiches
from nichechain.validation.held_out import probability_of

if TYPE_CHECKING:
    import pandas as pd

    from nichechain.archive.archive import Archive

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MIN_BIRTHS = 20
"""Births that a row needs to be known."""
KNOWN = 0.9
"""Share of a lineage's time that must be spent in known rows."""
OBSERVED = 0.5
"""Share of niches that must have been the niche of a parent."""
STAYING = 0.5
"""Share of children that may stay in their parent's niche."""

# Niches of the coarsest and of the finest grid that are tried by default, and how many sizes.
_FEWEST, _MOST, _TRIED = 4, 3_200, 10
# Steps along a lineage until its share of time in each state is settled.
_MOST_STEPS = 1_000
_SETTLED = 1e-9


@dataclass(frozen=True)
class GridSize:
    """What births tell of the chain over one grid.

    Parameters
    ----------
    shape : tuple of int
        Cells along each axis.
    niches : int
    visited : float
        Share of niches in which somebody was born.
    rows_observed : float
        Share of niches that were the niche of a parent.
    births_per_row : float
        Median number of births behind an observed row.
    known : float
        Share of a lineage's time, in the end, in niches with enough births behind their row: mass
        of the stationary distribution of T, the outside state left out.
    staying : float
        Share of children of parents in a niche that are born in that niche.
    self_transition : float
        Mean over observed rows of the share of children that stay, every row alike.
    entropy : float
        Bits of surprise in the state of a child whose parent's niche is known, as the births are
        spread over rows.
    information : float
        Bits that the parent's niche tells of the state of a child, beyond how many of all
        children are born there, judged on children of elites that were held out; NaN where there
        are too few elites.
    evolvability : float
        l-evolvability of the niche that holds the behavior that was asked about.
    low, high : float
        Its 90 % interval over posterior draws of T.
    """

    shape: tuple[int, ...]
    niches: int
    visited: float
    rows_observed: float
    births_per_row: float
    known: float
    staying: float
    self_transition: float
    entropy: float
    information: float
    evolvability: float
    low: float
    high: float


@dataclass(frozen=True)
class Sweep:
    """Grids of several sizes over the same births.

    Parameters
    ----------
    grids : tuple of GridSize
        From the coarsest to the finest.
    behavior : tuple of float
        The behavior whose l-evolvability is followed.
    births : int
        Births that were binned.
    built : tuple of int, optional
        Shape of the grid that the search itself used, where it used a grid.
    l, lineages : int
        Of the l-evolvability.
    min_births : int
        Births that make a row known.
    """

    grids: tuple[GridSize, ...]
    behavior: tuple[float, ...]
    births: int
    built: tuple[int, ...] | None
    l: int
    lineages: int
    min_births: int

    @property
    def suggestion(self) -> GridSize | None:
        """The finest grid that these births fill, if children leave their niche there.

        Births fill a grid if half of its rows of T were observed and a lineage spends at least 90 % of
        its time in niches with enough births behind their row. None if they fill no grid, or if even in
        the finest more than half of all children stay in their parent's niche.
        """
        filled = self._filled
        return filled[-1] if filled and filled[-1].staying <= STAYING else None

    @property
    def _filled(self) -> list[GridSize]:
        return [grid for grid in self.grids if grid.known >= KNOWN and grid.rows_observed >= OBSERVED]

    @property
    def advice(self) -> str:
        """The suggestion in a sentence."""
        if not self._filled:
            return f"none of these grids: {self.births} births fill none of them, so more are needed"
        finest = self._filled[-1]
        if self.suggestion is None:
            return (
                f"none of these grids: {_by(finest.shape)} is the finest that {self.births} births fill, and "
                f"{finest.staying:.0%} of children stay in their niche there, so more births are needed"
            )
        return (
            f"{_by(finest.shape)}: the finest grid with parents in {OBSERVED:.0%} of its niches and "
            f"{KNOWN:.0%} of a lineage's time in niches of {self.min_births} births; "
            f"{finest.staying:.0%} of children stay in theirs"
        )

    def to_frame(self) -> pd.DataFrame:
        """One row per grid, with the fields of :class:`GridSize`."""
        import pandas as pd

        frame = pd.DataFrame([asdict(grid) for grid in self.grids])
        frame["shape"] = [_by(grid.shape) for grid in self.grids]
        return frame


def sweep(
    archive: Archive,
    sizes: Sequence[int | tuple[int, ...]] | None = None,
    *,
    behavior: Sequence[float] | None = None,
    l: int = 5,
    lineages: int = 100,
    min_births: int = MIN_BIRTHS,
    draws: int = 10,
    folds: int = 5,
    seed: int = 0,
    on_done: Callable[[int], None] | None = None,
) -> Sweep:
    """Bin the births of an archive into grids of several sizes and see what each could tell.

    Births of parents and of children are both binned by their behavior, over the bounds of the
    archive. What it cannot show is that a search on another grid would have kept other elites:
    parents were drawn evenly from the niches of the grid that the search used.

    Parameters
    ----------
    archive : Archive
        Whose births have behaviors and known parents. Of an archive during some steps, births of other
        steps are only parents.
    sizes : sequence of int or tuple of int, optional
        Cells along every axis, or along each one; by default ten sizes, from 4 to 3,200 niches in
        all. Ten thousand niches take minutes.
    behavior : (B,) sequence of float, optional
        Behavior whose niche is scored on every grid; by default that of the parent with the most
        children among the elites in bounds.
    l, lineages : int
        Generations and lineages of the l-evolvability.
    min_births : int
        Births that make a row known.
    draws : int
        Posterior draws of T behind the l-evolvability.
    folds : int
        Parts of the elites that are held out in turn, for ``information``.
    seed : int
        Of folds and draws.
    on_done : callable, optional
        Told how many more grids are done.

    Raises
    ------
    NichechainError
        If there are no sizes, one is no size of a grid, births have no behavior or no known
        parents, or the behavior lies out of bounds.
    """
    axes = len(archive.niches.bounds)
    if sizes is None:
        sizes = default_sizes(axes)
    if not sizes:
        raise NichechainError("there are no sizes: give at least one, such as 20")
    question = Question(l, lineages, draws=draws, seed=seed)
    check_whole(min_births=min_births)
    check_at_least(2, folds=folds)
    for size in sizes:
        if not isinstance(size, Sequence):
            check_whole(size=size)
    shapes = {(size,) * axes if isinstance(size, (int, np.integer)) else tuple(size) for size in sizes}
    grids = [GridNiches(shape, archive.niches.bounds, archive.niches.outside) for shape in shapes]
    grids.sort(key=lambda grid: (len(grid), grid.shape))
    parents, children, elite = _pairs(archive)
    if behavior is None:
        place = _most_fertile(archive, parents, elite)
    else:
        place = as_floats("behavior", behavior)
        if place.shape != (axes,):
            raise NichechainError(f"behavior has {place.size} numbers, but these births have {axes} axes")
        if not ((place >= archive.niches.lower) & (place <= archive.niches.upper)).all():
            shown = ", ".join(f"{x:g}" for x in place)
            raise NichechainError(f"behavior is {shown}, which is out of the archive's bounds")

    def binned(niches: GridNiches) -> GridSize:
        counts = _binned(niches, parents, children, elite)
        chain = estimate(counts)
        root = int(niches.of(place[None])[0])
        score = answer(chain, Root(chain, niche=root), question)
        return GridSize(
            niches.shape,
            len(niches),
            1.0 - counts.never_filled / len(niches),
            counts.rows_observed / len(niches),
            float(np.median(counts.births[: len(niches)][counts.births[: len(niches)] > 0])),
            _known(chain, counts, min_births),
            *_staying(counts),
            _entropy(counts),
            _information(counts, folds, seed),
            score.value,
            score.low,
            score.high,
        )

    found = side_by_side(binned, grids, on_done)
    config = archive.config
    built = config.shape if config.niches == "grid" else None
    return Sweep(tuple(found), tuple(place.tolist()), len(children), built, l, lineages, min_births)


def default_sizes(axes: int) -> list[int]:
    """Cells along every axis of at most ten grids, the coarsest of 4 and the finest of about 3,200 niches."""
    totals = np.geomspace(_FEWEST, _MOST, _TRIED).tolist()
    return sorted({max(2, round(total ** (1.0 / axes))) for total in totals})


def _pairs(archive: Archive) -> tuple[Floats, Floats, Ints]:
    """Behaviors of parents (N, B) and of their children (N, B), and numbers of the parents (N,).

    Initial births, which nobody bore, have NaN for a parent and ``NONE`` for its number.
    """
    # Parents may be older than the steps that are asked about.
    births = archive.table(whole=True).to_pandas(use_threads=False)
    behavior = births.filter(like="behavior_").to_numpy(np.float64)
    if not np.isfinite(behavior).any():
        raise NichechainError(f"{archive.folder} has births without behavior, which cannot be binned again")
    if births["parent_uid"].isna().all():
        raise NichechainError(f"{archive.folder} has births that do not say who their parents are")
    elite = parent_rows(
        *(births[name].fillna(NONE).to_numpy(np.int64) for name in ("run", "uid", "parent_uid"))
    )
    parents = np.where(elite[:, None] == NONE, np.nan, behavior[elite])
    fine = np.isfinite(behavior).all(axis=1)
    if archive.steps is not None:
        first, end = archive.steps
        fine &= ((births["step"] >= first) & (births["step"] < end)).to_numpy(bool)
    return parents[fine], behavior[fine], elite[fine]


def _most_fertile(archive: Archive, parents: Floats, elite: Ints) -> Floats:
    """Behavior of the parent in bounds that has the most children."""
    inside = (elite != NONE) & (parents >= archive.niches.lower).all(axis=1)
    inside &= (parents <= archive.niches.upper).all(axis=1)
    if not inside.any():
        raise NichechainError(f"{archive.folder} has no parents in bounds: name a behavior to score")
    number, size = np.unique(elite[inside], return_counts=True)
    found: Floats = parents[np.flatnonzero(elite == number[np.argmax(size)])[0]]
    return found


def _binned(niches: GridNiches, parents: Floats, children: Floats, elite: Ints) -> TransitionCounts:
    parent = np.full(len(parents), NONE, np.int64)
    born = elite != NONE
    parent[born] = niches.of(parents[born])
    return TransitionCounts.from_births(parent, niches.of(children), niches, elite=elite)


def _known(chain: NicheChain, counts: TransitionCounts, min_births: int) -> float:
    """Stationary mass of niches with so many births, of that of all niches."""
    n = len(counts.niches)
    # T has no zeros where it has a posterior, so that one distribution is approached from anywhere;
    # it is found by following it, which needs no entries of T.
    here = np.full(chain.states, 1.0 / chain.states)
    for _ in range(_MOST_STEPS):
        there = here @ chain.operator
        step = float(np.abs(there - here).sum())
        here = there / there.sum()
        if step < _SETTLED:
            break
    inside = here[:n]
    if not inside.sum():
        return 0.0
    return float(inside[counts.births[:n] >= min_births].sum() / inside.sum())


def _staying(counts: TransitionCounts) -> tuple[float, float]:
    """Share of children that stay in their niche: of all, and as the mean over rows."""
    n = len(counts.niches)
    own, births = counts.matrix.diagonal()[:n], counts.births[:n]
    seen = births > 0
    if not seen.any():
        return math.nan, math.nan
    return float(own.sum() / births.sum()), float((own[seen] / births[seen]).mean())


def _entropy(counts: TransitionCounts) -> float:
    """Mean entropy of a row in bits, weighted by births.

    Few births show too little surprise, which Miller and Madow (1955) make up for by (K − 1) / 2N
    nats in a row of N births in K states.
    """
    births = counts.births.astype(np.float64)
    entries = counts.matrix.tocoo()
    parent, count = entries.coords[0], entries.data.astype(np.float64)
    plain = -np.bincount(parent, count * np.log(count / births[parent]), births.size)
    nats = plain + (np.bincount(parent, minlength=births.size) - 1.0) / 2.0 * (births > 0)
    return float(nats.sum() / births.sum() / math.log(2.0)) if births.any() else math.nan


def _information(counts: TransitionCounts, folds: int, seed: int) -> float:
    """Mean of log2 T_ij over the share of all children in j, on held-out elites."""
    families = families_of(counts)
    elite = elites_of(families)
    if elite.max(initial=-1) + 1 < folds:
        return math.nan
    fold = folds_of(elite, folds, keyed(seed, Purpose.FOLDS))
    gain = 0.0
    for turn in range(folds):
        out = fold == turn
        seen = counts_of_families(families[~out], counts)
        parent, child, weight = families[out, 0], families[out, 2], families[out, 3]
        landed = (
            np.bincount(seen.matrix.indices, seen.matrix.data, counts.niches.states)
            + 1.0 / counts.niches.states
        )
        anywhere = landed / landed.sum()
        foretold = probability_of(estimate(seen), parent, child)
        gain += float((weight * np.log2(foretold / anywhere[child])).sum())
    return gain / float(families[:, 3].sum())


def _by(shape: tuple[int, ...]) -> str:
    return "x".join(map(str, shape))
