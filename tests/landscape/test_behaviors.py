"""Landscape measures of behaviors: against closed forms, brute force and laws."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from nichechain import NichechainError, landscape
from nichechain.births.table import NONE

PARENT = np.array([0.0, 0.0])
SQUARE = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
NAN = np.array([[np.nan, np.nan]])
# Tiny ones among them, whose squares are below the smallest float.
NUMBERS = st.floats(-1e6, 1e6)


@st.composite
def families(draw):
    """A parent and some of its offspring, at least one of which did not fail."""
    axes = draw(st.integers(1, 3))
    points = draw(hnp.arrays(float, (draw(st.integers(3, 12)), axes), elements=NUMBERS))
    failed = draw(st.lists(st.booleans(), min_size=len(points) - 2, max_size=len(points) - 2))
    offspring = points[1:].copy()
    offspring[1:][failed] = np.nan
    return points[0], offspring


def test_a_square_around_its_parent():
    assert landscape.local_sensitivity(PARENT, SQUARE) == pytest.approx(math.sqrt(2))
    assert landscape.expected_local_sensitivity(PARENT, SQUARE) == pytest.approx(math.sqrt(2))
    assert landscape.evolvability(SQUARE) == pytest.approx(2 * math.sqrt(2))
    # Four sides of length 2 and two diagonals.
    assert landscape.expected_evolvability(SQUARE) == pytest.approx((8 + 4 * math.sqrt(2)) / 6)


def test_equal_behaviors_of_different_offspring_count():
    # Of the six ordered pairs of indices, four are at distance 1 and two at distance 0.
    assert landscape.expected_evolvability([[0.0], [0.0], [1.0]]) == pytest.approx(2 / 3)


@given(families())
def test_measures_are_those_of_all_pairs(family):
    parent, offspring = family
    alive = [point for point in offspring if not np.isnan(point).any()]
    away = [math.dist(parent, point) for point in alive]
    between = [math.dist(a, b) for a, b in itertools.permutations(alive, 2)]
    near = {"rel": 1e-12, "abs": 1e-300}
    assert landscape.local_sensitivity(parent, offspring) == pytest.approx(max(away), **near)
    assert landscape.expected_local_sensitivity(parent, offspring) == pytest.approx(np.mean(away), **near)
    assert landscape.evolvability(offspring) == pytest.approx(max(between, default=0.0), **near)
    if between:
        assert landscape.expected_evolvability(offspring) == pytest.approx(np.mean(between), **near)
    else:
        assert np.isnan(landscape.expected_evolvability(offspring))


@given(families())
def test_a_triangle_is_no_wider_than_its_sides(family):
    parent, offspring = family
    rounding = 1 + 1e-14
    widest, farthest = landscape.evolvability(offspring), landscape.local_sensitivity(parent, offspring)
    assert widest <= 2 * farthest * rounding
    assert 0 <= landscape.dissimila_ratio(widest, farthest) <= 2 * rounding
    mean = np.nan_to_num(landscape.expected_evolvability(offspring))
    away = landscape.expected_local_sensitivity(parent, offspring)
    assert mean <= widest * rounding
    # Over a few failures left out, both means run over the same offspring.
    assert 0 <= landscape.dissimila_ratio(mean, away) <= 2 * rounding


def test_offspring_that_failed_are_left_out():
    with_failures = np.concatenate([NAN, SQUARE[:2], NAN, SQUARE[2:], NAN])
    for measure in (landscape.evolvability, landscape.expected_evolvability, landscape.hull_volume):
        assert measure(with_failures) == pytest.approx(measure(SQUARE), rel=1e-15)
    for measure in (landscape.local_sensitivity, landscape.expected_local_sensitivity):
        assert measure(PARENT, with_failures) == measure(PARENT, SQUARE)


def test_nothing_left_is_not_a_number():
    gone = np.repeat(NAN, 3, axis=0)
    assert np.isnan(landscape.evolvability(gone))
    assert np.isnan(landscape.expected_evolvability(gone))
    assert np.isnan(landscape.local_sensitivity(PARENT, gone))
    assert np.isnan(landscape.expected_local_sensitivity(PARENT, gone))
    assert np.isnan(landscape.hull_volume(gone))
    assert landscape.evolvability(SQUARE[:1]) == 0.0
    assert np.isnan(landscape.expected_evolvability(SQUARE[:1]))


def test_genotypes_measured_together_are_those_measured_alone():
    rng = np.random.default_rng(0)
    parents, offspring = rng.normal(size=(4, 5, 2)), rng.normal(size=(4, 5, 7, 2))
    offspring[1, 2, 3:5] = np.nan
    together = (
        landscape.local_sensitivity(parents, offspring),
        landscape.expected_local_sensitivity(parents, offspring),
        landscape.evolvability(offspring),
        landscape.expected_evolvability(offspring),
    )
    for i, j in np.ndindex(4, 5):
        alone = (
            landscape.local_sensitivity(parents[i, j], offspring[i, j]),
            landscape.expected_local_sensitivity(parents[i, j], offspring[i, j]),
            landscape.evolvability(offspring[i, j]),
            landscape.expected_evolvability(offspring[i, j]),
        )
        assert tuple(measure[i, j] for measure in together) == alone


def test_global_sensitivity_is_that_of_the_most_sensitive():
    parents = np.zeros((3, 1))
    offspring = np.array([[[1.0], [2.0]], [[-5.0], [1.0]], [[np.nan], [np.nan]]])
    assert landscape.global_sensitivity(parents, offspring) == 5.0
    # Means of 1 and 2, of 5 and 1; the third genotype has no offspring to measure.
    assert landscape.expected_global_sensitivity(parents, offspring) == pytest.approx((1.5 + 3.0) / 2)


def test_population_evolvability_of_a_line():
    # Mean distance of n equally spaced points over [0, 1]: (n + 1) / 3 / (n - 1).
    line = np.linspace(0, 1, 11)[:, None]
    assert landscape.population_evolvability(line) == pytest.approx(12 / 30)


@pytest.mark.parametrize(
    ("niche", "expected"),
    [([0, 0, 0], 0.1), ([0, 9, 4], 0.3), ([NONE, 3, 3], 0.1), ([10, 10, 2], 0.1), ([NONE, 10, 11], 0.0)],
)
def test_one_hot_evolvability_counts_niches_once_and_no_other_state(niche, expected):
    assert landscape.one_hot_evolvability(niche, 10) == pytest.approx(expected)


def test_one_hot_evolvability_of_several():
    niche = np.array([[[0, 1], [1, 1]], [[2, 5], [NONE, NONE]]])
    np.testing.assert_allclose(landscape.one_hot_evolvability(niche, 4), [[0.5, 0.25], [0.25, 0.0]])


def test_the_ratio_reaches_2_only_for_offspring_on_both_sides():
    both = [[-1.0], [1.0]]
    assert landscape.dissimila_ratio(landscape.evolvability(both), 1.0, 1e-9) == pytest.approx(2.0)
    same = [[1.0], [1.0]]
    assert landscape.dissimila_ratio(landscape.evolvability(same), 1.0) == 0.0
    # Nothing moves: the protected division gives 0, not NaN.
    assert landscape.dissimila_ratio(0.0, 0.0) == 0.0


@pytest.mark.parametrize(
    ("points", "volume"),
    [
        (SQUARE, 4.0),
        (np.concatenate([SQUARE, [[0.0, 0.0], [0.5, 0.5]]]), 4.0),
        (SQUARE + 1e6, 4.0),
        (SQUARE * [1.0, 1e-9], 4e-9),
        (SQUARE @ [[1.0, 1.0], [1e-9, -1e-9]], 8e-9),
        (np.array(list(itertools.product([0.0, 2.0], repeat=3))), 8.0),
        (np.array([[3.0], [-1.0], [0.0]]), 4.0),
        (np.array([[0.0, 0.0], [1.0, 1.0], [0.3, 0.3], [7.0, 7.0]]), 0.0),
        (np.array([[0.1, 0.2], [0.3, 0.6], [0.7, 1.4]]), 0.0),
        (np.repeat([[1.3, 0.7]], 30, axis=0), 0.0),
        (SQUARE[:2], 0.0),
        (SQUARE[:1], 0.0),
    ],
)
def test_hull_volume(points, volume):
    assert landscape.hull_volume(points) == pytest.approx(volume, rel=1e-6, abs=0.0)


@given(st.lists(st.tuples(st.integers(-3, 3), st.integers(-3, 3)), min_size=1, max_size=9), st.booleans())
def test_the_area_of_a_hull_is_that_of_its_corners(points, tilted):
    # Points of a small lattice are often equal, or on one line.
    turn = np.array([[0.6, -0.8], [0.8, 0.6]]) if tilted else np.eye(2)
    area = landscape.hull_volume(np.array(points, float) @ turn)
    assert area == pytest.approx(float(_area(points)), abs=1e-12)


def _area(points):
    """Area of a convex hull, exactly: corners by Andrew's monotone chain, then the shoelace formula."""

    def half(ordered):
        chain = []
        for x, y in ordered:
            while len(chain) > 1 and (chain[-1][0] - chain[-2][0]) * (y - chain[-2][1]) <= (
                chain[-1][1] - chain[-2][1]
            ) * (x - chain[-2][0]):
                chain.pop()
            chain.append((x, y))
        return chain[:-1]

    ordered = sorted(set(points))
    corners = half(ordered) + half(ordered[::-1])
    pairs = zip(corners, corners[1:] + corners[:1], strict=True)
    return Fraction(sum(a * d - b * c for (a, b), (c, d) in pairs), 2)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: landscape.dissimila_ratio(1.0, 1.0, 0.0), "epsilon is 0.0"),
    ],
)
def test_bad_input_is_one_sentence(call, message):
    with pytest.raises(NichechainError, match=message):
        call()
