"""Whether the niche of the parent is all that matters: permutation tests on births.

Children of one parent share a genotype, and are therefore alike beyond what their niche says. So
what a test permutes are parents with all their children, not single children; except where it
asks just that, whether brothers are more alike than cousins. Only what births say twice can be
permuted: every result tells how many niches and births contribute.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.validation.lineages import Triples
from nichechain.validation.rollouts import OnDone

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PERMUTATIONS = 499
_MOST_PERMUTATIONS, _MOST_BINS = 10_000_000, 10_000
DEPTH_BINS = 3


@dataclass(frozen=True)
class MarkovTest:
    """What came of a permutation test.

    Parameters
    ----------
    name : str
    statistic : float
        As observed.
    expected : float
        Its mean over permutations: what a chain would show.
    p_value : float
        Share of the permutations, the observed one among them, with at least this statistic.
    permutations : int
    niches, births : int
        Parent states, and their births, among which something could be permuted.
    all_niches, all_births : int
        Those of the archive that the question could be asked of.
    """

    name: str
    statistic: float
    expected: float
    p_value: float
    permutations: int
    niches: int
    births: int
    all_niches: int
    all_births: int

    @property
    def ratio(self) -> float:
        """Statistic over expectation: about 1 for a chain, NaN where nothing could be permuted."""
        return self.statistic / self.expected if self.expected else float("nan")


class _Test(IntEnum):
    """Which generator a test draws from."""

    LINEAGE = 0
    HOMOGENEITY = 1
    SIBLINGS = 2


def lineage_test(
    triples: Triples,
    *,
    depth_bins: int = DEPTH_BINS,
    permutations: int = PERMUTATIONS,
    seed: int = 0,
    on_done: OnDone | None = None,
) -> MarkovTest:
    """Whether the grandparent's niche tells anything of the child's that the parent's does not.

    G² of child state against grandparent state within parent state and depth bin: genotypes of
    another depth may breed differently (unselected Cauchy steps let weights grow), which is a
    question of its own. Grandparents are permuted among the parents of one niche and bin.

    Parameters
    ----------
    triples : Triples
    depth_bins : int
        Quantile bins of the parents' depth, at least 1.
    permutations : int
        At least 1.
    seed : int
    on_done : callable, optional
        Told how many more permutations are done.

    Raises
    ------
    NichechainError
        If a number is out of range.
    """
    check_at_least(1, depth_bins=depth_bins)
    if depth_bins > _MOST_BINS:
        raise NichechainError(f"depth_bins is {depth_bins}, but must be at most {_MOST_BINS}")
    known = triples.with_grandparent
    cuts = np.quantile(known.depth, np.arange(1, depth_bins) / depth_bins) if len(known) else np.empty(0)
    stratum = known.niche * depth_bins + np.searchsorted(cuts, known.depth)
    tables = _Tables(known, stratum, known.grandparent)
    return _permuted(
        "lineage",
        tables,
        tables.g2,
        keyed(seed, Purpose.PERMUTATION, _Test.LINEAGE),
        permutations,
        on_done,
    )


def homogeneity_test(
    triples: Triples, *, permutations: int = PERMUTATIONS, seed: int = 0, on_done: OnDone | None = None
) -> MarkovTest:
    """Whether early parents of a niche breed like late ones.

    Pearson's X² of child state against the earlier or later half of a niche's parents, by birth,
    which is permuted. (G² would not do: with so few births to a cell it grows with the evenness
    of the halves, and rejected a quarter of the simulated archives of a true chain.)

    Parameters
    ----------
    triples, permutations, seed, on_done
        As in :func:`lineage_test`.

    Raises
    ------
    NichechainError
        If a number is out of range.
    """
    order = np.lexsort((triples.step, triples.niche))
    niche = triples.niche[order]
    rank = np.arange(niche.size) - np.searchsorted(niche, niche)
    late = np.empty(niche.size, np.int64)
    late[order] = 2 * rank >= np.bincount(niche, minlength=1)[niche]
    tables = _Tables(triples, triples.niche, late)
    return _permuted(
        "homogeneity",
        tables,
        tables.x2,
        keyed(seed, Purpose.PERMUTATION, _Test.HOMOGENEITY),
        permutations,
        on_done,
    )


def sibling_test(
    triples: Triples, *, permutations: int = PERMUTATIONS, seed: int = 0, on_done: OnDone | None = None
) -> MarkovTest:
    """Whether parents of one niche breed alike, whoever they are.

    Pearson's X² of child state against parent within the parent's niche; children are permuted.
    The ratio is the design effect of births as draws from a row of T: a niche of N births tells
    about as much of its row as N / ratio independent ones.

    Parameters
    ----------
    triples, permutations, seed, on_done
        As in :func:`lineage_test`.

    Raises
    ------
    NichechainError
        If a number is out of range.
    """
    # Every child a parent of its own, labelled by the true one.
    births = np.arange(len(triples))
    of = triples.elite
    singles = Triples(
        births, triples.child, triples.niche[of], triples.grandparent[of], triples.depth[of], triples.step[of]
    )
    tables = _Tables(singles, singles.niche, of)
    return _permuted(
        "siblings",
        tables,
        tables.x2,
        keyed(seed, Purpose.PERMUTATION, _Test.SIBLINGS),
        permutations,
        on_done,
    )


class _Tables:
    """Contingency tables of label × child state, one for each stratum, under permuted labels.

    Strata in which no permutation changes the tables are left out: those of one label, those
    where no two parents share a label, and those of one child state.
    """

    def __init__(self, triples: Triples, stratum: Ints, label: Ints) -> None:
        self.all_niches = int(np.unique(triples.niche).size)
        self.all_births = len(triples)
        kept = _contributes(triples, stratum, label)
        triples, stratum, label = triples.of(kept), stratum[kept], label[kept]
        self.niches = int(np.unique(triples.niche).size)
        self.births = len(triples)
        # Parents in the order of their strata, so that a permutation within them is one sort.
        order = np.argsort(stratum, kind="stable")
        place = np.empty(order.size, np.int64)
        place[order] = np.arange(order.size)
        self._stratum = np.unique(stratum[order], return_inverse=True)[1]
        pairs = np.stack([self._stratum, label[order]])
        self._row = np.unique(pairs, axis=1, return_inverse=True)[1].ravel().astype(np.int64)
        parent = place[triples.elite]
        self._size = np.bincount(parent, minlength=order.size)
        states = int(triples.child.max(initial=0)) + 1
        cells, self._count = np.unique(parent * states + triples.child, return_counts=True)
        self._parent = cells // states
        columns = self._stratum[self._parent] * states + cells % states
        self._column = np.unique(columns, return_inverse=True)[1].astype(np.int64)
        self._column_sum = np.bincount(self._column, self._count)
        stratum_sum = np.bincount(self._stratum, self._size)
        self._fixed = _xlogx(stratum_sum).sum() - _xlogx(self._column_sum).sum()
        self._row_total = np.zeros(int(self._row.max(initial=-1)) + 1)
        self._row_total[self._row] = stratum_sum[self._stratum]

    @property
    def labels(self) -> Ints:
        """Row of its stratum's table that each parent counts in, (E,)."""
        return self._row

    def shuffled(self, rng: np.random.Generator) -> Ints:
        """The labels, permuted within strata."""
        return self._row[np.lexsort((rng.random(self._row.size), self._stratum))]

    def g2(self, labels: Ints) -> float:
        """G² = 2 Σ n log(n / expected)."""
        rows = np.bincount(labels, self._size)
        _, count = self._cells(labels)
        return float(2.0 * (_xlogx(count).sum() - _xlogx(rows).sum() + self._fixed))

    def x2(self, labels: Ints) -> float:
        """X² = Σ (n − expected)² / expected."""
        rows = np.bincount(labels, self._size)
        cell, count = self._cells(labels)
        row, column = cell // self._column_sum.size, cell % self._column_sum.size
        share = count * count / (rows[row] * self._column_sum[column])
        return float((share * self._row_total[row]).sum() - self.births)

    def _cells(self, labels: Ints) -> tuple[Ints, Floats]:
        """Cells of the tables that are not empty, and their counts."""
        cell = labels[self._parent] * self._column_sum.size + self._column
        order = np.argsort(cell)
        cell = cell[order]
        first = np.flatnonzero(np.diff(cell, prepend=-1))
        return cell[first], np.add.reduceat(self._count[order], first).astype(np.float64)


