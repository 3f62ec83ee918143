"""Transition counts: a fold over births that merges."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

import nichechain as nc
from nichechain import GridNiches, NichechainError, TransitionCounts

# Six niches and the outside, state 6.
GRID = GridNiches((3, 2), ((0.0, 3.0), (0.0, 2.0)))
NULL = -1

births = st.lists(st.tuples(st.integers(-1, 6), st.integers(-1, 6)), max_size=60)


def _columns(pairs):
    return [i for i, _ in pairs], [j for _, j in pairs]


@given(births)
def test_every_birth_is_counted_where_it_belongs(pairs):
    counts = TransitionCounts.from_births(*_columns(pairs), GRID)
    moves = Counter(pair for pair in pairs if NULL not in pair)
    expected = [[moves[i, j] for j in range(7)] for i in range(7)]
    visits = Counter(j for _, j in pairs)
    np.testing.assert_array_equal(counts.matrix.toarray(), expected)
    np.testing.assert_array_equal(counts.visits, [visits[j] for j in range(7)])
    np.testing.assert_array_equal(counts.births, np.sum(expected, axis=1))
    born, parents = {j for _, j in pairs}, {i for i, _ in moves}
    assert counts.never_filled == 6 - len(born - {NULL, 6})
    assert counts.never_parent == len(born - parents - {NULL, 6})
    assert counts.rows_observed == len(parents - {6})
    assert counts.births_outside == visits[6]


@given(births, births)
def test_a_merge_is_the_count_of_the_pooled_births(first, second):
    merged = TransitionCounts.from_births(*_columns(first), GRID) + TransitionCounts.from_births(
        *_columns(second), GRID
    )
    pooled = TransitionCounts.from_births(*_columns(first + second), GRID)
    np.testing.assert_array_equal(merged.matrix.toarray(), pooled.matrix.toarray())
    np.testing.assert_array_equal(merged.visits, pooled.visits)
    assert merged.niches == pooled.niches
    assert merged.matrix.dtype == merged.visits.dtype == np.int64


def test_a_merge_leaves_its_parts_alone():
    one = TransitionCounts.from_pairs([0, 1], [1, 2], GRID)
    other = TransitionCounts.from_pairs([0], [1], GRID)
    merged = one + other
    assert merged.matrix[0, 1] == 2
    assert one.matrix[0, 1] == other.matrix[0, 1] == 1
    assert one.visits.sum() == 2


def test_pairs_by_hand():
    counts = TransitionCounts.from_pairs([0, 0, 5, 6], [1, 1, 6, 0], GRID)
    assert counts.matrix[0, 1] == 2
    assert counts.matrix[5, 6] == counts.matrix[6, 0] == 1
    assert counts.births.tolist() == [2, 0, 0, 0, 0, 1, 1]
    # Never filled: 2, 3, 4 and 5. Of those filled, only 1 has no children.
    assert counts.visits.tolist() == [1, 2, 0, 0, 0, 0, 1]
    assert (counts.never_filled, counts.never_parent, counts.rows_observed) == (4, 1, 2)


def test_pairs_stand_for_many_births():
    pairs = [0, 0, 5, 6, 2], [1, 1, 6, 0, 2]
    n = [3, 1, 2, 5, 0]
    counts = TransitionCounts.from_pairs(*pairs, GRID, n)
    singly = TransitionCounts.from_pairs(*(np.repeat(states, n) for states in pairs), GRID)
    np.testing.assert_array_equal(counts.matrix.toarray(), singly.matrix.toarray())
    np.testing.assert_array_equal(counts.visits, singly.visits)
    # A pair of no births leaves nothing behind.
    assert counts.matrix.nnz == 3


@pytest.mark.parametrize(
    ("n", "message"),
    [
        ([1], r"n has shape \(1,\), but must have \(2,\), one number for each pair"),
        ([1, -1], "negative or no whole numbers"),
        ([1, 0.5], "negative or no whole numbers"),
        ([1, np.nan], "negative or no whole numbers"),
    ],
)
def test_multiplicities_are_refused(n, message):
    with pytest.raises(NichechainError, match=message):
        TransitionCounts.from_pairs([0, 1], [1, 2], GRID, n)


def test_children_of_unknown_parents_are_no_siblings():
    counts = TransitionCounts.from_births([0, 0, 0], [1, 1, 2], GRID, elite=[-1, -1, 4])
    assert counts.families.tolist() == [[0, 4, 2, 1]]
    assert counts.births[0] == 3


def test_clipped_niches_have_no_outside():
    niches = GridNiches((3, 2), ((0.0, 3.0), (0.0, 2.0)), "clip")
    counts = TransitionCounts.from_pairs([0, 5], [5, 5], niches)
    assert counts.matrix.shape == (6, 6)
    assert counts.births_outside == 0


def test_no_births_are_counts_as_well():
    counts = TransitionCounts.from_births([], [], GRID)
    assert counts.matrix.shape == (7, 7)
    assert counts.births.sum() == counts.visits.sum() == counts.births_outside == 0
    assert (counts.never_filled, counts.never_parent, counts.rows_observed) == (6, 0, 0)


@pytest.mark.parametrize(
    ("parent", "child", "message"),
    [
        ([0, 1], [0], r"parents have shape \(2,\) and children \(1,\)"),
        ([[0]], [[0]], r"shape \(1, 1\)"),
        ([7], [0], "state is 7, but states run from 0 to 6"),
        ([0], [7], "state is 7"),
        ([-1], [0], "state is -1"),
        ([0], [-2], "state is -2"),
    ],
)
def test_pairs_are_refused(parent, child, message):
    with pytest.raises(NichechainError, match=message):
        TransitionCounts.from_pairs(parent, child, GRID)


@pytest.mark.parametrize(
    ("parent", "child", "message"),
    [
        ([0], [7], "state is 7"),
        ([9], [0], "state is 9"),
        # An initial birth, and a child of a parent that does not exist.
        ([-1], [7], "state is 7"),
        ([-1], [-2], "state is -2"),
        ([-2], [0], "state is -2"),
        ([0, 1], [0], "parents have shape"),
    ],
)
def test_births_are_refused(parent, child, message):
    with pytest.raises(NichechainError, match=message):
        TransitionCounts.from_births(parent, child, GRID)


@pytest.mark.parametrize(
    "other",
    [
        GridNiches((2, 3), ((0.0, 3.0), (0.0, 2.0))),
        GridNiches((3, 2), ((0.0, 3.0), (0.0, 2.5))),
        GridNiches((3, 2), ((0.0, 3.0), (0.0, 2.0)), "absorb"),
    ],
)
def test_counts_of_other_niches_do_not_merge(other):
    with pytest.raises(NichechainError, match="niches differ"):
        TransitionCounts.from_pairs([0], [1], GRID) + TransitionCounts.from_pairs([0], [1], other)


def test_elites_of_two_searches_stay_apart_whatever_their_numbers():
    """Children of two elites that bear one number are not siblings for that."""
    niches = GridNiches((4,), ((0.0, 4.0),))
    numbers = [3, 5, 100], [-7, 0, 1, 2, 3, 5, 50, 100, 101, 250]
    sides = [
        TransitionCounts.from_births([0] * len(elites), [1] * len(elites), niches, elite=elites)
        for elites in numbers
    ]
    together = sides[0] + sides[1]
    assert len(np.unique(together.families[:, :2], axis=0)) == sum(map(len, numbers))
    assert together.families[:, 3].sum() == sum(map(len, numbers))
    np.testing.assert_array_equal(together.families[:3], sides[0].families)


def test_births_of_an_archive_by_column_and_in_one_go():
    archive = nc.load("fetch-pick-and-place")
    births = archive.births()
    columns = TransitionCounts.from_births(births.parent_niche, births.child_niche, archive.niches)
    assert columns.births.sum() == 41_900
    np.testing.assert_array_equal(columns.visits, archive.counts.visits)
    whole = TransitionCounts.from_births(births, archive.niches)
    assert (whole.matrix != archive.counts.matrix).nnz == 0
    np.testing.assert_array_equal(whole.families, archive.counts.families)


_FRAME = pd.DataFrame({"parent_niche": [np.nan, 0, 0, 1], "child_niche": [0, 1, np.nan, 6]})


@pytest.mark.parametrize(
    "table",
    [
        _FRAME,
        _FRAME.astype("Int32"),
        pa.Table.from_pandas(_FRAME.astype("Int32")),
        pa.Table.from_pandas(_FRAME),
        _FRAME.assign(parent_uid=[np.nan, 0, 0, 1], run=0),
    ],
    ids=["NaN", "nullable", "arrow", "arrow-nulls-from-NaN", "families"],
)
def test_nulls_are_null_whatever_they_are_called(table):
    counts = TransitionCounts.from_births(table, GRID)
    assert counts.matrix.toarray()[[0, 1], [1, 6]].tolist() == [1, 1]
    assert counts.births.sum() == 2
    assert counts.visits.tolist() == [1, 1, 0, 0, 0, 0, 1]
    assert len(counts.families) == (2 if "parent_uid" in getattr(table, "columns", ()) else 0)


def test_masked_states_are_null():
    parent = np.ma.masked_array([3, 0], [True, False])
    assert TransitionCounts.from_births(parent, [0, 1], GRID).births.tolist() == [1, 0, 0, 0, 0, 0, 0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((pd.DataFrame({"parent_niche": [1]}), GRID), "births have no column child_niche"),
        ((_FRAME, [1, 2, 3, 4]), "comes with its niches alone"),
        ((_FRAME, GRID, GRID), "comes with its niches alone"),
        (([0], [1]), "niches are missing"),
        ((np.array([2**64 - 1, 0], np.uint64), [1, 2], GRID), "parent has the value 18446744073709551615"),
        ((pd.Series([0.5]), [1], GRID), "parent has the value 0.5"),
        ((np.array([1j]), [1], GRID), "parent has values that are no whole numbers"),
    ],
)
def test_tables_and_columns_are_refused(arguments, message):
    with pytest.raises(NichechainError, match=message):
        TransitionCounts.from_births(*arguments)


def test_lineages_are_steps():
    counts = TransitionCounts.from_trajectories([[0, 1, 6, 1], np.array([5]), []], GRID)
    assert {(i, j) for i, j in zip(*counts.matrix.nonzero(), strict=True)} == {(0, 1), (1, 6), (6, 1)}
    assert counts.visits.tolist() == [1, 2, 0, 0, 0, 1, 1]
    assert TransitionCounts.from_trajectories([], GRID).births.sum() == 0


@pytest.mark.parametrize("form", [np.asarray, sparse.csr_array, sparse.coo_matrix])
def test_a_matrix_of_counts(form):
    matrix = np.random.default_rng(0).integers(3, size=(7, 7))
    counts = TransitionCounts.from_matrix(form(matrix), GRID)
    np.testing.assert_array_equal(counts.matrix.toarray(), matrix)
    np.testing.assert_array_equal(counts.visits, matrix.sum(axis=0))


@pytest.mark.parametrize("n", [[2**62] * 3, [1e19, 0, 0], [2**53, 2, 2], [1e300, 0, 0]])
def test_more_births_than_can_be_counted(n):
    with pytest.raises(NichechainError, match=r"n is .* births in all, but at most 2\*\*53 can be counted"):
        TransitionCounts.from_pairs([0, 0, 0], [1, 1, 2], GRID, n=n)


def test_a_merge_of_more_births_than_can_be_counted():
    half = TransitionCounts.from_pairs([0], [1], GRID, n=[2**52])
    assert (half + half).births[0] == 2**53
    with pytest.raises(NichechainError, match="at most"):
        half + (half + half)
