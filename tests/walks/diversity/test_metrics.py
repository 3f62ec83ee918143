"""Diversity metrics from distances: against brute force, SciPy and hand-made cases."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import distance

from nichechain import NichechainError
from nichechain.walks import diversity
from nichechain.walks.diversity import (
    AncestorDistance,
    KNearest,
    ParentDistance,
    Surroundings,
    ancestor_distance,
    knn_distance,
    metrics,
)

NAMES = ("knn", "knn-no-archive", "parent", "ancestors", "kde")


@st.composite
def worlds(draw):
    """Several walks' surroundings; integers on a small board, so that many distances tie."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    walks, siblings, archived, axes = (draw(st.integers(low, 5)) for low in (1, 1, 0, 1))
    scale = draw(st.sampled_from([1.0, 0.1]))

    def points(*shape):
        return rng.integers(0, 4, (*shape, axes)) * scale

    siblings, archive = points(walks, siblings), points(walks, archived)
    siblings[rng.random(siblings.shape[:2]) < 0.2] = np.nan
    archive[rng.random(archive.shape[:2]) < 0.2] = np.nan
    age = rng.integers(1, 5, archive.shape[:2])
    return Surroundings(siblings, archive, age, points(walks, 2, 3), np.full(axes, 4.0))


def _score(metric, around):
    """G of all siblings, the even ones descending from lineage 0."""
    count = around.siblings.shape[1]
    return metric(around.siblings, np.arange(count) % 2, np.arange(count), around)


@given(worlds(), st.integers(1, 12), st.booleans(), st.booleans())
def test_nearest_neighbours_by_brute_force(around, k, archive, include_itself):
    score = _score(KNearest(k, archive, include_itself), around)
    for walk, siblings in enumerate(around.siblings):
        pool = [*siblings, *around.archive[walk]] if archive else list(siblings)
        for i, point in enumerate(siblings):
            others = [p for j, p in enumerate(pool) if not np.isnan(p).any() and (j != i or include_itself)]
            expected = sum(sorted(math.dist(point, other) for other in others)[:k])
            assert score[walk, i] == pytest.approx(
                math.nan if np.isnan(point).any() else expected, nan_ok=True
            )


@given(worlds(), st.integers(1, 12))
def test_a_tree_finds_the_same_neighbours(around, k):
    pool = np.concatenate([around.siblings, around.archive], axis=1)
    # The first query is no point of the pool.
    query = np.concatenate([around.path[:, 0, :1], around.siblings], axis=1)
    itself = np.arange(query.shape[1]) - 1
    for walk in range(len(pool)):
        present = ~np.isnan(query[walk]).any(axis=1)
        by_tree = metrics._by_tree(query[walk], pool[walk], k, itself)
        by_sorting = knn_distance(query[[walk]], pool[[walk]], k, itself=itself)[0]
        np.testing.assert_allclose(by_tree, by_sorting, rtol=1e-12, atol=1e-12)
        assert np.isnan(by_tree).tolist() == (~present).tolist()


def test_a_large_population_is_scored_like_its_parts():
    rng = np.random.default_rng(1)
    pool = rng.normal(size=(2, metrics._TREE_FROM_QUERIES + 10, 2))
    itself = np.arange(pool.shape[1])
    whole = knn_distance(pool, pool, 15, itself=itself)
    part = knn_distance(pool[:, 40:80], pool, 15, itself=itself[40:80])
    np.testing.assert_allclose(whole[:, 40:80], part, rtol=1e-13)
    pairs = np.sort(distance.squareform(distance.pdist(pool[1])), axis=1)
    np.testing.assert_allclose(whole[1], pairs[:, 1:16].sum(axis=1), rtol=1e-12)


@given(worlds())
def test_distances_to_parents_and_ancestors(around):
    parent, ancestors = _score(ParentDistance(), around), _score(AncestorDistance(), around)
    for walk, siblings in enumerate(around.siblings):
        for i, point in enumerate(siblings):
            path = around.path[walk, i % 2]
            expected = distance.cdist(point[None], path)[0]
            assert parent[walk, i] == pytest.approx(expected[-1], nan_ok=True)
            assert ancestors[walk, i] == pytest.approx(expected.sum(), nan_ok=True)


def test_an_ancestor_that_stayed_counts_for_each_step():
    path = np.array([[[[0.0], [1.0], [1.0]]]])
    assert ancestor_distance([[[3.0]]], path, [0]).item() == 3.0 + 2.0 + 2.0


def test_fewer_neighbours_than_k():
    pool = np.array([[[0.0], [1.0], [3.0]]])
    np.testing.assert_allclose(knn_distance(pool, pool, 15, itself=[0, 1, 2]), [[4.0, 3.0, 5.0]])
    alone = np.array([[[5.0]]])
    assert knn_distance(alone, alone, 15, itself=[0]).item() == 0.0


@pytest.mark.parametrize("name", NAMES)
@given(worlds())
def test_a_walk_scores_alike_alone_and_in_company(name, around):
    """To the last bit, and whatever an archive is padded to."""
    metric = diversity.make(name)
    together = _score(metric, around)
    axes = around.siblings.shape[2]
    for walk in range(len(together)):
        padded = Surroundings(
            around.siblings[[walk]],
            np.concatenate([around.archive[[walk]], np.full((1, 37, axes), np.nan)], axis=1),
            np.concatenate([around.age[[walk]], np.zeros((1, 37), np.int64)], axis=1),
            around.path[[walk]],
            around.span,
        )
        assert _score(metric, padded)[0].tobytes() == together[walk].tobytes()


@pytest.mark.parametrize("name", NAMES)
def test_larger_is_more_diverse(name):
    """One of four siblings far from the rest, from the archive and from all ancestors."""
    siblings = np.array([[[0.0, 0.1], [0.1, 0.0], [0.1, 0.1], [3.0, 3.0]]])
    origin = np.zeros((1, 1, 2))
    around = Surroundings(siblings, origin, np.ones((1, 1), np.int64), origin[None], np.ones(2))
    score = diversity.make(name)(siblings, np.zeros(4, np.int64), np.arange(4), around)
    assert score.argmax() == 3


def test_names_stand_for_the_papers_parameters():
    assert diversity.make("knn") == KNearest(k=15, archive=True, include_itself=False)
    assert diversity.make("knn-no-archive") == KNearest(k=15, archive=False)
    assert diversity.make("kde") == diversity.KernelDensity(bandwidth=0.5, mode="factor", decay=1.0)
    assert [diversity.make(name).remembers for name in NAMES] == [True, False, False, False, True]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: KNearest(0), "k is 0"),
        (lambda: knn_distance(np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), -1), "k is -1"),
        (lambda: diversity.make("novelty"), "'novelty', but must be one of knn, knn-no-archive"),
    ],
)
def test_bad_input_is_one_sentence(call, message):
    with pytest.raises(NichechainError, match=message):
        call()
