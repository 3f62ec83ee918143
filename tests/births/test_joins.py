import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nichechain.births.joins import across_runs, parent_rows, repeated
from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError


def ints(*values: int) -> np.ndarray:
    return np.array(values, np.int64)


def test_numbers_of_later_runs_are_counted_on():
    run, uid, parent = ints(0, 0, 0, 2, 2), ints(0, 1, 2, 0, 1), ints(NONE, 0, 0, NONE, 0)
    number, parents = across_runs(run, uid, parent)
    assert number.tolist() == [0, 1, 2, 3, 4]
    assert parents.tolist() == [NONE, 0, 0, NONE, 3]


def test_one_run_keeps_its_numbers():
    (number,) = across_runs(ints(7, 7, 7), ints(5, NONE, 2))
    assert number.tolist() == [5, NONE, 2]


def test_there_may_be_no_births():
    none = ints()
    assert across_runs(none, none)[0].size == 0
    assert parent_rows(none, none, none).size == 0
    assert repeated(none, none).size == 0


@given(st.lists(st.tuples(st.integers(0, 2), st.booleans()), min_size=1, max_size=30), st.randoms())
def test_parents_are_found_in_any_order(births, random):
    rows = []
    for run, initial in births:
        own = [uid for other, uid, _ in rows if other == run]
        rows.append((run, len(own), NONE if initial or not own else random.choice(own)))
    random.shuffle(rows)
    run, uid, parent = np.array(rows, np.int64).T
    known = {(one, number): row for row, (one, number, _) in enumerate(rows)}
    expected = [NONE if mother == NONE else known[one, mother] for one, _, mother in rows]
    assert parent_rows(run, uid, parent).tolist() == expected


def test_a_parent_that_was_never_born_is_named():
    with pytest.raises(NichechainError, match="birth 1 of run 3 has parent 4, but there is no such birth"):
        parent_rows(ints(0, 0, 3), ints(4, 5, 1), ints(NONE, 4, 4))


def test_births_that_bear_an_earlier_number_of_their_run():
    again = repeated(ints(0, 0, 1, 0, 1), ints(2, 3, 2, 2, 2))
    assert again.tolist() == [False, False, False, True, True]
