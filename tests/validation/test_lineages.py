import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError
from nichechain.validation import Triples


def frame(rows):
    """Births from tuples (run, uid, parent_uid, depth, parent_niche, child_niche, step)."""
    names = ["run", "uid", "parent_uid", "depth", "parent_niche", "child_niche", "step"]
    return pd.DataFrame(rows, columns=names).astype("Int64")


FAMILY = [
    (0, 0, None, 0, None, 5, 0),
    (0, 1, 0, 1, 5, 6, 1),
    (0, 2, 1, 2, 6, 7, 2),
    (0, 3, 1, 2, 6, 8, 2),
    (0, 4, 1, 2, 6, None, 3),
    (1, 0, None, 0, None, 9, 0),
    (1, 1, 0, 1, 9, 6, 4),
    (1, 2, 1, 2, 6, 5, 5),
]


def joined(births):
    """(grandparent, parent, child, depth of the parent, its step) of every child, sorted."""
    triples = Triples.from_births(births)
    of = triples.elite
    columns = triples.grandparent[of], triples.niche[of], triples.child, triples.depth[of], triples.step[of]
    return sorted(zip(*(column.tolist() for column in columns), strict=True))


def test_a_family_by_hand():
    # Runs number their births alike, and a failed child is nobody's triple.
    assert joined(frame(FAMILY)) == sorted(
        [
            (NONE, 5, 6, 0, 0),
            (5, 6, 7, 1, 1),
            (5, 6, 8, 1, 1),
            (NONE, 9, 6, 0, 0),
            (9, 6, 5, 1, 4),
        ]
    )


def test_children_of_one_parent_share_it():
    triples = Triples.from_births(frame(FAMILY)).with_grandparent
    assert len(triples) == 3
    assert triples.niche.tolist() == [6, 6]
    assert sorted(triples.grandparent.tolist()) == [5, 9]
    by_parent = {g: sorted(triples.child[triples.elite == e]) for e, g in enumerate(triples.grandparent)}
    assert by_parent == {5: [7, 8], 9: [5]}


@given(st.data())
def test_join_is_that_of_dictionaries(data):
    rows = []
    for run in range(data.draw(st.integers(1, 2))):
        for uid in range(data.draw(st.integers(1, 12))):
            living = [row for row in rows if row[0] == run and row[5] is not None]
            parent = data.draw(st.sampled_from([None, *living]))
            child = data.draw(st.sampled_from([None, 0, 1, 2]))
            if parent is None:
                rows.append((run, uid, None, 0, None, child, uid))
            else:
                rows.append((run, uid, parent[1], parent[3] + 1, parent[5], child, uid))
    born = {(row[0], row[1]): row for row in rows}
    expected = []
    for run, _, parent_uid, _, parent_niche, child, _ in rows:
        if parent_uid is not None and child is not None:
            parent = born[run, parent_uid]
            grandparent = NONE if parent[4] is None else parent[4]
            expected.append((grandparent, parent_niche, child, parent[3], parent[6]))
    shuffled = data.draw(st.permutations(rows))
    assert joined(frame(shuffled)) == sorted(expected)


def test_a_parent_that_is_missing_is_named():
    with pytest.raises(NichechainError, match="has parent 1, but there is no such birth"):
        Triples.from_births(frame([row for row in FAMILY if row[:2] != (0, 1)]))
    with pytest.raises(NichechainError, match="no column depth"):
        Triples.from_births(frame(FAMILY).drop(columns="depth"))


def test_real_births_join(arm):
    births = arm.births()
    triples = Triples.from_births(births)
    assert len(triples) == (births["parent_niche"].notna() & births["child_niche"].notna()).sum()
    # The niche a parent was born in is the one its children say.
    rows = births[births["parent_uid"].notna()]
    np.testing.assert_array_equal(triples.niche[triples.elite], rows["parent_niche"].to_numpy(np.int64))
