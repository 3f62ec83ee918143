"""Tests of the experiments: SciPy's and scikit-posthocs', each with n, an effect size and its interval."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_floats, check_at_least, shown
from nichechain.core.errors import NichechainError
from nichechain.core.intervals import LEVEL
from nichechain.core.randomness import Purpose, keyed
from nichechain.core.ranks import EXACT_BELOW, rank_correlation
from nichechain.studies.permutations import PERMUTATIONS, permutation_p
from nichechain.studies.results import Effect, GroupTest, HypothesisTest, Interval, Pair

Floats = NDArray[np.float64]
Statistic = Callable[..., Any]

RESAMPLES = 1999
"""Resamples of every bootstrap."""

# More would be told from no others, and take hours.
_MOST_RESAMPLES = 1_000_000
# Resamples in memory at a time.
_AT_ONCE = 2000


def pressure_test(
    pressure: ArrayLike, values: ArrayLike, *, seed: int = 0, resamples: int = RESAMPLES
) -> HypothesisTest:
    """Spearman's rank correlation between evolutionary pressure, or any other level, and a measure.

    Parameters
    ----------
    pressure : (N,) array
        Level of each run, such as 1 minus the share of the offspring that its selection lets pass:
        r is above 0 where more pressure goes with larger values, the paper's sign
        ("Evolutionary pressure").
    values : (N,) array
        Measure of each run.
    seed : int
        Of the bootstrap, which draws runs with replacement within each level.
    resamples : int

    Raises
    ------
    NichechainError
        If the shapes differ, there are fewer than 3 runs, a number is not finite or all are alike.
    """
    from scipy import stats

    level, value = _finite("pressure", pressure), _finite("values", values)
    if level.shape != value.shape:
        raise NichechainError(
            f"pressure and values have shapes {level.shape} and {value.shape}, but must be one number per run"
        )
    if value.size < 3:
        raise NichechainError(f"there are {value.size} runs, but a rank correlation needs at least 3")
    for name, numbers in (("pressure", level), ("values", value)):
        if np.ptp(numbers) == 0:
            raise NichechainError(
                f"{name} are all {numbers[0]:g}, but a rank correlation needs two that differ"
            )
    rho, p = rank_correlation(level, value)
    levels, place = np.unique(level, return_inverse=True)
    groups = [value[place == k] for k in range(len(levels))]

    def correlation(*resampled: Floats, axis: int) -> Any:
        sizes = [group.shape[axis] for group in resampled]
        ranks = stats.rankdata(np.concatenate(resampled, axis=axis), axis=axis)
        return stats.pearsonr(np.repeat(stats.rankdata(levels), sizes), ranks, axis=axis).statistic

    interval = _interval(groups, correlation, "within levels", seed, resamples)
    return HypothesisTest(
        name="Spearman's rank correlation",
        symbol="r",
        statistic=rho,
        p=p,
        n=value.size,
        effect=Effect("Spearman's r", rho, interval),
    )


def metric_test(groups: Mapping[str, ArrayLike], *, seed: int = 0, resamples: int = RESAMPLES) -> GroupTest:
    """Kruskal-Wallis test between independent groups, then Conover's of each pair with Holm's adjustment.

    Of fewer than 10 runs in all p is that of permutations, and pairs have Mann-Whitney tests instead.

    Parameters
    ----------
    groups : mapping of str to (N,) array
        Values of the runs of each group, at least 2 groups of at least 2 runs.
    seed : int
        Of the bootstrap, which draws runs with replacement within each group.
    resamples : int

    Returns
    -------
    GroupTest
        With ε² = H / (n − 1), the share of the variance of ranks that lies between groups, which
        is never below 0 and whose interval therefore cannot reach below it; of pairs with Cliff's δ,
        the share of pairs of runs in which the first is larger minus that in which the second is.

    Raises
    ------
    NichechainError
        If there are too few groups or runs, a number is not finite or all are alike.
    """
    import scikit_posthocs
    from scipy import stats

    values = _groups(groups)
    names, arrays = list(values), list(values.values())
    n = sum(map(len, arrays))
    found = stats.kruskal(*arrays)
    if n < EXACT_BELOW:
        overall = permutation_p(arrays, stats.kruskal, "independent", seed)
        name = "Mann-Whitney test"
        every = stats.PermutationMethod(n_resamples=PERMUTATIONS, rng=keyed(seed, Purpose.PERMUTATION, 1))
        p = _of_pairs(arrays, lambda a, b: stats.mannwhitneyu(a, b, method=every))
    else:
        overall, name = float(found.pvalue), "Conover's test"
        # Numbers, not names, as scikit-posthocs sorts them.
        p = scikit_posthocs.posthoc_conover(arrays, p_adjust="holm").to_numpy()
    ranks = np.split(stats.rankdata(np.concatenate(arrays)), np.cumsum([len(a) for a in arrays])[:-1])

    def epsilon_squared(*resampled: Floats, axis: int) -> Any:
        size = sum(group.shape[axis] for group in resampled)
        return stats.kruskal(*resampled, axis=axis).statistic / (size - 1)

    def cliff(first: Floats, second: Floats, axis: int) -> Any:
        u = stats.mannwhitneyu(first, second, axis=axis, method="asymptotic").statistic
        return 2 * u / (first.shape[axis] * second.shape[axis]) - 1

    def pair(i: int, j: int) -> Pair:
        interval = _interval([arrays[i], arrays[j]], cliff, "within groups", seed, resamples)
        effect = Effect("Cliff's δ", float(cliff(arrays[i], arrays[j], -1)), interval)
        return Pair(names[i], names[j], float(p[i, j]), effect)

    interval = _interval(arrays, epsilon_squared, "within groups", seed, resamples)
    effect = Effect("ε²", float(found.statistic) / (n - 1), interval)
    return GroupTest(
        HypothesisTest("Kruskal-Wallis test", "H", float(found.statistic), overall, n, effect),
        f"{name}, p adjusted by Holm's method",
        {name: float(rank.mean()) for name, rank in zip(names, ranks, strict=True)},
        tuple(pair(i, j) for i, j in combinations(range(len(names)), 2)),
    )


def paired_test(groups: Mapping[str, ArrayLike], *, seed: int = 0, resamples: int = RESAMPLES) -> GroupTest:
    """Friedman's test between groups whose runs share their starts, then Conover's test of each pair.

    Between two groups it is Wilcoxon's signed-rank test of the differences. Of fewer than 10 runs p is
    that of permutations within runs, and pairs have Wilcoxon's test as well.

    Parameters
    ----------
    groups : mapping of str to (N,) array
        Values of the same N runs in each group, at least 2 groups of at least 2 runs.
    seed : int
        Of the bootstrap, which draws runs with replacement, each with its values in all groups.
    resamples : int

    Returns
    -------
    GroupTest
        With Kendall's W = χ² / (N·(k − 1)), the agreement of the runs on the order of the k groups; of
        pairs with the share of runs in which the first is larger minus that in which the second is.
        Ranks are within runs.

    Raises
    ------
    NichechainError
        If there are too few groups or runs, their numbers differ, a number is not finite or all
        groups are alike.
    """
    import scikit_posthocs
    from scipy import stats

    values = _groups(groups)
    names, arrays = list(values), list(values.values())
    sizes = {len(array) for array in arrays}
    if len(sizes) > 1:
        raise NichechainError(
            f"groups have {_listed(sorted(sizes))} runs, but a paired test needs the same of each"
        )
    table = np.column_stack(arrays)
    if (np.ptp(table, axis=1) == 0).all():
        raise NichechainError("the groups are alike in every run, so there is nothing to test")
    n, k = table.shape

    def kendall(*resampled: Floats, axis: int) -> Any:
        return stats.friedmanchisquare(*resampled, axis=axis).statistic / (resampled[0].shape[axis] * (k - 1))

    def dominance(first: Floats, second: Floats, axis: int) -> Any:
        return np.sign(first - second).mean(axis=axis)

    def pair(i: int, j: int, p: float) -> Pair:
        interval = _interval([arrays[i], arrays[j]], dominance, "of runs", seed, resamples, paired=True)
        effect = Effect(
            "share larger minus share smaller", float(dominance(arrays[i], arrays[j], -1)), interval
        )
        return Pair(names[i], names[j], float(p), effect)

    mean_ranks = dict(zip(names, stats.rankdata(table, axis=1).mean(axis=0).tolist(), strict=True))
    if k == 2:
        found = stats.wilcoxon(*arrays)
        name = "Wilcoxon's signed-rank test"
        only = pair(0, 1, found.pvalue)
        test = HypothesisTest(name, "W", float(found.statistic), only.p, n, only.effect)
        return GroupTest(test, name, mean_ranks, (only,))
    found = stats.friedmanchisquare(*arrays)
    interval = _interval(arrays, kendall, "of runs", seed, resamples, paired=True)
    effect = Effect("Kendall's W", float(found.statistic) / (n * (k - 1)), interval)
    if n < EXACT_BELOW:
        overall = permutation_p(arrays, stats.friedmanchisquare, "samples", seed)
        name = "Wilcoxon's signed-rank test"
        p = _of_pairs(arrays, stats.wilcoxon)
    else:
        overall, name = float(found.pvalue), "Conover's test after Friedman's"
        with warnings.catch_warnings():
            # Where all runs agree on the order, the test's denominator is 0 and p is 0.
            warnings.simplefilter("ignore", RuntimeWarning)
            p = scikit_posthocs.posthoc_conover_friedman(table, p_adjust="holm").to_numpy()
    return GroupTest(
        HypothesisTest("Friedman's test", "χ²", float(found.statistic), overall, n, effect),
        f"{name}, p adjusted by Holm's method",
        mean_ranks,
        tuple(pair(i, j, p[i, j]) for i, j in combinations(range(k), 2)),
    )


def change_test(before: ArrayLike, after: ArrayLike) -> HypothesisTest:
    """Paired t-test of a change within runs, whose mean has a t-interval as the figures' bands have.

    Parameters
    ----------
    before, after : (N,) arrays
        Of the same runs, at least 2.

    Raises
    ------
    NichechainError
        If the shapes differ, there are too few runs, a number is not finite or no run differs from
        another.
    """
    from scipy import stats

    first, last = _finite("before", before), _finite("after", after)
    if first.shape != last.shape:
        raise NichechainError(
            f"before and after have shapes {first.shape} and {last.shape}, but must be of the same runs"
        )
    difference = last - first
    if difference.size < 2:
        raise NichechainError(f"there are {difference.size} runs, but a change needs at least 2")
    if np.ptp(difference) == 0:
        raise NichechainError(f"every run changes by {difference[0]:g}, so the change has no spread")
    found = stats.ttest_rel(last, first)
    bounds = found.confidence_interval(LEVEL)
    interval = Interval(float(bounds.low), float(bounds.high), LEVEL, "t-interval of the mean over runs")
    return HypothesisTest(
        name="paired t-test",
        symbol="t",
        statistic=float(found.statistic),
        p=float(found.pvalue),
        n=difference.size,
        effect=Effect("mean change", float(difference.mean()), interval),
    )


def signed_rank_test(
    values: ArrayLike, name: str, *, seed: int = 0, resamples: int = RESAMPLES
) -> HypothesisTest:
    """Wilcoxon's signed-rank test of whether numbers, one per run, lie about 0.

    Parameters
    ----------
    values : (N,) array
        At least 2.
    name : str
        What their median is called.
    seed : int
        Of the bootstrap over runs.
    resamples : int

    Raises
    ------
    NichechainError
        If there are too few runs, a number is not finite or all are 0.
    """
    from scipy import stats

    number = _finite("values", values)
    if number.size < 2:
        raise NichechainError(f"there are {number.size} runs, but a signed-rank test needs at least 2")
    if not number.any():
        raise NichechainError("every run has 0, so there is nothing to test")
    found = stats.wilcoxon(number)
    return HypothesisTest(
        name="Wilcoxon's signed-rank test",
        symbol="W",
        statistic=float(found.statistic),
        p=float(found.pvalue),
        n=number.size,
        effect=Effect(
            name, float(np.median(number)), _interval([number], np.median, "of runs", seed, resamples)
        ),
    )


def _of_pairs(arrays: Sequence[Floats], test: Callable[[Floats, Floats], Any]) -> Floats:
    """Of each pair of groups, p adjusted by Holm's method; 1 of groups that are alike."""
    pairs = list(combinations(range(len(arrays)), 2))
    alike = [np.array_equal(arrays[i], arrays[j]) for i, j in pairs]
    found = [
        1.0 if same else float(test(arrays[i], arrays[j]).pvalue)
        for (i, j), same in zip(pairs, alike, strict=True)
    ]
    p = np.ones((len(arrays), len(arrays)))
    for (i, j), adjusted in zip(pairs, adjust(found), strict=True):
        p[i, j] = p[j, i] = adjusted
    return p


