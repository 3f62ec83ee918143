"""The births table: its schema and its nulls."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from nichechain import births
from nichechain.births.table import NONE, Offspring
from nichechain.domains.base import Evaluation

AXES = 3


def _four_births(parent_uid, parent_niche, child_niche, failed):
    n = len(failed)
    failed = np.array(failed, bool)
    behavior = np.arange(n * AXES, dtype=float).reshape(n, AXES)
    behavior[failed] = np.nan
    objective = np.where(failed, np.nan, 10.0 + np.arange(n))
    evaluation = Evaluation(
        behavior, objective, failed, tuple("physics is unstable" if bad else "" for bad in failed)
    )
    offspring = Offspring(
        np.zeros((n, 2), np.float32),
        np.arange(100, 100 + n),
        np.array(parent_uid, np.int64),
        np.array(parent_niche, np.int64),
        np.arange(n),
        np.arange(n) == 1,
    )
    accepted = (np.arange(n) % 2 == 0) & ~failed
    return births.make_table(
        offspring, evaluation, child_niche=np.array(child_niche, np.int64), accepted=accepted, step=6
    )


def test_the_schema_is_the_documented_one():
    assert [(field.name, field.type) for field in births.schema(2)] == [
        ("run", pa.int32()),
        ("uid", pa.int64()),
        ("parent_uid", pa.int64()),
        ("depth", pa.int32()),
        ("parent_niche", pa.int32()),
        ("child_niche", pa.int32()),
        ("behavior_0", pa.float64()),
        ("behavior_1", pa.float64()),
        ("objective", pa.float64()),
        ("accepted", pa.bool_()),
        ("failed", pa.string()),
        ("step", pa.int32()),
        ("lineage", pa.bool_()),
    ]


def test_a_table_by_hand():
    table = _four_births([7, 2**40, NONE, 0], [3, 0, NONE, 8], [1, NONE, 0, 8], [False, True, False, False])
    assert table.schema == births.schema(AXES)
    assert table.to_pydict() == {
        "run": [0, 0, 0, 0],
        "uid": [100, 101, 102, 103],
        # Uid 0 and niche 0 are real ones, not nulls.
        "parent_uid": [7, 2**40, None, 0],
        "depth": [0, 1, 2, 3],
        "parent_niche": [3, 0, None, 8],
        "child_niche": [1, None, 0, 8],
        "behavior_0": [0.0, None, 6.0, 9.0],
        "behavior_1": [1.0, None, 7.0, 10.0],
        "behavior_2": [2.0, None, 8.0, 11.0],
        "objective": [10.0, None, 12.0, 13.0],
        "accepted": [True, False, True, False],
        "failed": [None, "physics is unstable", None, None],
        "step": [6, 6, 6, 6],
        "lineage": [False, True, False, False],
    }


@pytest.mark.parametrize("failed", [True, False])
def test_tables_that_are_alike_throughout_still_concatenate(failed):
    # All null or none null: Arrow would guess another type for such a column.
    one = _four_births([NONE] * 2, [NONE] * 2, [NONE if failed else 0] * 2, [failed] * 2)
    other = _four_births([1] * 2, [1] * 2, [1] * 2, [False] * 2)
    assert pa.concat_tables([one, other]).num_rows == 4
    assert one["parent_uid"].null_count == one["parent_niche"].null_count == 2
    for name in ("child_niche", "behavior_0", "objective"):
        assert one[name].null_count == (2 if failed else 0)


def test_a_table_of_no_births():
    empty = _four_births([], [], [], [])
    assert empty.num_rows == 0
    assert empty.schema == births.schema(AXES)


def test_offspring_are_cut_alike_in_every_field():
    offspring = Offspring(
        np.arange(10, dtype=np.float32).reshape(5, 2),
        *(np.arange(5) + 10 * k for k in range(1, 5)),
        np.arange(5) == 2,
    )
    cut = offspring[1:3]
    assert len(cut) == 2
    assert cut.genotype.tolist() == [[2, 3], [4, 5]]
    assert [cut.uid.tolist(), cut.parent_uid.tolist(), cut.parent_niche.tolist(), cut.depth.tolist()] == [
        [11, 12],
        [21, 22],
        [31, 32],
        [41, 42],
    ]
    assert cut.lineage.tolist() == [False, True]
    assert len(Offspring.none(7)) == 0
    assert Offspring.none(7).genotype.shape == (0, 7)
