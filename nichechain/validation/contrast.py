"""Whether one archive's niches are more evolvable than another's, with runs or elites as the sample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray
from scipy.special import stdtrit

from nichechain.births.joins import across_runs
from nichechain.births.table import NONE, check_columns
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.estimators import estimate, refitted
from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.coverage import rarefied_coverage
from nichechain.evolvability.level import level
from nichechain.evolvability.question import Question
from nichechain.execution.side_by_side import side_by_side
from nichechain.niches import Niches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_COLUMNS = ("run", "parent_uid", "parent_niche", "child_niche")
_LEVEL = 0.9
# Draws of T for the values themselves, which cost nothing beside the resamples.
_VALUE_DRAWS = 50


@dataclass(frozen=True)
class ContrastRow:
    """One figure of two archives.

    Parameters
    ----------
    figure : str
    first, second : float
        Its values, in niches.
    difference : float
        Second − first.
    standard_error : float
        Of the difference, by resampling.
    low, high : float
        90 % interval of the difference.
    """

    figure: str
    first: float
    second: float
    difference: float
    standard_error: float
    low: float
    high: float


@dataclass(frozen=True)
class Contrast:
    """Two archives of equal niches, figure by figure.

    Parameters
    ----------
    rows : tuple of ContrastRow
        ``evolvability``: niches that U lineages reach, ``reach``: niches that one lineage does,
        both as means over the niches compared; ``coverage``: niches filled by as many births as
        the smaller archive has.
    niches : int
        Niches compared: those with ``min_births`` births behind their row in both archives.
    clusters : tuple of (str, int)
        Of each archive what was resampled, ``runs`` or ``elites``, and how many there are.
    births : int
        Births at which coverage is compared.
    used, recorded : (int, int)
        Births of each archive that were compared, and those that it has.
    aligned : int, optional
        Births of each run that were compared; None where all were.
    shared : int
        Births that both archives begin with: one search, where they are many.
    l, lineages, min_births, resamples : int
    """

    rows: tuple[ContrastRow, ...]
    niches: int
    clusters: tuple[tuple[str, int], tuple[str, int]]
    births: int
    used: tuple[int, int]
    recorded: tuple[int, int]
    aligned: int | None
    shared: int
    l: int
    lineages: int
    min_births: int
    resamples: int

    def to_frame(self) -> pd.DataFrame:
        """One row per figure, with the fields of :class:`ContrastRow`."""
        return pd.DataFrame([asdict(row) for row in self.rows])


def contrast(
    first: pa.Table,
    second: pa.Table,
    niches: Niches,
    *,
    align: bool = True,
    l: int = 5,
    lineages: int = 100,
    min_births: int = 20,
    resamples: int = 100,
    draws: int = 4,
    seed: int = 0,
    on_done: Callable[[int], None] | None = None,
) -> Contrast:
    """Compare the births of two archives.

    Parameters
    ----------
    first, second : pyarrow.Table
        Columns of :mod:`nichechain.births.table`.
    niches : Niches
        The niches of both.
    align : bool
        Whether only the first births of each run count, in the order of steps, as many as the shortest
        run of both archives has: the level of l-evolvability may drift while a search goes on.
    l, lineages : int
        Generations and number U of lineages.
    min_births : int
        Niches with fewer births behind their row, in either archive, are left out of evolvability
        and reach.
    resamples : int
        Resamples of the births of either archive, at least 2.
    draws : int
        Posterior draws of T for each resample.
    seed : int
        Of resamples and draws.
    on_done : callable, optional
        Told how many more resamples are done, of both archives together.

    Returns
    -------
    Contrast

    Raises
    ------
    NichechainError
        If an argument is out of range or no niche can be compared.

    Notes
    -----
    Where an archive has several runs, whole runs are drawn with replacement; where it has one,
    its elites are, with all their children: then the interval tells what other elites of this
    run would have changed, not what another run would. The prior keeps the strength that
    all births gave. Resamples hold fewer different births than a real sample, which lowers
    every figure, so only their spread is used: the interval is the difference ± its standard error
    times Student's quantile, and for few runs r the spread is corrected by √(r/(r − 1)).
    """
    question = Question(l, lineages, draws=draws, seed=seed)
    check_at_least(2, resamples=resamples)
    check_at_least(0, min_births=min_births)
    recorded = len(first), len(second)
    first, second = _in_order(first), _in_order(second)
    shared = _shared(first, second)
    aligned = None
    if align:
        aligned = int(
            np.concatenate([_runs(births) for births in (first, second)]).min(initial=max(recorded))
        )
        first, second = (_beginnings(births, aligned) for births in (first, second))
    sides = _Side.of(first, niches), _Side.of(second, niches)
    whole = [side.counts() for side in sides]
    enough = [counts.births[: len(niches)] >= max(1, min_births) for counts in whole]
    compared = np.flatnonzero(enough[0] & enough[1])
    if not compared.size:
        raise NichechainError(
            f"no niche has {min_births} births behind its row of T in both archives: lower min_births"
        )
    size = min(int(counts.visits.sum()) for counts in whole)
    values, spreads, freedom = [], [], []
    for number, (side, counts) in enumerate(zip(sides, whole, strict=True)):
        fitted = estimate(counts).posterior
        assert fitted is not None

        def figures(counts: TransitionCounts, draws: int, rng: np.random.Generator) -> Floats:
            posterior = refitted(fitted, counts)  # noqa: B023  # called in this round only
            found = np.zeros(2)
            for _ in range(draws):
                one = replace(question, seed=int(rng.integers(2**31)))
                found += level(posterior, compared, one, [lineages, 1]) / draws
            visits = counts.visits
            return np.append(
                found, rarefied_coverage(visits, min(size, int(visits.sum())), counted=len(niches))
            )

        # Both are drawn alike, so that archives of the same births do not differ.
        values.append(figures(counts, _VALUE_DRAWS, keyed(seed, Purpose.POSTERIOR)))

        def figures_again(resample: int) -> Floats:
            rng = keyed(seed, Purpose.RESAMPLING, resample)
            again = side.counts(side.resampled(rng))  # noqa: B023
            return figures(again, draws, rng)

        again = side_by_side(figures_again, range(number, 2 * resamples, 2), on_done)
        correction = side.clusters / max(1, side.clusters - 1)
        spreads.append(np.var(again, axis=0, ddof=1) * correction)
        freedom.append(side.clusters - 1)
    difference = values[1] - values[0]
    error = np.sqrt(spreads[0] + spreads[1])
    quantile = float(stdtrit(max(1, min(freedom)), 0.5 + _LEVEL / 2))
    rows = tuple(
        ContrastRow(
            name, float(a), float(b), float(d), float(e), float(d - quantile * e), float(d + quantile * e)
        )
        for name, a, b, d, e in zip(
            ("evolvability", "reach", "coverage"), *values, difference, error, strict=True
        )
    )
    clusters = (sides[0].kind, sides[0].clusters), (sides[1].kind, sides[1].clusters)
    used = len(first), len(second)
    return Contrast(
        rows,
        compared.size,
        clusters,
        size,
        used,
        recorded,
        aligned,
        shared,
        l,
        lineages,
        min_births,
        resamples,
    )


def _in_order(births: pa.Table) -> pa.Table:
    """Births run by run, in the order of their steps, or as they come where they do not say them."""
    check_columns(births, *_COLUMNS)
    run = births["run"].to_numpy()
    known = "step" in births.column_names and not births["step"].null_count
    step = births["step"].to_numpy() if known else np.zeros(run.size)
    return births.take(pa.array(np.lexsort((step, run))))


def _runs(births: pa.Table) -> Ints:
    """Births of each run."""
    return np.unique(births["run"].to_numpy(), return_counts=True)[1].astype(np.int64)


def _beginnings(births: pa.Table, number: int) -> pa.Table:
    """The first so many births of each run."""
    sizes = _runs(births)
    within = np.arange(len(births)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return births.filter(pa.array(within < number))


def _shared(first: pa.Table, second: pa.Table) -> int:
    """Births that both begin with: the same parents, niches and behavior."""
    size = min(len(first), len(second))
    same = np.ones(size, bool)
    for name in first.column_names:
        if name in second.column_names and (name in _COLUMNS[1:] or name.startswith("behavior_")):
            one, other = (table[name].slice(0, size).fill_null(NONE).to_numpy() for table in (first, second))
            same &= one == other
    return size if same.all() else int(np.argmin(same))


@dataclass(frozen=True)
class _Side:
    """Births of one archive, in clusters that are drawn together.

    Parameters
    ----------
    niches : Niches
    parent, child, elite, cluster : (N,) int64 arrays
        Births that did not fail; ``NONE`` for a null parent, and for the cluster of a birth that
        is in every resample.
    kind : {"runs", "elites"}
    clusters : int
    """

    niches: Niches
    parent: Ints
    child: Ints
    elite: Ints
    cluster: Ints
    kind: str
    clusters: int

    @classmethod
    def of(cls, births: pa.Table, niches: Niches) -> _Side:
        parent, child, uid, run = (
            births[name].fill_null(NONE).to_numpy().astype(np.int64)
            for name in ("parent_niche", "child_niche", "parent_uid", "run")
        )
        parent, child, uid, run = (column[child != NONE] for column in (parent, child, uid, run))
        (elite,) = across_runs(run, uid)
        # A birth of a parent that is not known is a cluster, and an elite, of its own.
        elite = np.where(elite == NONE, elite.max(initial=NONE) + 1 + np.arange(elite.size), elite)
        names, by_run = np.unique(run, return_inverse=True)
        if names.size > 1:
            return cls(niches, parent, child, elite, by_run.ravel().astype(np.int64), "runs", names.size)
        cluster = np.full(parent.size, NONE, np.int64)
        moved = parent != NONE
        owners, number = np.unique(elite[moved], return_inverse=True)
        cluster[moved] = number.ravel()
        return cls(niches, parent, child, elite, cluster, "elites", owners.size)

    def counts(self, multiplicity: Ints | None = None) -> TransitionCounts:
        """Counts of all births, or of each cluster so many times (clusters,)."""
        n = np.ones(self.parent.size, np.int64)
        if multiplicity is not None:
            # Initial births of a single run are nobody's children, and stay.
            n = np.where(self.cluster == NONE, 1, multiplicity[self.cluster])
        moved = self.parent != NONE
        if multiplicity is None:
            counts = TransitionCounts.from_births(self.parent, self.child, self.niches, elite=self.elite)
        else:
            counts = TransitionCounts.from_pairs(self.parent[moved], self.child[moved], self.niches, n[moved])
        # The counts have been made, so every child's state is one of these niches.
        visits = np.zeros(self.niches.states, np.int64)
        np.add.at(visits, self.child, n)
        return replace(counts, visits=visits)

    def resampled(self, rng: np.random.Generator) -> Ints:
        """How often each cluster was drawn, (clusters,)."""
        return np.bincount(rng.integers(self.clusters, size=self.clusters), minlength=self.clusters)
