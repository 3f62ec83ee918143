"""Voronoi niches, against pyribs' CVTArchive and by brute force."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nichechain import BuildConfig, GridNiches, NichechainError
from nichechain.niches import CVTNiches, Niches, parse_niches
from nichechain.search.making import check_niches, make_niches

BOXES = {
    "line": ((-0.1, 0.2),),
    "table": ((1.05, 1.55), (0.40, 1.10)),
    "space": ((-1.0, 1.0), (0.0, 0.3), (10.0, 11.0)),
    "ten": ((0.0, 1.0),) * 10,
}
FOUR = ((0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75))
UNIT = ((0.0, 1.0), (0.0, 1.0))


def _cvt(name, number=60, outside="state"):
    lower, upper = np.array(BOXES[name]).T
    centroids = np.random.default_rng(7).uniform(lower, upper, (number, len(lower)))
    return CVTNiches(centroids, BOXES[name], outside)


def _pyribs(niches):
    from ribs.archives import CVTArchive

    return CVTArchive(
        solution_dim=1, centroids=niches.centroids, ranges=niches.bounds, measures_dtype=np.float64
    )


@pytest.mark.parametrize("name", BOXES)
def test_of_is_pyribs_index_of_wherever_the_point(name):
    niches = _cvt(name, outside="clip")
    span = niches.upper - niches.lower
    rng = np.random.default_rng(1)
    points = rng.uniform(niches.lower - span, niches.upper + span, (20_000, span.size))
    np.testing.assert_array_equal(niches.of(points), _pyribs(niches).index_of(points))


@pytest.mark.parametrize("name", BOXES)
def test_of_is_the_nearest_centroid_or_outside(name):
    niches = _cvt(name)
    span = niches.upper - niches.lower
    points = np.random.default_rng(2).uniform(
        niches.lower - 0.2 * span, niches.upper + 0.2 * span, (500, span.size)
    )
    distance = ((points[:, None] - niches.centroids) ** 2).sum(axis=2)
    inside = ((points >= niches.lower) & (points <= niches.upper)).all(axis=1)
    np.testing.assert_array_equal(niches.of(points), np.where(inside, distance.argmin(axis=1), 60))


@pytest.mark.parametrize("name", BOXES)
def test_every_centroid_lies_in_its_own_niche(name):
    niches = _cvt(name)
    np.testing.assert_array_equal(niches.of(niches.centers), np.arange(60))


def test_both_ends_of_the_bounds_are_inside_and_nothing_beyond():
    corners = [(x, y) for x in (0.0, 1.0) for y in (0.0, 1.0)]
    beyond = [(np.nextafter(1.0, 2.0), 0.9), (-1e300, 1e300)]
    for outside, there in (("state", [4, 4]), ("absorb", [4, 4])):
        niches = CVTNiches(FOUR, UNIT, outside)
        assert niches.of(corners).tolist() == [0, 1, 2, 3]
        assert niches.of(beyond).tolist() == there
        assert (niches.states, len(niches)) == (5, 4)
    clip = CVTNiches(FOUR, UNIT, "clip")
    assert clip.states == 4
    assert clip.of(beyond)[0] == 3
    assert 0 <= clip.of(beyond)[1] < 4


def test_a_tessellation_is_a_function_of_its_seed_and_fills_the_box():
    box = BOXES["table"]
    first, again, other = (CVTNiches.tessellated(40, box, seed=seed) for seed in (3, 3, 4))
    assert first == again
    assert hash(first) == hash(again)
    assert first != other
    # Cells of about equal size: uniform points fall in each alike. k-means evens volumes out to a
    # fifth or so, where random centroids' volumes have a coefficient of variation of about 1/2.
    points = np.random.default_rng(0).uniform(first.lower, first.upper, (40_000, 2))
    volume = np.bincount(first.of(points), minlength=40) / 40_000
    assert volume.std() / volume.mean() < 0.2
    # Each centroid is the mean of its cell: what makes a tessellation centroidal.
    state = first.of(points)
    means = np.array([points[state == k].mean(axis=0) for k in range(40)])
    assert np.abs(means - first.centroids).max() < 0.015


def test_in_one_dimension_niches_are_equal_pieces():
    niches = CVTNiches.tessellated(4, ((0.0, 8.0),))
    np.testing.assert_allclose(np.sort(niches.centroids.ravel()), [1, 3, 5, 7], atol=0.35)


def test_niches_have_numbers():
    niches = CVTNiches(FOUR, UNIT)
    assert [niches.flat(2), niches.flat((2,)), niches.flat(np.int64(2))] == [2, 2, 2]
    assert niches.index(3) == (3,)
    assert [niches.label(2), niches.label(4)] == ["2", "outside"]
    assert isinstance(niches, Niches)
    assert isinstance(GridNiches((2,), ((0, 1),)), Niches)


@pytest.mark.parametrize(
    ("niche", "message"),
    [
        (4, "niche is 4, but there are niches 0 to 3"),
        (-1, "niche is -1"),
        ((1, 2), r"niche is \(1, 2\), but niches of a tessellation have one number"),
        (1.5, "niche is 1.5, but niches of a tessellation"),
    ],
)
def test_flat_refuses(niche, message):
    with pytest.raises(NichechainError, match=message):
        CVTNiches(FOUR, UNIT).flat(niche)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.empty((0, 2)), UNIT), r"shape \(0, 2\)"),
        ((FOUR, ((0, 1),)), r"shape \(4, 2\), but must be \(n, 1\)"),
        ((FOUR, ((0, 1), (1, 1))), "finite and increasing"),
        ((FOUR, UNIT, "drop"), "outside is 'drop'"),
        ((((0.5, 0.5), (0.5, 1.5)), UNIT), "centroid 1 is at 0.5, 1.5, which is out of bounds"),
        ((((0.5, np.nan),), UNIT), "centroid 0 is at 0.5, nan, which is out of bounds"),
        ((((0.5, 0.5), (0.5, 0.5)), UNIT), "two centroids are the same"),
    ],
)
def test_a_tessellation_refuses(arguments, message):
    with pytest.raises(NichechainError, match=message):
        CVTNiches(*arguments)


@pytest.mark.parametrize("behavior", [[0.5, 0.5], [[0.5]], [[0.5, np.nan]], [[np.inf, 0.5]]])
def test_of_refuses(behavior):
    with pytest.raises(NichechainError, match="behavior has"):
        CVTNiches(FOUR, UNIT).of(behavior)


def test_equal_niches_put_behaviors_alike():
    niches = CVTNiches(FOUR, UNIT)
    assert niches == pickle.loads(pickle.dumps(niches))
    assert niches != CVTNiches(FOUR, UNIT, "clip")
    assert niches != CVTNiches(FOUR[::-1], UNIT)
    assert niches != GridNiches((2, 2), UNIT)
    with pytest.raises(ValueError, match="read-only"):
        niches.centroids[0] = 0.0


@given(st.integers(1, 30), st.integers(1, 4), st.integers(0, 2**20))
@settings(deadline=None, max_examples=20)
def test_of_agrees_with_pyribs_for_any_number_and_axes(number, axes, seed):
    rng = np.random.default_rng(seed)
    niches = CVTNiches(rng.random((number, axes)), ((0.0, 1.0),) * axes, "clip")
    points = rng.normal(size=(50, axes))
    np.testing.assert_array_equal(niches.of(points), _pyribs(niches).index_of(points))


def test_what_a_configuration_says_makes_the_niches_again():
    config = BuildConfig("arm", (30,), UNIT, niches="cvt", niches_seed=5, outside="absorb")
    made = make_niches(config)
    assert made == CVTNiches.tessellated(30, UNIT, seed=5, outside="absorb")
    assert made.settings() == {"niches": "cvt", "shape": (30,), "bounds": UNIT, "outside": "absorb"}
    kept = make_niches(config, made.centers[::-1])
    np.testing.assert_array_equal(kept.centers, made.centers[::-1])
    with pytest.raises(NichechainError, match="there are 29 centroids, but must be 30"):
        make_niches(config, made.centers[1:])
    grid = GridNiches((3, 4), UNIT, "clip")
    assert make_niches(BuildConfig("arm", **grid.settings())) == grid


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"bounds": ((0, 1), (1, 0))}, "finite and increasing"),
        ({"outside": "drop"}, "outside is 'drop'"),
    ],
)
@pytest.mark.parametrize("kind", ["grid", "cvt"])
def test_a_configuration_is_checked_without_a_tessellation(kind, values, message):
    shape = (3, 3) if kind == "grid" else (10**9,)
    with pytest.raises(NichechainError, match=message):
        check_niches(BuildConfig("arm", **{"shape": shape, "bounds": UNIT, "niches": kind, **values}))


@pytest.mark.parametrize("text", ["400", "cvt", "cvt:", "cvt:0", "cvt:-3", "cvt:2.5", "grid:20x20", "CVT:4"])
def test_parse_niches_refuses(text):
    with pytest.raises(NichechainError, match="must be cvt and a number of niches such as cvt:400"):
        parse_niches(text)


def test_parse_niches():
    assert parse_niches("cvt:400") == 400
