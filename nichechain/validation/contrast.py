"""Whether niches of one search are more evolvable than another's, with runs or elites as the sample."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from scipy.special import stdtrit

from nichechain.births.joins import across_runs
from nichechain.births.lineages import no_lineages
from nichechain.births.table import LINEAGE, NONE, check_columns
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.estimators import estimate, refitted
from nichechain.chain.lineages import fitted_law
from nichechain.core.checks import check_at_least, check_fits, shown
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.coverage import rarefied_coverage
from nichechain.evolvability.level import MOST_ROOTS, level
from nichechain.evolvability.question import Question
from nichechain.execution.side_by_side import side_by_side, stop_if_nobody_waits
from nichechain.niches import Niches

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_COLUMNS = ("run", "parent_uid", "parent_niche", "child_niche")
_LEVEL = 0.9
# Draws of T for the values themselves, which cost nothing beside the resamples.
_VALUE_DRAWS = 50
# Simulations of each brood of a resample: a tenth of the variance that real broods have.
_REPEATS = 10


@dataclass(frozen=True)
class ContrastRow:
    """One figure of two groups of archives.

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
    """Two groups of archives of equal niches, figure by figure.

    Parameters
    ----------
    rows : tuple of ContrastRow
        ``evolvability``: niches that U lineages reach, ``reach``: niches that one lineage does,
        both as means over the niches compared; ``coverage``: niches filled by as many births as
        the smaller group has.
    niches : int
        Niches compared: those with ``min_births`` births behind their row in both groups.
    clusters : tuple of (str, int)
        Of each group what was resampled, ``runs`` or ``elites``, and how many there are.
    births : int
        Births at which coverage is compared.
    used, recorded : (int, int)
        Births of each group that were compared, and those that it has.
    aligned : int, optional
        Births of each run that were compared; None where all were.
    shared : int
        Births that both groups begin with: one search, where they are many.
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
        import pandas as pd

        return pd.DataFrame([asdict(row) for row in self.rows])


def contrast(
    first: pa.Table | Sequence[pa.Table],
    second: pa.Table | Sequence[pa.Table],
    niches: Niches,
    *,
    align: bool = True,
    l: int = 5,
    lineages: int = 100,
    min_births: int = 20,
    resamples: int = 50,
    draws: int = 4,
    seed: int = 0,
    on_done: Callable[[int], None] | None = None,
) -> Contrast:
    """Compare the births of two archives, or of two groups of archives.

    Parameters
    ----------
    first, second : pyarrow.Table, or sequence of them
        Columns of :mod:`nichechain.births.table`. Runs of different tables are different runs.
    niches : Niches
        The niches of all.
    align : bool
        Whether only the first births of each run count, in the order of steps, as many as the shortest
        of all runs has: the level of l-evolvability may drift while a search goes on.
    l, lineages : int
        Generations and number U of lineages.
    min_births : int
        Niches with fewer births behind their row, in either group, are left out of evolvability
        and reach.
    resamples : int
        Resamples of the births of either group, at least 2. A standard error is known to a tenth from 50
        (Efron and Tibshirani 1993).
    draws : int
        Posterior draws of T for each resample.
    seed : int
        Of resamples and draws.
    on_done : callable, optional
        Told how many more resamples are done, of both groups together.

    Returns
    -------
    Contrast

    Raises
    ------
    NichechainError
        If an argument is out of range or no niche can be compared.

    Notes
    -----
    The births of a group are pooled. Where it has several runs, whole runs are drawn with replacement;
    where it has one, its elites are, with all their children: then the interval tells what other elites of
    this run would have changed, not what another run would. The prior keeps the strength that all births
    gave. How lineages differ from children of elites is fitted again, to the lineages of the runs that were
    drawn, or to broods drawn likewise. Resamples hold fewer different births than a real sample, which lowers
    every figure, so only their spread is used: the interval is the difference ± its standard error
    times Student's quantile, and for few runs r the spread is corrected by √(r/(r − 1)).
    """
    question = Question(l, lineages, draws=draws, seed=seed)
    check_at_least(2, resamples=resamples)
    check_fits(resamples=resamples)
    check_at_least(0, min_births=min_births)
    first, second = _pooled("first", first), _pooled("second", second)
    recorded = len(first), len(second)
    first, second = _in_order(first), _in_order(second)
    shared = _shared(first, second)
    aligned = None
    if align:
        aligned = int(
            np.concatenate([_runs(births) for births in (first, second)]).min(initial=max(recorded))
        )
        given = first, second
        first, second = (_beginnings(births, aligned) for births in given)
        for name, whole_run, part in zip(("first", "second"), given, (first, second), strict=True):
            if _has_lineages(whole_run) and not _has_lineages(part):
                warnings.warn(
                    f"the {name} archive has lineages, but all after its first {aligned} births, which are "
                    "compared: its chain is not calibrated here; compare all births to keep them",
                    stacklevel=2,
                )
    sides = _Side.of(first, niches), _Side.of(second, niches)
    whole = [side.counts() for side in sides]
    enough = [counts.births[: len(niches)] >= max(1, min_births) for counts in whole]
    compared = np.flatnonzero(enough[0] & enough[1])
    if not compared.size:
        raise NichechainError(
            f"no niche has {min_births} births behind its row of T in both groups: lower min_births"
        )
    chains = [estimate(counts) for counts in whole]
    question.warn_if_long(chains[0], min(compared.size, MOST_ROOTS), 2 * int(resamples) * question.draws)
    size = min(int(counts.visits.sum()) for counts in whole)
    values, spreads, freedom = [], [], []
    for number, (side, counts, chain) in enumerate(zip(sides, whole, chains, strict=True)):
        fitted = chain.posterior
        assert fitted is not None

        def figures(counts: TransitionCounts, draws: int, rng: np.random.Generator) -> Floats:
            posterior = refitted(fitted, counts)  # noqa: B023  # called in this round only
            if counts is not whole[number]:  # noqa: B023
                posterior = replace(posterior, law=fitted_law(posterior, _REPEATS))

            def drawn(seed: int) -> Floats:
                stop_if_nobody_waits()
                return level(posterior, compared, replace(question, seed=seed), [lineages, 1])

            seeds = [int(rng.integers(2**31)) for _ in range(draws)]
            # Resamples are side by side already.
            levels = side_by_side(drawn, seeds) if counts is whole[number] else list(map(drawn, seeds))  # noqa: B023
            found = np.mean(levels, axis=0)
            visits = counts.visits
            return np.append(
                found, rarefied_coverage(visits, min(size, int(visits.sum())), counted=len(niches))
            )

        # Both are drawn alike, so that groups of the same births do not differ.
        values.append(figures(counts, _VALUE_DRAWS, keyed(seed, Purpose.POSTERIOR)))

        def figures_again(resample: int) -> Floats:
            rng = keyed(seed, Purpose.RESAMPLING, resample)
            return figures(side.resampled(rng), draws, rng)  # noqa: B023

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


def _pooled(name: str, births: pa.Table | Sequence[pa.Table]) -> pa.Table:
    """The tables one after the other, their runs numbered on."""
    tables = (births,) if isinstance(births, pa.Table) else births
    several = isinstance(tables, Sequence) and len(tables) > 0
    if not several or not all(isinstance(table, pa.Table) for table in tables):
        raise NichechainError(f"{name} is {shown(births)}, but must be a table of births or several")
    taken, numbered = 0, []
    for table in tables:
        check_columns(table, *_COLUMNS)
        _, run = np.unique(table["run"].to_numpy(), return_inverse=True)
        place = table.schema.get_field_index("run")
        numbered.append(table.set_column(place, "run", pa.array(run.ravel().astype(np.int32) + taken)))
        taken += int(run.max(initial=-1)) + 1
    return pa.concat_tables(numbered)


def _in_order(births: pa.Table) -> pa.Table:
    """Births run by run, in the order of their steps, or as they come where they do not say them."""
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


def _has_lineages(births: pa.Table) -> bool:
    return LINEAGE in births.column_names and bool(pc.any(births[LINEAGE]).as_py())


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
    """Births of one group, in clusters that are drawn together.

    Parameters
    ----------
    niches : Niches
    parent, child, elite, cluster : (N,) int64 arrays
        Births that did not fail; ``NONE`` for a parent that is null or no elite, and for the cluster of a
        birth that is in every resample.
    lineages : tuple of (L, 6) int64 arrays
        Births of unselected lineages, see :mod:`nichechain.births.lineages`, in parts that are drawn
        together: those of a run, or a brood.
    kind : {"runs", "elites"}
    clusters : int
    """

    niches: Niches
    parent: Ints
    child: Ints
    elite: Ints
    cluster: Ints
    lineages: tuple[Ints, ...]
    kind: str
    clusters: int

    @classmethod
    def of(cls, births: pa.Table, niches: Niches) -> _Side:
        parent, child, uid, run = (
            births[name].fill_null(NONE).to_numpy().astype(np.int64)
            for name in ("parent_niche", "child_niche", "parent_uid", "run")
        )
        if LINEAGE in births.column_names:
            # What lineages do is a law of its own, and no row of T.
            parent = np.where(births[LINEAGE].fill_null(False).to_numpy(), NONE, parent)
        every_run = run
        parent, child, uid, run = (column[child != NONE] for column in (parent, child, uid, run))
        (elite,) = across_runs(run, uid)
        # A birth of a parent that is not known is a cluster, and an elite, of its own.
        elite = np.where(elite == NONE, elite.max(initial=NONE) + 1 + np.arange(elite.size), elite)
        names, by_run = np.unique(run, return_inverse=True)
        if names.size > 1:
            by_run = by_run.ravel().astype(np.int64)
            lineages = tuple(
                TransitionCounts.from_births(births.filter(pa.array(every_run == name)), niches).lineages
                for name in names
            )
            return cls(niches, parent, child, elite, by_run, lineages, "runs", names.size)
        cluster = np.full(parent.size, NONE, np.int64)
        moved = parent != NONE
        table = TransitionCounts.from_births(births, niches).lineages
        lineages = tuple(table[table[:, 0] == brood] for brood in np.unique(table[:, 0]))
        owners, number = np.unique(elite[moved], return_inverse=True)
        cluster[moved] = number.ravel()
        return cls(niches, parent, child, elite, cluster, lineages, "elites", owners.size)

    def counts(self) -> TransitionCounts:
        """Counts of all births."""
        counts = TransitionCounts.from_births(self.parent, self.child, self.niches, elite=self.elite)
        return replace(counts, lineages=_together(self.lineages))

    def resampled(self, rng: np.random.Generator) -> TransitionCounts:
        """Counts of as many clusters, drawn with replacement."""
        drawn = np.bincount(rng.integers(self.clusters, size=self.clusters), minlength=self.clusters)
        # Births of a single run that are no elite's children stay.
        n = np.where(self.cluster == NONE, 1, drawn[self.cluster])
        moved = self.parent != NONE
        counts = TransitionCounts.from_pairs(self.parent[moved], self.child[moved], self.niches, n[moved])
        # The counts have been made, so every child's state is one of these niches.
        visits = np.zeros(self.niches.states, np.int64)
        np.add.at(visits, self.child, n)
        parts = len(self.lineages)
        again = drawn if self.kind == "runs" else np.bincount(rng.choice(parts, size=parts), minlength=parts)
        lineages = [part for part, times in zip(self.lineages, again, strict=True) for _ in range(times)]
        return replace(counts, visits=visits, lineages=_together(lineages))


def _together(lineages: Sequence[Ints]) -> Ints:
    """Tables of lineages as one, their broods and lineages numbered on."""
    taken, numbered = np.zeros(2, np.int64), [no_lineages()]
    for table in lineages:
        moved = table.copy()
        moved[:, :2] += taken
        taken = np.maximum(taken, moved[:, :2].max(axis=0, initial=-1) + 1)
        numbered.append(moved)
    return np.concatenate(numbered)
