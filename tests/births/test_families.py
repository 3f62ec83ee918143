import numpy as np

from nichechain.births.families import elites_of, folds_of, redrawn, tabulated

# State 2 has elites 7 and 9, state 5 has elite 3.
FAMILIES = np.array([[2, 7, 0, 1], [2, 7, 1, 3], [2, 9, 1, 2], [5, 3, 5, 4]])


def test_births_are_counted_by_family():
    births = np.repeat(FAMILIES[:, :3], FAMILIES[:, 3], axis=0)
    shuffled = np.random.default_rng(0).permutation(births)
    np.testing.assert_array_equal(tabulated(*shuffled.T), FAMILIES)
    twice = np.concatenate([FAMILIES, FAMILIES])
    np.testing.assert_array_equal(tabulated(*twice.T)[:, 3], 2 * FAMILIES[:, 3])


def test_elites_are_numbered_by_state():
    assert elites_of(FAMILIES).tolist() == [0, 0, 1, 2]
    assert elites_of(FAMILIES[:0]).size == 0


def test_an_elite_is_held_out_with_all_its_children():
    elite = np.repeat(np.arange(10), 3)
    fold = folds_of(elite, 5, np.random.default_rng(1))
    assert (fold.reshape(10, 3) == fold.reshape(10, 3)[:, :1]).all()
    assert np.bincount(fold[::3]).tolist() == [2] * 5


def test_a_state_has_as_many_elites_as_before():
    elite = elites_of(FAMILIES)
    rng = np.random.default_rng(2)
    drawn = np.array([redrawn(FAMILIES, elite, rng)[:, 3] // FAMILIES[:, 3] for _ in range(2000)])
    # All children of an elite come with it.
    assert (drawn[:, 0] == drawn[:, 1]).all()
    assert (drawn[:, 0] + drawn[:, 2] == 2).all()
    assert (drawn[:, 3] == 1).all()
    # Twice one of two elites: 0, 1 or 2 times with probability 1/4, 1/2, 1/4.
    share = np.bincount(drawn[:, 0]) / 2000
    np.testing.assert_allclose(share, [0.25, 0.5, 0.25], atol=0.05)


def test_there_may_be_no_families():
    none = FAMILIES[:0]
    assert tabulated(*none[:, :3].T).shape == (0, 4)
    assert folds_of(elites_of(none), 2, np.random.default_rng(0)).size == 0
    assert redrawn(none, elites_of(none), np.random.default_rng(0)).shape == (0, 4)
