import numpy as np

from nichechain.search.elites import Elites


def elites(niche: list[int], uid: list[int], key: list[float]) -> Elites:
    size = len(niche)
    real = np.zeros(size)
    return Elites(
        np.array(niche),
        np.zeros((size, 1), np.float32),
        real[:, None],
        real,
        np.array(key),
        np.array(uid),
        np.zeros(size, int),
    )


def test_the_largest_key_of_each_niche_wins():
    winners = elites([5, 3, 3, 5], [0, 1, 2, 3], [1.0, 1.0, 2.0, 0.5]).winners()
    assert winners.niche.tolist() == [3, 5]
    assert winners.uid.tolist() == [2, 0]


def test_the_earlier_birth_wins_a_tie():
    assert elites([3, 3], [9, 4], [1.0, 1.0]).winners().uid.tolist() == [4]


def test_nobody_wins_where_nobody_is():
    assert len(elites([], [], []).winners()) == 0
