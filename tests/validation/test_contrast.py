"""Two archives compared: where they are the same, where they differ, and what was resampled."""

import numpy as np
import pyarrow as pa
import pytest

from nichechain import GridNiches, NichechainError
from nichechain.births.table import schema
from nichechain.evolvability.coverage import rarefied_coverage
from nichechain.validation.contrast import contrast

GRID = GridNiches((4, 4), ((0.0, 1.0), (0.0, 1.0)), "clip")


def births(width, seed, runs=1, per_run=1500):
    """Children land uniformly on the next ``width`` niches; ten elites to a niche."""
    rng = np.random.default_rng(seed)
    size = runs * per_run
    parent = rng.integers(16, size=size)
    child = (parent + 1 + rng.integers(width, size=size)) % 16
    nulls = pa.nulls(size)
    columns = {
        "run": np.arange(size) // per_run,
        "uid": np.arange(size) % per_run,
        "parent_uid": 10 * parent + rng.integers(10, size=size),
        "parent_niche": parent,
        "child_niche": child,
    }
    target = schema(2)
    arrays = [pa.array(columns.get(field.name, nulls)).cast(field.type) for field in target]
    return pa.Table.from_arrays(arrays, schema=target)


def test_an_archive_does_not_differ_from_itself():
    rows = births(4, 0)
    found = contrast(rows, rows, GRID, resamples=10, l=3, lineages=5)
    assert [row.difference for row in found.rows] == [0.0, 0.0, 0.0]
    assert all(row.low < 0 < row.high for row in found.rows[:2])
    assert found.clusters == (("elites", 160), ("elites", 160))


def test_a_livelier_operator_is_found_out():
    found = contrast(births(2, 1), births(8, 2), GRID, resamples=20, l=2, lineages=10)
    evolvability, reach, coverage = found.rows
    assert evolvability.low > 0
    # A lineage that always moves on visits two niches in two generations, whatever the width.
    assert (reach.first, reach.second) == pytest.approx((2.0, 2.0), abs=0.01)
    assert (coverage.first, coverage.second) == (16.0, 16.0)
    # With 2 ways on, h is 1/2, 3/4, 1/2 and 1/4 for the next four niches: Σ 1 − (1 − h)^10 = 3.942.
    assert evolvability.first == pytest.approx(3.942, abs=0.05)


def test_one_generation_of_one_lineage_is_one_niche():
    found = contrast(births(3, 3), births(5, 4), GRID, resamples=3, l=1)
    assert found.rows[1].first == pytest.approx(1.0)
    assert found.rows[1].second == pytest.approx(1.0)


def test_coverage_is_compared_at_equal_births():
    small, large = births(3, 5, per_run=60), births(3, 6, per_run=900)
    found = contrast(small, large, GRID, resamples=3, min_births=1, l=1, align=False)
    visits = np.bincount(large["child_niche"].to_numpy(), minlength=16)
    assert found.births == 60
    assert found.rows[2].second == pytest.approx(rarefied_coverage(visits, 60))
    assert found.rows[2].first == np.unique(small["child_niche"].to_numpy()).size


def test_archives_are_aligned_by_births():
    small, large = births(3, 5, per_run=600), births(3, 6, per_run=900)
    options = {"resamples": 3, "min_births": 1, "l": 2, "lineages": 5}
    found = contrast(small, large, GRID, **options)
    assert (found.used, found.recorded, found.aligned) == ((600, 600), (600, 900), 600)
    assert found.rows == contrast(small, large.slice(0, 600), GRID, **options).rows
    whole = contrast(small, large, GRID, **options, align=False)
    assert (whole.used, whole.aligned) == ((600, 900), None)
    assert whole.rows != found.rows


def test_each_run_is_cut_to_the_shortest():
    several, one = births(3, 7, runs=4, per_run=300), births(3, 8, per_run=900)
    # Runs may come in any order.
    mixed = several.take(pa.array(np.random.default_rng(0).permutation(len(several))))
    found = contrast(mixed, one, GRID, resamples=3, min_births=1, l=1)
    assert (found.used, found.recorded, found.clusters[0]) == ((1200, 300), (1200, 900), ("runs", 4))