def adjust(p: Sequence[float]) -> list[float]:
    """p-values adjusted for their number by Holm's method."""
    from statsmodels.stats.multitest import multipletests

    return [float(value) for value in multipletests(p, method="holm")[1]] if len(p) else []


def _interval(
    samples: Sequence[Floats],
    statistic: Statistic,
    drawn: str,
    seed: int,
    resamples: int,
    *,
    paired: bool = False,
) -> Interval | None:
    """BCa bootstrap interval, or the percentile interval where BCa is undefined."""
    from scipy import stats

    check_at_least(1, resamples=resamples)
    if resamples > _MOST_RESAMPLES:
        raise NichechainError(f"resamples is {resamples}, but must be at most {_MOST_RESAMPLES}")
    # A level with one run cannot be jackknifed, and a bootstrap would repeat that run for ever.
    if min(map(len, samples)) < 2:
        return None
    value = float(statistic(*samples, axis=-1))
    for method in ("BCa", "percentile"):
        with warnings.catch_warnings():
            # Resamples of equal values have no correlation, and degenerate ones no BCa interval.
            warnings.simplefilter("ignore")
            found = stats.bootstrap(
                samples,
                statistic,
                paired=paired,
                vectorized=True,
                n_resamples=resamples,
                batch=_AT_ONCE,
                confidence_level=LEVEL,
                method=method,
                rng=keyed(seed, Purpose.RESAMPLING),
            ).confidence_interval
        # Of groups that do not overlap, all resamples are alike: no interval is better than a false point.
        if found.low <= value <= found.high and found.low < found.high:
            said = f"{method} bootstrap {drawn}, {resamples} resamples"
            return Interval(float(found.low), float(found.high), LEVEL, said)
    return None


def _finite(name: str, values: ArrayLike) -> Floats:
    array = as_floats(name, values)
    if array.ndim != 1:
        raise NichechainError(f"{name} have shape {array.shape}, but must be one number per run")
    if not np.isfinite(array).all():
        raise NichechainError(f"{name} have {(~np.isfinite(array)).sum()} numbers that are not finite")
    return array


def _groups(groups: Mapping[str, ArrayLike]) -> dict[str, Floats]:
    if not isinstance(groups, Mapping):
        raise NichechainError(f"groups is {shown(groups)}, but must map names to values")
    values = {name: _finite(f"values of {name!r}", group) for name, group in groups.items()}
    if len(values) < 2:
        raise NichechainError(f"there are {len(values)} groups, but a comparison needs at least 2")
    for name, group in values.items():
        if group.size < 2:
            raise NichechainError(f"group {name!r} has {group.size} runs, but at least 2 are needed")
    if np.ptp(np.concatenate(list(values.values()))) == 0:
        raise NichechainError("all values of all groups are alike, so there is nothing to test")
    return values


def _listed(numbers: Sequence[int]) -> str:
    return " and ".join(map(str, numbers))
