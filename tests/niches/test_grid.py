"""Grid niches, against pyribs' GridArchive and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nichechain import GridNiches, NichechainError
from nichechain.niches import parse_bounds, parse_niche, parse_shape

GRIDS = [
    ((20, 20), ((1.05, 1.55), (0.40, 1.10))),
    ((7, 3, 5), ((-1.0, 1.0), (0.0, 0.3), (100.0, 1000.0))),
    ((50,), ((-0.1, 0.2),)),
    ((1, 4), ((0.0, 1.0), (0.0, 1.0))),
]
# x: [0, 4) in four cells; y: [0, 2] in two cells. Niche = 2·x + y.
SMALL = ((4, 2), ((0.0, 4.0), (0.0, 2.0)))


def _pyribs(shape, bounds):
    from ribs.archives import GridArchive

    return GridArchive(solution_dim=1, dims=shape, ranges=bounds, measures_dtype=np.float64)


def _edges(shape, bounds):
    """Every corner of every cell, and its nearest floating-point neighbours, kept inside the bounds."""
    axes = [np.linspace(low, high, k + 1) for k, (low, high) in zip(shape, bounds, strict=True)]
    corners = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(shape))
    lower, upper = np.array(bounds).T
    near = [corners, np.nextafter(corners, -np.inf), np.nextafter(corners, np.inf)]
    return np.clip(np.concatenate(near), lower, upper)


@pytest.mark.parametrize(("shape", "bounds"), GRIDS)
def test_of_agrees_with_pyribs_on_random_points(shape, bounds):
    lower, upper = np.array(bounds).T
    points = np.random.default_rng(1).uniform(lower, upper, (20_000, len(shape)))
    np.testing.assert_array_equal(
        GridNiches(shape, bounds).of(points), _pyribs(shape, bounds).index_of(points)
    )


@pytest.mark.parametrize(("shape", "bounds"), GRIDS)
def test_of_agrees_with_pyribs_on_cell_edges(shape, bounds):
    points = _edges(shape, bounds)
    np.testing.assert_array_equal(
        GridNiches(shape, bounds).of(points), _pyribs(shape, bounds).index_of(points)
    )


@pytest.mark.parametrize(("shape", "bounds"), GRIDS)
def test_clip_agrees_with_pyribs_beyond_the_bounds(shape, bounds):
    lower, upper = np.array(bounds).T
    span = upper - lower
    points = np.random.default_rng(2).uniform(lower - span, upper + span, (20_000, len(shape)))
    niches = GridNiches(shape, bounds, "clip")
    np.testing.assert_array_equal(niches.of(points), _pyribs(shape, bounds).index_of(points))


@pytest.mark.parametrize(
    ("point", "niche"),
    [
        ((0.0, 0.0), 0),
        ((0.5, 1.5), 1),
        ((1.0, 0.5), 2),
        ((3.5, 0.5), 6),
        ((4.0, 2.0), 7),
        ((4.0, 0.0), 6),
        ((0.0, 2.0), 1),
    ],
)
@pytest.mark.parametrize("outside", ["state", "absorb", "clip"])
def test_both_ends_of_the_bounds_are_inside(point, niche, outside):
    assert GridNiches(*SMALL, outside).of([point]).tolist() == [niche]


@pytest.mark.parametrize(
    ("point", "clipped"),
    [
        ((np.nextafter(4.0, 5.0), 0.5), 6),
        ((np.nextafter(0.0, -1.0), 0.5), 0),
        ((2.5, 99.0), 5),
        ((2.5, -99.0), 4),
        ((-1.0, 3.0), 1),
        # pyribs would cast these to an index before clipping, and wrap around.
        ((1e300, -1e300), 6),
    ],
)
def test_out_of_bounds_by_however_little(point, clipped):
    assert GridNiches(*SMALL, "state").of([point]).tolist() == [8]
    assert GridNiches(*SMALL, "absorb").of([point]).tolist() == [8]
    assert GridNiches(*SMALL, "clip").of([point]).tolist() == [clipped]


def test_states_count_the_outside_where_there_is_one():
    sizes = {mode: GridNiches(*SMALL, mode).states for mode in ("state", "absorb", "clip")}
    assert sizes == {"state": 9, "absorb": 9, "clip": 8}
    assert {len(GridNiches(*SMALL, mode)) for mode in ("state", "absorb", "clip")} == {8}


def test_no_behaviors_belong_to_no_niches():
    assert GridNiches(*SMALL).of(np.empty((0, 2))).shape == (0,)


@pytest.mark.parametrize(
    ("behavior", "message"),
    [
        ([0.5, 0.5], r"shape \(2,\)"),
        ([[0.5]], r"shape \(1, 1\)"),
        ([[0.5, 0.5, 0.5]], r"shape \(1, 3\)"),
        ([[0.5, np.nan]], "NaN or infinite"),
        ([[np.inf, 0.5]], "NaN or infinite"),
    ],
)
def test_of_refuses(behavior, message):
    with pytest.raises(NichechainError, match=message):
        GridNiches(*SMALL).of(behavior)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((), ()), "at least 1 cell"),
        (((0, 2), ((0, 1), (0, 1))), "at least 1 cell"),
        (((2, -2), ((0, 1), (0, 1))), "at least 1 cell"),
        (((2, 2), ((0, 1),)), "2 axes but bounds have 1"),
        (((2,), ((1, 1),)), "finite and increasing"),
        (((2,), ((2, 1),)), "finite and increasing"),
        (((2,), ((0, np.inf),)), "finite and increasing"),
        (((2,), ((np.nan, 1),)), "finite and increasing"),
        (((2,), ((0, 1),), "drop"), "outside is 'drop'"),
    ],
)
def test_a_grid_refuses(arguments, message):
    with pytest.raises(NichechainError, match=message):
        GridNiches(*arguments)


def test_centers_by_hand():
    expected = [(x, y) for x in (0.5, 1.5, 2.5, 3.5) for y in (0.5, 1.5)]
    np.testing.assert_allclose(GridNiches(*SMALL).centers, expected, rtol=1e-15)


@pytest.mark.parametrize(("shape", "bounds"), GRIDS)
def test_every_center_lies_in_its_own_niche(shape, bounds):
    niches = GridNiches(shape, bounds)
    np.testing.assert_array_equal(niches.of(niches.centers), np.arange(len(niches)))


@given(st.lists(st.integers(1, 6), min_size=1, max_size=4).map(tuple))
def test_flat_and_index_are_inverse(shape):
    niches = GridNiches(shape, ((0.0, 1.0),) * len(shape))
    indices = [niches.index(flat) for flat in range(len(niches))]
    assert [niches.flat(index) for index in indices] == list(range(len(niches)))
    # C order: the last axis runs fastest.
    assert indices == list(np.ndindex(shape))


def test_names_of_niches():
    niches = GridNiches(*SMALL)
    assert niches.flat((2, 1)) == niches.flat(5) == niches.flat(np.int64(5)) == 5
    assert niches.index(5) == (2, 1)
    assert niches.label(5) == "2,1"
    assert niches.label(8) == "outside"
    assert niches.as_grid(np.arange(8)).tolist() == [[0, 1], [2, 3], [4, 5], [6, 7]]


@pytest.mark.parametrize(
    ("niche", "message"),
    [
        (-1, "niches 0 to 7"),
        (8, "niches 0 to 7"),
        ((4, 0), "0,0 to 3,1"),
        ((0, 2), "0,0 to 3,1"),
        ((-1, 0), "niche is -1,0"),
        ((0,), "2 indices"),
        ((0, 0, 0), "2 indices"),
    ],
)
def test_flat_refuses(niche, message):
    with pytest.raises(NichechainError, match=message):
        GridNiches(*SMALL).flat(niche)


@pytest.mark.parametrize("niche", [(1.5, 0), 2.0, "0,1", None])
def test_flat_refuses_what_is_no_whole_number(niche):
    with pytest.raises(NichechainError, match="niche is"):
        GridNiches(*SMALL).flat(niche)


@pytest.mark.parametrize(
    ("text", "shape"), [("20x20", (20, 20)), ("7", (7,)), ("3X4x5", (3, 4, 5)), (" 2 x 3 ", (2, 3))]
)
def test_parse_shape(text, shape):
    assert parse_shape(text) == shape


@pytest.mark.parametrize("text", ["", "x", "20x", "20x0", "-1x3", "2.5x2", "20,20", "axb"])
def test_parse_shape_refuses(text):
    with pytest.raises(NichechainError, match="shape is"):
        parse_shape(text)


@pytest.mark.parametrize(
    ("text", "bounds"),
    [
        ("1.05,1.55,0.4,1.1", ((1.05, 1.55), (0.4, 1.1))),
        ("-1,1", ((-1.0, 1.0),)),
        ("0, 1e3, -2.5, -1", ((0.0, 1000.0), (-2.5, -1.0))),
    ],
)
def test_parse_bounds(text, bounds):
    assert parse_bounds(text) == bounds


@pytest.mark.parametrize(
    "text",
    ["", "1", "1,2,3", "2,1", "1,1", "0,1,3,2", "0,nan", "nan,1", "0,inf", "-inf,0", "a,b", "0;1", "0,1,"],
)
def test_parse_bounds_refuses(text):
    with pytest.raises(NichechainError, match="bounds is"):
        parse_bounds(text)


@pytest.mark.parametrize(
    ("text", "niche"), [("7,11", (7, 11)), ("151", 151), ("0", 0), ("1, 2,3", (1, 2, 3))]
)
def test_parse_niche(text, niche):
    assert parse_niche(text, "--niche") == niche


@pytest.mark.parametrize("text", ["", "7,", ",7", "7;11", "7.5", "seven", "7x11"])
def test_parse_niche_refuses_and_names_the_option(text):
    with pytest.raises(NichechainError, match="--elite is"):
        parse_niche(text, "--elite")


CORNERS = [[1.55, 1.1], [1.05, 0.4]]


def test_a_bound_in_float32_is_on_the_bound():
    """As pyribs has it, whose archives are float32 where behaviors are."""
    from ribs.archives import GridArchive

    grid = GridNiches((20, 20), ((1.05, 1.55), (0.4, 1.1)))
    short = np.array(CORNERS, np.float32)
    peer = GridArchive(solution_dim=1, dims=grid.shape, ranges=grid.bounds, dtype=np.float32)
    assert grid.of(short).tolist() == [399, 0] == peer.index_of(short).tolist()
    beyond = np.nextafter(short, np.float32([[9, 9], [-9, -9]]))
    assert grid.of(beyond).tolist() == [400, 400]


def test_float64_is_compared_as_it_is():
    grid = GridNiches((20, 20), ((1.05, 1.55), (0.4, 1.1)))
    assert grid.of(CORNERS).tolist() == [399, 0]
    # In float32, 1.1 is larger than it is, and 1.05 smaller.
    assert grid.of(np.array(CORNERS, np.float32).astype(np.float64)).tolist() == [400, 400]


@pytest.mark.parametrize("bounds", [(-1e308, 1e308), (1.0, 1.0 + 2**-52), (0.0, 5e-324)])
def test_bounds_that_numbers_cannot_divide_are_refused(bounds):
    with pytest.raises(NichechainError, match="whose span floating-point numbers cannot divide"):
        GridNiches((2,), (bounds,))
