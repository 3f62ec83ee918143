"""How many births are enough: whether fewer of them would have ranked niches the same way."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from nichechain.births.families import elites_of, tabulated
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.estimators import Estimator, estimate
from nichechain.chain.families import orphans_of
from nichechain.core.checks import as_floats, check_at_least, check_choice
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.niches import answer_for_niches
from nichechain.evolvability.question import Question
from nichechain.execution.side_by_side import side_by_side

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Thin = Literal["elite", "birth"]

FRACTIONS = (0.1, 0.25, 0.5, 0.75, 0.9)
ENOUGH = 0.9
"""Rankings that correlate at least so much are called alike."""
_FEWEST_NICHES = 5


@dataclass(frozen=True)
class RankStability:
    """Agreement of rankings of niches by births thinned to a part, and by all.

    Parameters
    ----------
    fractions : (F,) float64 array
        Parts of the births, increasing.
    births : (F,) float64 array
        Births that the parts have on average.
    spearman : (F, R) float64 array
        Rank correlation of niche l-evolvability with that from all births, per repeat.
    level : (F, R) float64 array
        Mean l-evolvability over the niches compared, in niches, by each part.
    all_level : float
        The same by all births.
    halves : (R,) float64 array
        Rank correlation between two halves that share no birth.
    niches : int
        Niches compared: those with at least ``min_births`` births behind their row of all.
    all_births : int
        Births with a parent.
    thin : str
        Whether whole elites, with all their children, or single births were left out.
    min_births, l, lineages : int
    estimator : str
    """

    fractions: Floats
    births: Floats
    spearman: Floats
    level: Floats
    all_level: float
    halves: Floats
    niches: int
    all_births: int
    thin: str
    min_births: int
    l: int
    lineages: int
    estimator: str

    @property
    def enough(self) -> float | None:
        """Smallest part from which on every mean correlation is at least :data:`ENOUGH`."""
        below = np.flatnonzero(self.spearman.mean(axis=1) < ENOUGH)
        first = 0 if not below.size else int(below[-1]) + 1
        return None if first == self.fractions.size else float(self.fractions[first])

    @property
    def answer(self) -> str:
        """Whether there are enough births, in plain words."""
        halves = float(self.halves.mean())
        # Spearman-Brown: what two sets of all births, not of half, would agree to.
        again = 2.0 * halves / (1.0 + halves) if halves > 0 else 0.0
        repeated = (
            f"Two halves that share no birth agree to {halves:.2f}; two searches of {self.all_births} "
            f"births each can be expected to agree to about {again:.2f}."
        )
        if self.enough is None:
            last = self.fractions[-1]
            return (
                f"Too few births: even {last:.0%} of them rank the niches only to a correlation of "
                f"{self.spearman[-1].mean():.2f} as all do, so more would change it again. {repeated}"
            )
        at = int(np.flatnonzero(self.fractions == self.enough)[0])
        enough = (
            f"{self.enough:.0%} of the births ({self.births[at]:.0f}) rank the niches nearly as all "
            f"{self.all_births} do (correlation {self.spearman[at].mean():.2f})."
        )
        if again < ENOUGH:
            return f"{enough} Yet births are not enough: {repeated[0].lower()}{repeated[1:]}"
        return f"{enough} {repeated}"

    def to_frame(self) -> pd.DataFrame:
        """One row per part: fraction, births, mean, smallest and largest correlation, mean level."""
        import pandas as pd

        return pd.DataFrame(
            {
                "fraction": self.fractions,
                "births": self.births,
                "spearman": self.spearman.mean(axis=1),
                "lowest": self.spearman.min(axis=1),
                "highest": self.spearman.max(axis=1),
                "level": self.level.mean(axis=1),
            }
        )


def rank_stability(
    counts: TransitionCounts,
    *,
    fractions: Sequence[float] = FRACTIONS,
    thin: Thin = "elite",
    repeats: int = 3,
    min_births: int = 20,
    l: int = 5,
    lineages: int = 100,
    estimator: Estimator = "empirical-bayes",
    draws: int = 20,
    seed: int = 0,
    on_done: Callable[[int], None] | None = None,
) -> RankStability:
    """Thin the births, rank the niches again, and see how far the ranking moved.

    Parameters
    ----------
    counts : TransitionCounts
    fractions : sequence of float
        Parts to thin to, between 0 and 1.
    thin : {"elite", "birth"}
        Leave out whole elites with all their children, as a search that met fewer of them would
        have, or single births. Births that do not say whose they are go one by one.
    repeats : int
        How often to thin to each part, at least 1.
    min_births : int
        Niches with fewer births behind their row are not ranked.
    l, lineages, draws
        As in :func:`nichechain.niche_evolvability`.
    estimator : {"empirical-bayes", "dirichlet", "mle"}
    seed : int
        Of thinning and draws.
    on_done : callable, optional
        Told how many more rankings are done, of ``1 + repeats * (2 + F)``.

    Returns
    -------
    RankStability

    Raises
    ------
    NichechainError
        If an argument is out of range or fewer than 5 niches can be ranked.

    Notes
    -----
    Thinned births are part of all births, so the curve ends at 1 whatever they say: it tells what
    leaving some out would have changed, not how far all of them are from the truth. The halves,
    which share nothing, tell more of that (Spearman 1910, Brown 1910).
    """
    parts = np.sort(np.atleast_1d(as_floats("fractions", fractions)), axis=None)
    if not parts.size or not ((parts > 0) & (parts < 1)).all():
        raise NichechainError(f"fractions are {tuple(parts.tolist())}, but must be between 0 and 1")
    check_choice("thin", thin, get_args(Thin))
    question = Question(l, lineages, draws=draws, seed=seed)
    check_at_least(1, repeats=repeats)
    check_at_least(0, min_births=min_births)
    ranked = np.flatnonzero(counts.births[: len(counts.niches)] >= min_births)
    if ranked.size < _FEWEST_NICHES:
        raise NichechainError(
            f"{ranked.size} niches have {min_births} births behind their row of T, but a ranking needs "
            f"{_FEWEST_NICHES}: lower min_births or build further"
        )

    kept = [counts]
    for repeat in range(repeats):
        rank = _Thinner(counts, thin, keyed(seed, Purpose.THINNING, repeat))
        kept += [rank.part(0.0, 0.5), rank.part(0.5, 1.0), *(rank.part(0.0, part) for part in parts)]
    whole = estimate(counts, estimator)
    question.warn_if_long(whole, ranked.size, len(kept) * question.number_of_samples(whole))

    def scores(some: TransitionCounts, number: int) -> Floats:
        chain = whole if some is counts else estimate(some, estimator)
        # Draws of their own, so that rankings do not agree for having been drawn alike.
        own = replace(question, seed=seed + number)
        return answer_for_niches(chain, own, roots=ranked, announced=True).value[ranked]

    full, *found = side_by_side(lambda number: scores(kept[number], number), range(len(kept)), on_done)
    each = parts.size + 2
    halves = np.array([_agreement(*found[each * repeat :][:2]) for repeat in range(repeats)])
    # Halves left out, parts by repeats.
    thinned = [[each * repeat + 2 + part for repeat in range(repeats)] for part in range(parts.size)]
    births = np.array([[kept[1 + number].births.sum() for number in row] for row in thinned], np.float64)
    spearman = np.array([[_agreement(full, found[number]) for number in row] for row in thinned])
    level = np.array([[found[number].mean() for number in row] for row in thinned])
    return RankStability(
        parts,
        births.mean(axis=1),
        spearman,
        level,
        float(full.mean()),
        halves,
        ranked.size,
        int(counts.births.sum()),
        thin,
        min_births,
        l,
        lineages,
        estimator,
    )


class _Thinner:
    """Elites, or births, in a random order: a larger part contains the smaller ones."""

    def __init__(self, counts: TransitionCounts, thin: str, rng: np.random.Generator) -> None:
        self._counts = counts
        *states, number = orphans_of(counts)
        parent, child = (np.repeat(axis, number) for axis in states)
        families, size = counts.families, counts.families[:, 3]
        if thin == "elite":
            elite = elites_of(families)
            place = rng.random(elite.max(initial=-1) + 1)[elite]
            one = size
        else:
            families = np.repeat(families, size, axis=0)
            place, one = rng.random(len(families)), np.ones(len(families), np.int64)
        self._parent = np.concatenate([families[:, 0], parent])
        self._child = np.concatenate([families[:, 2], child])
        self._elite = np.concatenate([families[:, 1], np.full(parent.size, -1)])
        self._size = np.concatenate([one, np.ones_like(parent)])
        self._place = np.concatenate([place, rng.random(parent.size)])

    def part(self, start: float, end: float) -> TransitionCounts:
        """Counts of what lies between two places of the order."""
        kept = (self._place >= start) & (self._place < end)
        parent, elite, child, size = (
            column[kept] for column in (self._parent, self._elite, self._child, self._size)
        )
        own = elite >= 0
        counts = TransitionCounts.from_pairs(parent, child, self._counts.niches, size)
        return replace(counts, families=tabulated(parent[own], elite[own], child[own], size[own]))


def _agreement(first: Floats, second: Floats) -> float:
    """Spearman's rank correlation; 0 where one side ranks nothing above anything."""
    if np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0
    from scipy.stats import spearmanr

    return float(spearmanr(first, second).statistic)
