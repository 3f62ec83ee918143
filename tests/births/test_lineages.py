"""Tables of lineages, against trees written out by hand."""

import numpy as np

from nichechain.births.lineages import lineages_of, no_lineages

# Elites 0 and 1. Elite 0 begins two lineages (births 2 and 3), elite 1 one (birth 4). Birth 8 failed.
UID = np.array([0, 1, 2, 3, 4, 5, 6, 7, 8, 9])
PARENT = np.array([-1, -1, 0, 0, 1, 2, 3, 5, 6, 1])
STATE = np.array([5, 6, 10, 11, 12, 13, 14, 15, -1, 17])
STOOD = np.array([-1, -1, 5, 5, 6, 10, 11, 13, 14, 6])
FLAGGED = np.array([0, 0, 0, 0, 0, 1, 1, 1, 1, 0], bool)
RUN = np.zeros(10, np.int64)
EXPECTED = [
    [0, 0, 1, 5, 10, 2],
    [0, 0, 2, 10, 13, 2],
    [0, 0, 3, 13, 15, 2],
    [0, 1, 1, 5, 11, 2],
    [0, 1, 2, 11, 14, 2],
]


def table(*arrays):
    return lineages_of(*arrays).tolist()


def test_lineages_of_one_elite_are_a_brood():
    assert table(RUN, UID, PARENT, STOOD, STATE, FLAGGED) == EXPECTED


def test_the_order_of_births_does_not_matter():
    order = np.random.default_rng(0).permutation(10)
    assert table(*(array[order] for array in (RUN, UID, PARENT, STOOD, STATE, FLAGGED))) == EXPECTED


def test_runs_are_kept_apart():
    """The same births in two runs are broods of two elites."""
    twice = [np.concatenate([array, array]) for array in (UID, PARENT, STOOD, STATE, FLAGGED)]
    run = np.repeat([3, 7], 10)
    found = np.array(table(run, *twice))
    assert np.unique(found[:, 0]).size == 2
    assert found[found[:, 0] == 0].tolist() == EXPECTED


def test_a_lineage_whose_beginning_is_missing_is_left_out():
    kept = UID != 2
    found = table(*(array[kept] for array in (RUN, UID, PARENT, STOOD, STATE, FLAGGED)))
    assert found == [[0, 0, *row[2:5], 3] for row in EXPECTED[3:]]


def test_births_without_lineages_have_an_empty_table():
    plain = np.zeros(10, bool)
    assert lineages_of(RUN, UID, PARENT, STOOD, STATE, plain).shape == no_lineages().shape == (0, 6)
