"""The level of early and late births: the same where nothing drifts, apart where steps grow."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from nichechain import GridNiches, NichechainError
from nichechain.births.table import schema
from nichechain.chain.estimators import estimate
from nichechain.chain.filters import counts_of
from nichechain.validation.drift import level_course, level_drift

GRID = GridNiches((4, 4), ((0.0, 1.0), (0.0, 1.0)), "clip")
OPTIONS = {"l": 2, "lineages": 8}


def births(widths, seed, size=3000):
    """Children land uniformly on the next so many niches; the width changes from part to part."""
    rng = np.random.default_rng(seed)
    parent = rng.integers(16, size=size)
    width = np.repeat(widths, size // len(widths))
    child = (parent + 1 + (rng.random(size) * width).astype(int)) % 16
    nulls = pa.nulls(size)
    columns = {
        "run": np.zeros(size, int),
        "uid": np.arange(size),
        "parent_uid": 10 * parent + rng.integers(10, size=size),
        "parent_niche": parent,
        "child_niche": child,
        "step": np.arange(size) // 10,
    }
    target = schema(2)
    arrays = [pa.array(columns.get(field.name, nulls)).cast(field.type) for field in target]
    return pa.Table.from_arrays(arrays, schema=target)


def exact(width):
    """Niches that 8 lineages of 2 generations see, from any niche of the ring."""
    T = np.zeros((16, 16))
    for i in range(16):
        T[i, (i + 1 + np.arange(width)) % 16] = 1 / width
    H = T.copy()
    np.fill_diagonal(H, 1.0)
    return (1 - (1 - (T @ H)[0]) ** 8).sum()


def test_wider_steps_are_found_out():
    found = level_drift(births([2, 6], 0), GRID, **OPTIONS)
    assert found.early == pytest.approx(exact(2), rel=0.05)
    assert found.late == pytest.approx(exact(6), rel=0.05)
    assert found.disagrees
    assert found.low < found.late - found.early < found.high
    assert (found.births, found.niches) == ((1500, 1500), 16)
    assert f"{found.early:.1f} by the first half" in found.answer
    assert "disagree" in found.answer


def test_parts_borrow_the_prior_of_all_births():
    """With a strength that no births would give, both halves are next to the base."""
    table = births([2, 6], 0)
    like = estimate(counts_of(table, GRID)).posterior
    found = level_drift(table, GRID, **OPTIONS, like=like)
    assert found.early == pytest.approx(exact(2), rel=0.05)
    assert found.late == pytest.approx(exact(6), rel=0.05)
    strong = replace(like.prior, strength=1e6, weights=np.eye(like.prior.kinds.number)[-1])
    uniform = level_drift(table, GRID, **OPTIONS, like=replace(like, prior=strong))
    assert uniform.early == pytest.approx(exact(16), rel=0.05)


def test_births_are_put_in_the_order_of_their_steps():
    table = births([2, 6], 0)
    shuffled = table.take(pa.array(np.random.default_rng(1).permutation(len(table))))
    assert level_drift(shuffled, GRID, **OPTIONS).early == pytest.approx(exact(2), rel=0.1)


def test_births_of_lineages_are_left_out():
    """A calibration's wide births, all at the end, are no drift."""
    search, calibration = births([4], 5), births([8], 6, 600)
    late = pa.array(np.full(600, 1000, np.int32))
    calibration = calibration.set_column(calibration.column_names.index("step"), "step", late)
    flags = [pa.array(np.full(len(table), flag)) for table, flag in ((search, False), (calibration, True))]
    index = search.column_names.index("lineage")
    both = [
        table.set_column(index, "lineage", flag)
        for table, flag in zip((search, calibration), flags, strict=True)
    ]
    found = level_course(pa.concat_tables(both), GRID, parts=2, **OPTIONS)
    assert found.births.tolist() == [1500, 1500]
    assert found.last_step.tolist() == [149, 299]
    assert found.level[0] == pytest.approx(found.level[1], rel=0.05)


def test_births_of_one_chain_seldom_disagree():
    """A 90 % interval misses in one of ten archives: P(X > 6) is 1 % for X ~ Binomial(25, 0.1)."""
    missed = [level_drift(births([4], 10 + seed), GRID, **OPTIONS, seed=seed).disagrees for seed in range(25)]
    assert sum(missed) <= 6
    agreeing = level_drift(births([4], 10 + missed.index(False)), GRID, **OPTIONS, seed=missed.index(False))
    assert "births agree" in agreeing.answer


def test_the_course_has_the_level_of_each_part_and_of_all_so_far():
    found = level_course(births([2, 4, 6], 3), GRID, parts=3, **OPTIONS)
    np.testing.assert_allclose(found.level, [exact(2), exact(4), exact(6)], rtol=0.07)
    assert found.births.tolist() == [1000, 1000, 1000]
    assert found.grown.tolist() == [1000, 2000, 3000]
    assert found.first_step.tolist() == [0, 100, 200]
    assert found.last_step.tolist() == [99, 199, 299]
    assert found.grown_level[0] == pytest.approx(exact(2), rel=0.07)
    assert found.grown_level[0] < found.grown_level[1] < found.grown_level[2]
    frame = found.to_frame()
    assert ((frame["low"] < frame["level"]) & (frame["level"] < frame["high"])).all()


def stepless():
    table = births([2], 0)
    return table.set_column(table.column_names.index("step"), "step", pa.nulls(3000, pa.int32()))


@pytest.mark.parametrize(
    ("table", "options", "said"),
    [
        (births([2], 0, 60), {}, "0 niches have 10 births behind their row of T in each of 2 parts"),
        (stepless(), {}, "3000 of 3000 births do not say"),
        (births([2], 0), {"draws": 1}, "draws is 1"),
        (births([2], 0), {"min_births": -1}, "min_births is -1"),
    ],
)
def test_bad_arguments(table, options, said):
    with pytest.raises(NichechainError, match=said):
        level_drift(table, GRID, **options)