def _contributes(triples: Triples, stratum: Ints, label: Ints) -> NDArray[np.bool_]:
    """Whether permuting labels within a parent's stratum can change its table, (E,)."""
    strata = np.unique(stratum, return_inverse=True)[1].ravel()
    parents = np.bincount(strata)
    pairs = np.unique(np.stack([strata, label]), axis=1)[0]
    labels = np.bincount(pairs, minlength=parents.size)
    landed = np.unique(np.stack([strata[triples.elite], triples.child]), axis=1)[0]
    states = np.bincount(landed, minlength=parents.size)
    useful = (labels > 1) & (labels < parents) & (states > 1)
    return useful[strata]


def _permuted(
    name: str,
    tables: _Tables,
    statistic: Callable[[Ints], float],
    rng: np.random.Generator,
    permutations: int,
    on_done: OnDone | None,
) -> MarkovTest:
    """The test of a statistic of labels."""
    permutations = check_permutations(permutations)
    facts = (tables.niches, tables.births, tables.all_niches, tables.all_births)
    if not tables.births:
        return MarkovTest(name, 0.0, 0.0, 1.0, permutations, *facts)
    observed = statistic(tables.labels)
    values = permuted(lambda: statistic(tables.shuffled(rng)), permutations, on_done)
    return MarkovTest(name, observed, float(values.mean()), p_value(observed, values), permutations, *facts)


def permuted(statistic: Callable[[], float], permutations: int, on_done: OnDone | None) -> Floats:
    """The statistic under each permutation, (permutations,)."""
    values = np.empty(permutations)
    for number in range(permutations):
        values[number] = statistic()
        if on_done is not None:
            on_done(1)
    return values


def p_value(observed: float, permuted: Floats) -> float:
    """Share of the permutations, the observed one among them, that are at least as large."""
    # Sums of the same terms in another order are equal, but for rounding.
    slack = 1e-9 * max(1.0, abs(observed))
    return float((1 + np.count_nonzero(permuted >= observed - slack)) / (1 + permuted.size))


def check_permutations(permutations: int) -> int:
    """The number, unless a test would be without permutations, or with more than memory is for."""
    check_at_least(1, permutations=permutations)
    if permutations > _MOST_PERMUTATIONS:
        raise NichechainError(f"permutations is {permutations}, but must be at most {_MOST_PERMUTATIONS}")
    return int(permutations)


def _xlogx(n: Ints | Floats) -> Floats:
    values = n.astype(np.float64)
    return values * np.log(np.maximum(values, 1.0))
