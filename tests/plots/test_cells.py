"""Niches as patches: Voronoi cells that fill the box, strips of one axis, what is refused."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.path import Path as Outline

import nichechain as nc
from nichechain import plots
from nichechain.chain.structure.wormholes import wormholes
from nichechain.core.errors import NichechainError
from nichechain.evolvability.reach import reach
from nichechain.niches import CVTNiches, GridNiches
from nichechain.plots.cells import borders, cells_along, fill, frame, hatch, voronoi_cells

from ..niches.spaces import build, config

BOX = ((1.0, 1.5), (0.4, 1.1))


def _area(corners):
    x, y = corners.T
    return 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))


@pytest.fixture
def ax():
    return Figure().add_subplot()


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    root = tmp_path_factory.mktemp("cells")
    asked = {
        "cvt": config(2, shape=(40,), niches="cvt"),
        "line": config(1, shape=(12,)),
        "cvt line": config(1, shape=(12,), niches="cvt"),
        "space": config(3, shape=(3, 3, 3)),
    }
    return {name: build(root / name.replace(" ", "-"), one) for name, one in asked.items()}


@pytest.mark.parametrize("number", [1, 2, 3, 40])
def test_voronoi_cells_fill_the_box_and_hold_their_niche(number):
    rng = np.random.default_rng(number)
    lower, upper = np.array(BOX).T
    niches = CVTNiches(rng.uniform(lower, upper, (number, 2)), BOX)
    cells = voronoi_cells(niches)
    assert sum(map(_area, cells)) == pytest.approx(0.5 * 0.7)
    points = rng.uniform(lower, upper, (500, 2))
    state = niches.of(points)
    for niche, corners in enumerate(cells):
        # No point of another niche; those of its own, but for rounding at borders.
        inside = Outline(corners).contains_points(points)
        assert (state[inside] == niche).all()
        assert inside.sum() == (state == niche).sum()


def test_a_centroid_on_the_edge_has_a_cell():
    cells = voronoi_cells(CVTNiches([[1.0, 0.4], [1.5, 1.1]], BOX))
    assert [_area(corners) for corners in cells] == pytest.approx([0.175, 0.175], rel=1e-6)


def test_colours_are_those_of_the_niches(ax):
    niches = CVTNiches([[1.1, 0.5], [1.4, 0.5], [1.2, 1.0]], BOX)
    cells = fill(ax, niches, [3.0, np.nan, 5.0], "viridis")
    np.testing.assert_array_equal(cells.get_array().filled(-1), [3, -1, 5])
    assert cells.get_clim() == (3.0, 5.0)
    hatched = hatch(ax, niches, np.array([False, True, True]), "white")
    assert len(hatched.get_paths()) == 2
    borders(ax, niches)
    assert len(ax.collections[-1].get_paths()) == 3
    frame(ax, niches, 2)
    np.testing.assert_array_equal(ax.patches[0].get_xy()[:-1], voronoi_cells(niches)[2])


def test_a_strip_has_the_niches_in_the_order_of_their_places(ax):
    niches = CVTNiches([[2.5], [0.5], [1.5]], ((0.0, 3.0),))
    mesh = fill(ax, niches, [25.0, 5.0, 15.0], "viridis")
    np.testing.assert_array_equal(mesh.get_array(), [[5, 15, 25]])
    np.testing.assert_array_equal(mesh.get_coordinates()[0, :, 0], [0, 1, 2, 3])
    frame(ax, niches, 0)
    assert ax.patches[0].get_bbox().extents.tolist() == [2, 0, 3, 1]
    mesh = fill(ax, GridNiches((3,), ((0.0, 3.0),)), [5.0, 15.0, 25.0], "viridis")
    np.testing.assert_array_equal(mesh.get_array(), [[5, 15, 25]])


def test_cells_along_an_axis():
    assert cells_along(GridNiches((4, 7), BOX)) == 7
    assert cells_along(CVTNiches.tessellated(50, BOX)) == 7


def _draw(kind, archive, ax):
    chain = archive.chain()
    match kind:
        case "elites":
            plots.plot_elites(archive, ax)
        case "visits":
            plots.plot_visits(archive, ax)
        case "evolvability" | "uncertainty":
            scores = nc.niche_evolvability(chain, l=2, lineages=5, draws=3)
            getattr(plots, f"plot_{kind}")(archive, scores, ax)
        case "reach":
            niche = int(archive.elites.niche[1])
            plots.plot_reach(archive, reach(chain, niche=niche, l=2, lineages=5, draws=2), ax, niche=niche)
        case "classes":
            plots.plot_classes(archive, archive.chain("mle"), ax)
        case "transitions":
            plots.plot_transitions(archive, chain, ax)
        case "transitions-by-class":
            from nichechain.plots.classes import plot_transitions_by_class

            plot_transitions_by_class(archive, archive.chain("mle"), ax)
        case "reachability":
            plots.plot_reachability(archive, chain, ax, threshold=0.01)
        case "wormholes":
            plots.plot_wormholes(archive, wormholes(chain), ax)


MAPS = ("elites", "visits", "evolvability", "uncertainty", "reach", "classes")
MATRICES = ("transitions", "transitions-by-class")
GRAPHS = ("reachability", "wormholes")


@pytest.mark.parametrize("kind", [*MAPS, *MATRICES, *GRAPHS])
@pytest.mark.parametrize("name", ["cvt", "line", "cvt line", "space"])
def test_every_picture_is_drawn_or_says_why_not(archives, name, kind, ax):
    archive = archives[name]
    axes = len(archive.niches.bounds)
    drawable = kind in MATRICES or axes == 2 or (axes == 1 and kind in MAPS)
    if drawable:
        _draw(kind, archive, ax)
        ax.figure.canvas.draw()
        assert ax.get_title()
    else:
        over = "2" if kind in GRAPHS else "1 or 2"
        with pytest.raises(
            NichechainError, match=f"behavior has {axes} axes, but this is drawn over {over}: growth"
        ):
            _draw(kind, archive, ax)


def test_a_matrix_over_a_tessellation_is_in_the_order_of_the_first_axis(archives, ax):
    archive = archives["cvt"]
    chain = archive.chain("mle")
    plots.plot_transitions(archive, chain, ax)
    shown = np.ma.filled(ax.images[0].get_array(), 0.0)
    along = np.append(archive.niches.centers[:, 0], np.inf)
    rows, columns = np.flatnonzero(archive.counts.births), np.flatnonzero(archive.counts.visits)
    rows, columns = rows[np.argsort(along[rows])], columns[np.argsort(along[columns])]
    expected = chain.T.toarray()[rows][:, columns]
    np.testing.assert_array_equal(shown, np.where(expected < 1e-3, 0.0, expected))


def test_visits_over_a_tessellation_are_births(archives, ax):
    archive = archives["cvt"]
    plots.plot_visits(archive, ax)
    births = archive.births()["child_niche"].value_counts()
    shown = ax.collections[0].get_array().filled(0)
    np.testing.assert_array_equal(shown, [births.get(niche, 0) for niche in range(40)])
