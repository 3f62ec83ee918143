"""The novelty archive: against a queue for each walk."""

from __future__ import annotations

from collections import deque

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nichechain import NichechainError
from nichechain.walks.diversity import ArchiveRule, NoveltyArchive


@given(st.integers(0, 2**32), st.integers(1, 7), st.integers(1, 4), st.floats(0, 1))
def test_first_in_first_out(seed, limit, archives, share):
    rng = np.random.default_rng(seed)
    queues = [deque(maxlen=limit) for _ in range(archives)]
    archive = NoveltyArchive.empty(archives, 2)
    for step in range(6):
        points = rng.normal(size=(archives, 5, 2))
        enters = rng.random((archives, 5)) < share
        archive = archive.add(points, enters, step, limit)
        for queue, row, flags in zip(queues, points, enters, strict=True):
            queue.extend((*point, step) for point in row[flags])
        assert archive.size.tolist() == [len(queue) for queue in queues]
        for i, queue in enumerate(queues):
            held = np.array(queue).reshape(-1, 3)
            np.testing.assert_array_equal(archive.behavior[i, : len(queue)], held[:, :2])
            np.testing.assert_array_equal(archive.entered[i, : len(queue)], held[:, 2])
            assert np.isnan(archive.behavior[i, len(queue) :]).all()
            assert (archive.entered[i, len(queue) :] == -1).all()
        # No longer than the longest needs.
        assert archive.behavior.shape[1] == max(len(queue) for queue in queues)


def test_probability_is_the_papers_for_offspring_and_certain_for_the_selected():
    assert ArchiveRule().limit == 1200
    assert ArchiveRule().chance == 0.1
    assert ArchiveRule(entry="selected").chance == 1.0
    assert ArchiveRule(entry="selected", probability=0.5).chance == 0.5


@given(st.integers(0, 2**32), st.integers(1, 9), st.floats(0, 1))
def test_so_many_enter_and_all_where_there_are_fewer(seed, count, share):
    rng = np.random.default_rng(seed)
    lots, may = rng.random((5, 8)), rng.random((5, 8)) < share
    enters = ArchiveRule(count=count).enters(lots, may)
    for row, allowed, entered in zip(lots, may, enters, strict=True):
        drawn = sorted(np.flatnonzero(allowed), key=lambda i: row[i])[:count]
        assert set(np.flatnonzero(entered)) == set(drawn)


def test_each_is_as_likely_to_be_among_the_six():
    enters = ArchiveRule(count=6).enters(
        np.random.default_rng(0).random((4000, 40)), np.ones((4000, 40), bool)
    )
    assert (enters.sum(axis=1) == 6).all()
    # A share of 0.15 with a standard error of 0.0056; forty of them stay within five.
    np.testing.assert_allclose(enters.mean(axis=0), 0.15, atol=0.028)


def test_by_chance_each_enters_on_its_own():
    lots = np.array([[0.05, 0.2, 0.05]])
    assert ArchiveRule().enters(lots, np.array([[True, True, False]])).tolist() == [[True, False, False]]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"limit": 0}, "archive_limit is 0"),
        ({"probability": 0.0}, "archive_probability is 0.0"),
        ({"probability": 1.5}, "archive_probability is 1.5"),
        ({"count": 0}, "archive_count is 0"),
        ({"count": 6, "probability": 0.1}, "exclude each other"),
        ({"entry": "all"}, "archive entry is 'all', but must be offspring or selected"),
        ({"scope": "run"}, "archive scope is 'run', but must be walk or configuration"),
    ],
)
def test_bad_input_is_one_sentence(values, message):
    with pytest.raises(NichechainError, match=message):
        ArchiveRule(**values)
