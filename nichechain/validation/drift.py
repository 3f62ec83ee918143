"""Whether the level of l-evolvability drifts while a search goes on.

Births are put in the order of their steps and cut into parts of equal numbers; each part gives a chain
of its own. Tests of single rows hardly see a drift that all rows share, so what is compared is the mean
l-evolvability over niches.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from scipy.special import stdtrit

from nichechain.births.table import LINEAGE, check_columns
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.estimators import with_posterior
from nichechain.chain.filters import counts_of
from nichechain.chain.posterior import DirichletPosterior
from nichechain.chain.prior import fit_prior
from nichechain.core.checks import check_at_least, shown
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.coverage import expected_coverage
from nichechain.evolvability.question import Question
from nichechain.execution.side_by_side import side_by_side
from nichechain.niches import Niches

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LEVEL = 0.9
_FEWEST_NICHES = 5
# Enough births for a row to say something of its own.
_MIN_BIRTHS = 10
_COLUMNS = ("run", "parent_uid", "parent_niche", "child_niche", "step", "accepted")


@dataclass(frozen=True)
class LevelDrift:
    """Mean l-evolvability by the first and by the second half of the births.

    Parameters
    ----------
    early, late : float
        In niches, over the niches that both halves observed.
    low, high : float
        90 % interval of late − early, over what births leave unknown.
    births : (int, int)
        Births of each half.
    niches : int
        Niches compared.
    l, lineages : int
    """

    early: float
    late: float
    low: float
    high: float
    births: tuple[int, int]
    niches: int
    l: int
    lineages: int

    @property
    def disagrees(self) -> bool:
        """Whether no difference at all lies outside the interval."""
        return not self.low <= 0.0 <= self.high

    @property
    def answer(self) -> str:
        """What to know beside a number, in one plain sentence."""
        levels = f"{self.early:.1f} by the first half of the births, {self.late:.1f} by the second"
        if self.disagrees:
            return (
                f"Early and late births disagree on the level: over {self.niches} niches, "
                f"mean {self.l}-evolvability is {levels}."
            )
        return f"Early and late births agree on the level: mean {self.l}-evolvability is {levels}."


@dataclass(frozen=True)
class LevelCourse:
    """Mean l-evolvability over the course of a search, over the niches that all parts observed.

    Parameters
    ----------
    first_step, last_step, births : (P,) int64 arrays
        Of the parts, in the order of steps.
    level, low, high : (P,) float64 arrays
        By the births of each part alone, in niches, with 90 % intervals.
    grown : (P,) int64 array
        Births up to the end of each part.
    grown_level, grown_low, grown_high : (P,) float64 arrays
        By all births up to the end of each part.
    niches, l, lineages : int
    """

    first_step: Ints
    last_step: Ints
    births: Ints
    level: Floats
    low: Floats
    high: Floats
    grown: Ints
    grown_level: Floats
    grown_low: Floats
    grown_high: Floats
    niches: int
    l: int
    lineages: int

    def to_frame(self) -> pd.DataFrame:
        """One row per part, with the fields as columns."""
        import pandas as pd

        return pd.DataFrame({name: getattr(self, name) for name in _COURSE})


_COURSE = (
    "first_step",
    "last_step",
    "births",
    "level",
    "low",
    "high",
    "grown",
    "grown_level",
    "grown_low",
    "grown_high",
)


def level_drift(
    births: pa.Table,
    niches: Niches,
    *,
    l: int = 5,
    lineages: int = 100,
    min_births: int = _MIN_BIRTHS,
    draws: int = 5,
    seed: int = 0,
    like: DirichletPosterior | None = None,
) -> LevelDrift:
    """Compare the level by early births with that by late ones, cheaply.

    Parameters
    ----------
    births : pyarrow.Table
        Columns of :mod:`nichechain.births.table`.
    niches : Niches
    l, lineages : int
    min_births : int
        Niches with fewer births behind their row in either half are not compared.
    draws : int
        Posterior draws of T of each half, at least 2.
    seed : int
    like : DirichletPosterior, optional
        Of all births, ``chain.posterior``: how much each guess of the base counts, its strength and what
        lineages do are taken from there, so that either half differs in its births alone. By default
        they are fitted to each half, without what lineages do.

    Returns
    -------
    LevelDrift

    Raises
    ------
    NichechainError
        If an argument is out of range, births do not say their step, or fewer than 5 niches are
        observed in both halves.

    Notes
    -----
    T is estimated by empirical Bayes. With the few draws, the interval is the difference of the means of k
    draws each, ± Student's quantile of 2(k − 1) degrees of freedom times √((s₁² + s₂²)(1 + 1/k)): a mean
    over niches is nearly normal.
    """
    question = Question(l, lineages, draws=draws, seed=seed)
    check_at_least(2, draws=draws)
    halves, _ = _parts(births, niches, 2)
    compared = _observed(halves, min_births)
    early, late = (_levels(half, compared, question, number, like, 2) for number, half in enumerate(halves))
    difference = float(late.mean() - early.mean())
    spread = np.sqrt((early.var(ddof=1) + late.var(ddof=1)) * (1.0 + 1.0 / draws))
    width = float(stdtrit(2 * (draws - 1), 0.5 + _LEVEL / 2) * spread)
    return LevelDrift(
        float(early.mean()),
        float(late.mean()),
        difference - width,
        difference + width,
        (int(halves[0].births.sum()), int(halves[1].births.sum())),
        compared.size,
        l,
        lineages,
    )


def level_course(
    births: pa.Table,
    niches: Niches,
    *,
    parts: int = 4,
    l: int = 5,
    lineages: int = 100,
    min_births: int = _MIN_BIRTHS,
    draws: int = 8,
    seed: int = 0,
    like: DirichletPosterior | None = None,
) -> LevelCourse:
    """Level against steps, and against the number of births.

    Parameters
    ----------
    births, niches, l, lineages, seed, like
        As in :func:`level_drift`.
    parts : int
        Parts of equally many births, at least 2.
    min_births : int
        Niches with fewer births behind their row in any part are not compared.
    draws : int
        Posterior draws of T of each part, at least 2.

    Returns
    -------
    LevelCourse

    Raises
    ------
    NichechainError
        As in :func:`level_drift`.
    """
    question = Question(l, lineages, draws=draws, seed=seed)
    check_at_least(2, draws=draws, parts=parts)
    parts = int(parts)
    counts, steps = _parts(births, niches, parts)
    compared = _observed(counts, min_births)
    grown = [counts[0]]
    for some in counts[1:]:
        grown.append(grown[-1] + some)
    rows = []
    for number, (own, so_far) in enumerate(zip(counts, grown, strict=True)):
        levels = [
            _levels(some, compared, question, 2 * number + k, like, 2 * parts)
            for k, some in enumerate((own, so_far))
        ]
        rows.append([_interval(x) for x in levels])
    (level, low, high), (grown_level, grown_low, grown_high) = np.moveaxis(np.array(rows), 0, 2)
    return LevelCourse(
        steps[:, 0],
        steps[:, 1],
        np.array([int(some.births.sum()) for some in counts]),
        level,
        low,
        high,
        np.array([int(some.births.sum()) for some in grown]),
        grown_level,
        grown_low,
        grown_high,
        compared.size,
        l,
        lineages,
    )


def _interval(levels: Floats) -> tuple[float, float, float]:
    """Mean of a few draws and a 90 % interval."""
    size, mean = levels.size, float(levels.mean())
    width = stdtrit(size - 1, 0.5 + _LEVEL / 2) * levels.std(ddof=1) * np.sqrt(1.0 + 1.0 / size)
    return mean, mean - float(width), mean + float(width)


def _parts(births: pa.Table, niches: Niches, parts: int) -> tuple[list[TransitionCounts], Ints]:
    """Counts of equally many births each, in the order of steps, and their first and last step (P, 2).

    Those of unselected lineages are left out: parts are to differ by what the search did.
    """
    check_columns(births, *_COLUMNS)
    if LINEAGE in births.column_names:
        births = births.filter(pc.invert(births[LINEAGE].fill_null(False)))
    missing = births["step"].null_count
    if missing or not len(births):
        raise NichechainError(
            f"{missing} of {len(births)} births do not say their step: no early and late ones"
        )
    if parts > len(births):
        raise NichechainError(f"parts is {parts}, but there are only {len(births)} births")
    step = births["step"].to_numpy().astype(np.int64)
    part = np.empty(step.size, np.int64)
    part[np.argsort(step, kind="stable")] = np.arange(step.size) * parts // step.size
    counts = [counts_of(births.filter(pa.array(part == number)), niches) for number in range(parts)]
    inside = [step[part == number] for number in range(parts)]
    steps = [(some.min(initial=step.max()), some.max(initial=0)) for some in inside]
    return counts, np.array(steps)


def _observed(counts: list[TransitionCounts], min_births: int) -> Ints:
    """Niches with enough births behind their row in all parts."""
    check_at_least(0, min_births=min_births)
    n = len(counts[0].niches)
    enough = np.all([some.births[:n] >= max(1, min_births) for some in counts], axis=0)
    compared = np.flatnonzero(enough)
    if compared.size < _FEWEST_NICHES:
        raise NichechainError(
            f"{compared.size} niches have {min_births} births behind their row of T in each of {len(counts)} "
            f"parts of the births, but a level needs {_FEWEST_NICHES}: lower min_births or build further"
        )
    return compared


def _levels(
    counts: TransitionCounts,
    compared: Ints,
    question: Question,
    number: int,
    like: DirichletPosterior | None,
    levels: int,
) -> Floats:
    """Mean l-evolvability over niches, by each draw of T, (draws,): of so many levels that of this number."""
    if not (like is None or isinstance(like, DirichletPosterior)):
        raise NichechainError(f"like is {shown(like)}, but must be a posterior for T, or None")
    known = None if like is None else like.prior
    prior = fit_prior(counts) if known is None else fit_prior(counts, known.strength, known.weights)
    posterior = DirichletPosterior.of(counts, prior)
    if like is not None and like.law is not None:
        # What is not known of the law is the same for all parts, so that none of it tells them apart.
        posterior = replace(posterior, law=like.law.taken_as_known())
    chain = with_posterior(counts, posterior, "early or late")
    if number == 0:
        replace(question, method="exact").warn_if_long(chain, samples=levels * question.draws)
    # Draws of their own: parts must not agree for having been drawn alike.
    seed = int(keyed(question.seed, Purpose.RESAMPLING, number).integers(2**31))
    question = replace(question, seed=seed)

    def mean(number: int) -> float:
        drawn = question.sample(chain, number)
        first = drawn.children(compared)
        covered = expected_coverage(
            drawn.onward, first, question.l, question.lineages, counted=len(counts.niches)
        )
        return float(covered.mean())

    return np.array(side_by_side(mean, range(question.draws)))
