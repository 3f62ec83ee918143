"""Contests step by step, by an evolvability that is the sum of where children landed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError
from nichechain.search.config import BuildConfig
from nichechain.search.contests import Contests
from nichechain.search.lineages import Stretch
from nichechain.search.selection import Told

CONFIG = BuildConfig(
    "arm",
    (4, 4),
    ((-1.0, 1.0), (-1.0, 1.0)),
    objective="l-evolvability",
    replacement="objective",
    initial=3,
    batch=4,
    offspring=2,
    lineage_share=0.0,
)


class Sum:
    """The sum of the states that children landed in."""

    def tell(self, births):
        """Nothing is remembered."""

    def refresh(self):
        """Nothing is prepared."""

    def __call__(self, children):
        return float(children.sum())


def contests(config: BuildConfig = CONFIG, states: int = 17) -> Contests:
    return Contests(Stretch.of_build(config), states, config.offspring, Sum())


def told(step: int, uid: int, *births: tuple[int, int]) -> Told:
    """Births of so many uids from one on, each by its parent and its niche."""
    size = len(births)
    parent, niche = np.array(births, np.int64).reshape(-1, 2).T
    nobody = np.zeros(size, bool)
    return Told(parent, parent, niche, nobody, np.full(size, step), uid + np.arange(size), nobody)


def due(found: Contests) -> list[tuple[int, int, int]]:
    return list(zip(*(column.tolist() for column in found.due.columns().values()), strict=True))


def test_a_contested_niche_gets_children_of_both_and_the_better_keeps_it():
    found = contests()
    # 0 and 1 are the first in their niches, 2 contests that of 0.
    assert found.hear(told(0, 0, (NONE, 5), (NONE, 6), (NONE, 5))).tolist() == [2]
    found.begin(1)
    assert due(found) == [(0, 5, 0), (1, 5, 0), (2, 5, 2), (3, 5, 2)]
    # Children made to judge fill niches, and contest none.
    assert found.hear(told(1, 3, (0, 1), (0, 6), (2, 7), (2, 1))).tolist() == []
    ended = found.settle()
    # 1 + 6 is less than 7 + 1.
    assert (ended.niche.tolist(), ended.uid.tolist(), ended.value.tolist()) == ([5], [2], [8.0])
    assert not len(found.settle())
    found.begin(2)
    assert due(found) == []
    # The winner has all the children that it needs, so only the next contender gets some.
    assert found.hear(told(2, 7, (2, 5), (1, 5), (1, 3), (1, NONE))).tolist() == [0]
    assert not len(found.settle())
    found.begin(3)
    assert due(found) == [(0, 5, 7), (1, 5, 7)]


def test_children_of_a_parent_count_and_equals_leave_the_elite():
    found = contests()
    found.tell(told(0, 0, (NONE, 5), (NONE, 6), (NONE, 7)))
    found.begin(1)
    assert due(found) == []
    # Both children of 0 count, and one of them contests another niche; one of its own failed.
    assert found.hear(told(1, 3, (0, 6), (0, NONE), (0, 8), (1, 6))).tolist() == [0]
    found.begin(2)
    assert due(found) == [(0, 6, 1), (1, 6, 3), (2, 6, 3)]
    found.tell(told(2, 7, (1, 4), (3, 4), (3, 6), (0, 9)))
    ended = found.settle()
    assert (ended.uid.tolist(), ended.value.tolist()) == ([1], [10.0])


def test_the_oldest_contest_comes_first_and_nobody_waits_twice():
    config = replace(CONFIG, initial=6)
    found = contests(config)
    rows = found.hear(told(0, 0, (NONE, 5), (NONE, 2), (NONE, 5), (NONE, 2), (NONE, 5), (NONE, 2)))
    # One contender for each niche, others are passed over.
    assert rows.tolist() == [2, 3]
    found.begin(1)
    assert due(found) == [(0, 5, 0), (1, 5, 0), (2, 5, 2), (3, 5, 2)]
    found.tell(told(1, 6, (0, 5), (0, 5), (2, 5), (2, 5)))
    found.begin(2)
    assert due(found) == [(0, 2, 1), (1, 2, 1), (2, 2, 3), (3, 2, 3)]


def test_lineages_neither_judge_nor_contest():
    config = replace(CONFIG, batch=8, lineage_share=0.5, lineage_brood=4, offspring=9)
    found = contests(config)
    found.tell(told(0, 0, (NONE, 5), (NONE, 6), (NONE, 5)))
    found.begin(1)
    assert [place for place, _, _ in due(found)] == [0, 1, 2, 3]
    later = told(2, 11, (1, 6))
    assert found.hear(replace(later, lineage=np.array([True]))).tolist() == []


def test_a_state_that_nobody_leaves_is_not_contested():
    found = contests(states=16)
    assert found.hear(told(0, 0, (NONE, 16), (NONE, 16), (NONE, 15), (NONE, 15))).tolist() == [3]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"objective": "reward"}, "objective is 'reward', but must be one of domain, l-evolvability"),
        ({"offspring": 0}, "offspring is 0, but must be at least 1"),
        ({"offspring": 2.5}, "offspring is 2.5, but must be a whole number"),
        ({"objective_l": 0}, "objective_l is 0, but must be at least 1"),
        ({"objective_lineages": 3}, "objective_lineages is 3, but must be at most 2"),
        ({"replacement": "random"}, "so replacement must be 'objective', but replacement is 'random'"),
    ],
)
def test_odd_objectives_are_refused(values, message):
    with pytest.raises(NichechainError, match=message):
        replace(CONFIG, **values)