def test_a_search_that_is_the_beginning_of_another_is_told():
    long = births(3, 6, per_run=900)
    found = contrast(long.slice(0, 500), long, GRID, resamples=3, min_births=1, l=1)
    assert found.shared == 500
    other = pa.concat_tables([long.slice(0, 200), births(3, 9, per_run=400)])
    assert 200 <= contrast(other, long, GRID, resamples=3, min_births=1, l=1).shared < 210


def test_runs_are_resampled_where_there_are_several():
    found = contrast(
        births(3, 7, runs=4, per_run=500), births(3, 8), GRID, resamples=20, l=1, lineages=10, align=False
    )
    assert found.clusters == (("runs", 4), ("elites", 160))
    row = found.rows[0]
    # Student's quantile for four runs: 2.353.
    assert row.high - row.difference == pytest.approx(2.3534 * row.standard_error, rel=1e-4)


def test_intervals_hold_the_truth_about_as_often_as_they_say():
    """Archives of one T: 90 % of the intervals should have 0 in them."""
    inside = [
        row.low <= 0 <= row.high
        for seed in range(20)
        for row in contrast(
            births(6, 100 + seed), births(6, 200 + seed), GRID, resamples=15, l=2, lineages=8
        ).rows[:1]
    ]
    # P(X < 15) is 1 % for X ~ Binomial(20, 0.9).
    assert sum(inside) >= 15


def test_tables_of_a_group_are_runs_of_it():
    tables = [births(3, seed, per_run=400) for seed in (10, 11, 12)]
    together = pa.concat_tables(
        [
            table.set_column(0, "run", pa.array(np.full(len(table), run, np.int32)))
            for run, table in enumerate(tables)
        ]
    )
    other = births(5, 13, per_run=400)
    options = {"resamples": 4, "l": 2, "lineages": 5}
    found = contrast(tables, [other], GRID, **options)
    assert found == contrast(together, other, GRID, **options)
    assert found.clusters[0] == ("runs", 3)
    assert found.used == (1200, 400)


def with_lineages(width, seed, broods=6, stay=0.0):
    """The same births, and broods of three lineages of five generations, which stay where they are."""
    rows = births(width, seed, per_run=900).to_pylist()
    rng = np.random.default_rng(seed)
    for brood in range(broods):
        for _ in range(3):
            parent, niche = rows[brood]["uid"], rows[brood]["child_niche"]
            for generation in range(5):
                child = niche if rng.random() < stay else (niche + 1 + int(rng.integers(width))) % 16
                row = dict.fromkeys(rows[0]) | {"run": 0, "uid": len(rows), "parent_uid": parent}
                rows.append(row | {"parent_niche": niche, "child_niche": child, "lineage": generation > 0})
                parent, niche = row["uid"], child
    return pa.Table.from_pylist(rows, schema=schema(2))


def test_births_of_lineages_are_no_rows_of_t():
    lively, lazy = with_lineages(4, 14), with_lineages(4, 14, stay=1.0)
    options = {"resamples": 4, "l": 3, "lineages": 5, "min_births": 1, "align": False}
    found = contrast(lively, lazy, GRID, **options)
    # T is the same; that lineages stay is seen in what they reach.
    assert found.rows[1].difference < -0.3
    # Ten elites in each of 16 niches have children; who goes on with a lineage is none.
    assert found.clusters == (("elites", 160), ("elites", 160))


def test_it_is_said_that_lineages_of_the_end_are_cut_off():
    plain, calibrated = births(4, 14, per_run=900), with_lineages(4, 14)
    options = {"resamples": 2, "l": 1, "lineages": 5, "min_births": 1}
    with pytest.warns(UserWarning, match="second archive has lineages, but all after its first 900 births"):
        contrast(plain, calibrated, GRID, **options)
    contrast(plain, calibrated, GRID, **options, align=False)


@pytest.mark.parametrize("group", [[], [3], "births"])
def test_what_is_no_group(group):
    with pytest.raises(NichechainError, match="must be a table of births or several"):
        contrast(group, births(3, 9, per_run=50), GRID)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"resamples": 1}, "resamples is 1"),
        ({"draws": 0}, "draws is 0"),
        ({"min_births": -1}, "min_births is -1"),
        ({"min_births": 10**6}, "no niche has 1000000 births"),
        ({"l": 0}, "l is 0"),
        ({"lineages": 0}, "lineages is 0"),
    ],
)
def test_bad_arguments(options, said):
    rows = births(3, 9, per_run=50)
    with pytest.raises(NichechainError, match=said):
        contrast(rows, rows, GRID, **options)
