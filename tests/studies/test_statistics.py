import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from nichechain.core.errors import NichechainError
from nichechain.core.intervals import mean_interval
from nichechain.studies.dissimila import study_dissimila
from nichechain.studies.statistics import (
    adjust,
    change_test,
    metric_test,
    paired_test,
    pressure_test,
    signed_rank_test,
)

FEW = 199


def test_correlation_of_untied_ranks_has_a_closed_form():
    values = np.random.default_rng(3).permutation(20)
    found = pressure_test(np.arange(20), values, resamples=FEW)
    r = 1 - 6 * ((np.arange(20) - values) ** 2).sum() / (20 * (20**2 - 1))
    t = r * np.sqrt(18 / (1 - r**2))
    assert found.statistic == pytest.approx(r)
    assert found.p == pytest.approx(2 * stats.t.sf(abs(t), 18))
    assert found.n == 20
    # Every level has one run only, so there is nothing to draw within it.
    assert found.effect.interval is None


def test_more_pressure_and_larger_values_is_above_0():
    level = np.repeat([0.0, 0.5, 1.0], 8)
    noise = np.random.default_rng(0).normal(size=24)
    found = pressure_test(level, 3 * level + noise, resamples=FEW)
    interval = found.effect.interval
    assert 0 < interval.low < found.statistic < interval.high < 1
    assert pressure_test(-level, 3 * level + noise, resamples=FEW).statistic == -found.statistic


def test_a_bootstrap_is_its_seed():
    level, values = np.repeat([0, 1], 10), np.random.default_rng(0).normal(size=20)
    a, b, c = (pressure_test(level, values, seed=s, resamples=FEW).effect.interval for s in (0, 0, 1))
    assert a == b != c


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(-50, 50), min_size=6, max_size=20).filter(lambda v: len(set(v)) > 1))
def test_a_rank_test_sees_only_the_order(values):
    level = np.arange(len(values)) // 2
    value = np.array(values, float)
    one = pressure_test(level, value, resamples=FEW)
    other = pressure_test(2 * level + 1, np.exp(value / 10), resamples=FEW)
    assert (one.statistic, one.p) == pytest.approx((other.statistic, other.p))


@pytest.fixture(scope="module")
def independent():
    rng = np.random.default_rng(5)
    return {"b": rng.normal(1.2, 1, 9), "a": rng.normal(0, 1, 7), "c": rng.normal(0.3, 1, 8)}


def test_kruskal_wallis_and_conover_have_closed_forms(independent):
    found = metric_test(independent, resamples=FEW)
    ranks = stats.rankdata(np.concatenate(list(independent.values())))
    parts = dict(zip(independent, np.split(ranks, [9, 16]), strict=True))
    n, k = 24, 3
    h = 12 / (n * (n + 1)) * sum(r.sum() ** 2 / r.size for r in parts.values()) - 3 * (n + 1)
    assert found.test.statistic == pytest.approx(h)
    assert found.test.p == pytest.approx(stats.chi2.sf(h, k - 1))
    assert found.test.effect.value == pytest.approx(h / (n - 1))
    assert found.mean_ranks == pytest.approx({name: r.mean() for name, r in parts.items()})
    error = n * (n + 1) / 12 * (n - 1 - h) / (n - k)
    raw = [
        2
        * stats.t.sf(
            abs(parts[p.first].mean() - parts[p.second].mean())
            / np.sqrt(error * (1 / parts[p.first].size + 1 / parts[p.second].size)),
            n - k,
        )
        for p in found.pairs
    ]
    holm = np.empty(3)
    order = np.argsort(raw)
    holm[order] = np.minimum(1, np.maximum.accumulate(np.array(raw)[order] * [3, 2, 1]))
    assert [p.p for p in found.pairs] == pytest.approx(holm)
    assert adjust(raw) == pytest.approx(holm)


def test_cliffs_delta_is_the_share_larger_less_the_share_smaller(independent):
    for pair in metric_test(independent, resamples=FEW).pairs:
        first, second = independent[pair.first], independent[pair.second]
        assert pair.effect.value == pytest.approx(np.sign(first[:, None] - second).mean())
        assert pair.effect.interval.low <= pair.effect.value <= pair.effect.interval.high


def test_groups_that_do_not_overlap_have_no_false_interval():
    found = metric_test({"low": np.arange(8.0), "high": np.arange(8.0) + 20}, resamples=FEW)
    (pair,) = found.pairs
    assert pair.effect.value == -1
    assert pair.effect.interval is None


def test_friedman_has_a_closed_form():
    table = np.random.default_rng(2).normal(size=(10, 4)) + np.array([0, 0, 0.5, 1])
    found = paired_test(dict(zip("abcd", table.T, strict=True)), resamples=FEW)
    ranks = table.argsort(axis=1).argsort(axis=1) + 1
    chi = 12 / (10 * 4 * 5) * (ranks.sum(axis=0) ** 2).sum() - 3 * 10 * 5
    assert found.test.statistic == pytest.approx(chi)
    assert found.test.p == pytest.approx(stats.chi2.sf(chi, 3))
    assert found.test.effect.value == pytest.approx(chi / 30)
    assert list(found.mean_ranks.values()) == pytest.approx(ranks.mean(axis=0))
    assert found.test.n == 10


def test_runs_that_all_agree_have_a_concordance_of_1():
    base = np.random.default_rng(0).normal(size=6)
    found = paired_test({"a": base, "b": base + 1, "c": base + 2}, resamples=FEW)
    assert found.test.effect.value == pytest.approx(1)
    assert all(pair.effect.value == -1 for pair in found.pairs)
    # Of 2**6 signs two are as one-sided, and Holm's method multiplies the smallest of three by 3.
    assert [pair.p for pair in found.pairs] == pytest.approx([3 * 2 / 64] * 3)
    # All runs agree in 6 of the 6**6 ways of ordering three groups six times.
    assert found.test.p < 0.001


def test_a_handful_of_runs_is_judged_by_all_permutations():
    assert pressure_test([0, 1, 2], [5, 6, 9], resamples=FEW).p == pytest.approx(2 / 6)
    assert pressure_test([0, 1, 2, 3], [9, 6, 5, 1], resamples=FEW).p == pytest.approx(2 / 24)
    # Three of six are the smallest in 2 of 20 ways.
    found = metric_test({"a": [1, 2, 3], "b": [4, 5, 6]}, resamples=FEW)
    assert found.test.p == found.pairs[0].p == pytest.approx(2 / 20)
    # Three groups in the same order in 2 runs of 2: 6 of 36 ways.
    found = paired_test({"a": [1, 2], "b": [3, 4], "c": [5, 6]}, resamples=FEW)
    assert found.test.p == pytest.approx(6 / 36)


def test_paired_runs_are_compared_within_themselves():
    """Starts that differ far more than conditions hide a difference from a test that is not paired."""
    start = 100 * np.arange(10.0)
    groups = {"a": start, "b": start + 1, "c": start + 2}
    assert paired_test(groups, resamples=FEW).test.p < 1e-4
    assert metric_test(groups, resamples=FEW).test.p > 0.8


def test_two_paired_groups_are_wilcoxons():
    first = np.arange(1.0, 7.0)
    found = paired_test({"a": first, "b": first - [1, 2, 3, 4, 5, 6]}, resamples=FEW)
    # All six differences have one sign: 2 of 2**6 equally likely signs are as extreme.
    assert found.test.p == found.pairs[0].p == pytest.approx(2 / 64)
    assert found.test.effect.value == 1


def test_change_has_the_t_interval_of_the_mean():
    before, after = np.random.default_rng(1).normal(size=(2, 12))
    found = change_test(before, after)
    difference = after - before
    error = difference.std(ddof=1) / np.sqrt(12)
    half = stats.t.ppf(0.975, 11) * error
    assert found.effect.value == pytest.approx(difference.mean())
    assert found.effect.interval.low == pytest.approx(difference.mean() - half)
    assert found.effect.interval.high == pytest.approx(difference.mean() + half)
    assert found.statistic == pytest.approx(difference.mean() / error)


def test_signed_ranks_of_one_sign():
    found = signed_rank_test([1, 2, 3, 4], "median", resamples=FEW)
    assert found.p == pytest.approx(2 / 16)
    assert found.effect.value == 2.5


def test_mean_interval_leaves_out_what_is_missing():
    values = np.array([[1.0, 1.0, np.nan], [3.0, np.nan, np.nan], [8.0, np.nan, np.nan]])
    mean, low, high = mean_interval(values)
    half = stats.t.ppf(0.975, 2) * values[:, 0].std(ddof=1) / np.sqrt(3)
    np.testing.assert_allclose(mean, [4, 1, np.nan])
    np.testing.assert_allclose(low, [4 - half, np.nan, np.nan])
    np.testing.assert_allclose(high, [4 + half, np.nan, np.nan])


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: pressure_test([1, 2], [1, 2]), "2 runs"),
        (lambda: pressure_test([1, 2, 3], [1, 2]), "shapes"),
        (lambda: pressure_test([1, 1, 1], [1, 2, 3]), "pressure are all 1"),
        (lambda: pressure_test([1, 2, 3], [4, 4, 4]), "values are all 4"),
        (lambda: pressure_test([1, 2, 3], [1, np.nan, 3]), "1 numbers that are not finite"),
        (lambda: pressure_test([[1, 2, 3]], [1, 2, 3]), "one number per run"),
        (lambda: metric_test({}), "0 groups"),
        (lambda: metric_test({"a": [1, 2]}), "1 groups"),
        (lambda: metric_test({"a": [1, 2], "b": [3]}), "'b' has 1 runs"),
        (lambda: metric_test({"a": [1, 1], "b": [1, 1]}), "alike"),
        (lambda: metric_test({"a": [1, 1], "b": [1, np.inf]}), "'b'.*not finite"),
        (lambda: paired_test({"a": [1, 2], "b": [1, 2, 3]}), "2 and 3 runs"),
        (lambda: paired_test({"a": [1, 2], "b": [1, 2]}), "alike in every run"),
        (lambda: change_test([1], [2]), "1 runs"),
        (lambda: change_test([1, 2], [2, 3]), "every run changes by 1"),
        (lambda: change_test([1, 2], [2, 3, 4]), "same runs"),
        (lambda: signed_rank_test([1], "m"), "1 runs"),
        (lambda: signed_rank_test([0, 0], "m"), "every run has 0"),
    ],
)
def test_what_cannot_be_tested_is_said(call, said):
    with pytest.raises(NichechainError, match=said):
        call()


def walks(follow, runs=12, steps=60, neutral=0, seed=0):
    """Walks whose η* follows r* of five steps before by ``follow`` (log r*, noise)."""
    rng = np.random.default_rng(seed)
    ratio = rng.normal(0, 0.3, (runs, steps))
    log = rng.normal(0, 0.3, (runs, steps))
    log[:, 5:] = follow(ratio[:, :-5], log[:, 5:])
    evolvability = np.exp(log)
    sensitivity = evolvability / np.exp(ratio)
    sensitivity[:, :neutral] = 0.0
    run, step = np.indices((runs, steps))
    columns = {
        "run": run,
        "step": step,
        "expected_evolvability": evolvability,
        "expected_local_sensitivity": sensitivity,
        "behavior_0": rng.normal(size=(runs, steps)),
        "behavior_1": rng.normal(size=(runs, steps)),
    }
    return pd.DataFrame({name: column.ravel() for name, column in columns.items()}).assign(condition="x")


@pytest.mark.parametrize("sign", [1, -1])
def test_points_that_hold_walks_back_are_found(sign):
    found = study_dissimila(walks(lambda ratio, noise: sign * ratio + noise), ["x"], resamples=FEW)
    relation = {r.outcome: r for r in found.relations if r.condition == "x"}
    for outcome in ("later", "gain"):
        assert sign * relation[outcome].test.effect.value > 0.3
        assert relation[outcome].adjusted < 0.01
    assert abs(relation["moved"].test.effect.value) < 0.2


def test_points_that_lead_nowhere_are_not_blamed():
    """Under no relation, rejections at 5 % stay about as rare."""
    p = [
        r.test.p
        for seed in range(15)
        for r in study_dissimila(
            walks(lambda _, noise: noise, 8, 40, seed=seed), ["x"], resamples=19
        ).relations
        if r.condition is None
    ]
    assert (np.array(p) < 0.05).mean() < 0.15


def test_neutral_points_are_counted_and_left_out():
    records = walks(lambda ratio, noise: ratio + noise, runs=4, steps=30, neutral=3)
    found = study_dissimila(records, ["x"], resamples=FEW)
    assert (found.points, found.neutral, found.runs_left_out) == (120, 12, 0)
    kept = records[records["step"] >= 3]
    ratio = kept["expected_evolvability"] / (kept["expected_local_sensitivity"] + 1e-12)
    assert found.quantiles["x"] == pytest.approx(np.quantile(ratio, [0.05, 0.25, 0.5, 0.75, 0.95]))


def test_short_runs_are_left_out_and_said():
    found = study_dissimila(walks(lambda _, noise: noise, runs=3, steps=12), ["x"], resamples=FEW)
    assert found.runs_left_out == 3
    assert all(r.test is None and "0 runs" in r.reason for r in found.relations)


def test_a_horizon_is_a_step_or_more():
    with pytest.raises(NichechainError, match="horizon is 0"):
        study_dissimila(walks(lambda _, noise: noise), ["x"], horizon=0)
