import copy
import io
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import nichechain as nc
from nichechain import plots
from nichechain.archive import import_births
from nichechain.core.errors import NichechainError
from nichechain.niches import GridNiches
from nichechain.plots.style import LONG_JUMP, behavior_axes, plain, without_outliers


@pytest.fixture(scope="module")
def archive(arm_archive):
    return arm_archive


@pytest.fixture
def ax():
    return Figure().add_subplot()


def drawn(ax):
    """Values of the map, as (x, y)."""
    return ax.collections[0].get_array().T


def test_visits_shows_births_where_they_are(archive, ax):
    assert plots.plot_visits(archive, ax) is ax
    values = drawn(ax)
    assert values.shape == (6, 9)
    births = archive.births()
    for index in ((0, 4), (5, 4), (3, 8)):
        expected = int((births["child_niche"] == 9 * index[0] + index[1]).sum())
        assert np.ma.filled(values[index], 0) == expected


def test_axes_are_behavior_in_its_unit(archive, ax):
    plots.plot_elites(archive, ax)
    assert ax.get_xlabel() == "x (arm lengths)"
    assert ax.get_xlim() == (-1, 1)
    assert ax.get_aspect() == 1
    (start,) = [line for line in ax.lines if line.get_label() == "start"]
    assert start.get_xydata().tolist() == [[1.0, 0.0]]


def test_elites_shows_objectives_and_behaviors(archive, ax):
    plots.plot_elites(archive, ax)
    values = drawn(ax)
    elite = archive.elite(int(archive.elites.niche[3]))
    assert values[elite.niche] == elite.objective
    assert np.ma.count(values) == archive.filled


def test_colors_leave_out_objectives_that_are_far_from_all_others(archive, ax, monkeypatch):
    objective = np.linspace(-1.0, 1.0, len(archive.elites))
    objective[[2, 5]] = 1e4, 2e4
    monkeypatch.setattr(archive, "elites", replace(archive.elites, objective=objective))
    plots.plot_elites(archive, ax)
    assert ax.collections[0].get_clim() == (-1.0, 1.0)
    labels = [child.get_ylabel() for child in ax.child_axes]
    assert any(label.endswith("\n2 higher, up to 20,000") for label in labels)


def test_values_without_outliers():
    rng = np.random.default_rng(0)
    values = rng.uniform(2.0, 3.0, 100)
    ends = values.min(), values.max()
    assert without_outliers(values) == ends
    assert without_outliers(np.concatenate([values, [-90.0, 40.0, np.nan, np.inf]])) == ends
    # Of two values the rare one is no outlier.
    assert without_outliers(np.array([0.0] * 9 + [1.0])) == (0.0, 1.0)
    assert without_outliers(np.full(3, np.nan)) == (None, None)


def test_a_log_has_no_elites_to_draw(tmp_path, ax):
    frame = pd.DataFrame({"parent_niche": [0, 0], "child_niche": [1, 2]})
    import_births(frame, tmp_path / "log", GridNiches((2, 2), ((0, 1), (0, 1))))
    with pytest.raises(NichechainError, match="log has no elites to draw: births of a log were imported"):
        plots.plot_elites(nc.load(tmp_path / "log"), ax)


def test_evolvability_leaves_out_niches_without_births(archive, ax):
    scores = nc.niche_evolvability(archive.chain(), l=2, lineages=5, draws=4)
    plots.plot_evolvability(archive, scores, ax, min_births=10)
    births = archive.counts.births[:54].reshape(6, 9)
    values = drawn(ax)
    assert (np.ma.getmaskarray(values) == (births == 0)).all()
    hatched = ax.collections[1].get_array().T
    assert (~np.ma.getmaskarray(hatched) == ((births > 0) & (births < 10))).all()


def test_transitions_shows_rows_with_births(archive, ax):
    chain = archive.chain("mle")
    plots.plot_transitions(archive, chain, ax)
    picture = ax.images[0].get_array()
    rows, columns = np.flatnonzero(archive.counts.births), np.flatnonzero(archive.counts.visits)
    assert picture.shape == (rows.size, columns.size)
    dense = chain.T.toarray()
    assert picture[4, 7] == dense[rows[4], columns[7]] or dense[rows[4], columns[7]] < 1e-3


def test_reachability_has_an_arrow_per_observed_transition(archive, ax):
    chain = archive.chain()
    plots.plot_reachability(archive, chain, ax, threshold=0.05, most=10_000)
    dense = np.asarray(chain.T)
    counts = archive.counts.matrix.toarray()
    n = len(archive.niches)
    wanted = (dense >= 0.05) & (counts > 0)
    np.fill_diagonal(wanted, False)
    start = archive.niches.of([[1.0, 0.0]])[0]
    # What many lead to, and the start, are ringed, with the number of niches that do.
    leading = wanted[:n, :n].sum(axis=0)
    sinks = set(np.flatnonzero(leading >= 10)) | ({start} if leading[start] else set())
    assert len(ax.patches) == leading.sum() - sum(leading[list(sinks)])
    rings = [note.get_text() for note in ax.texts]
    assert sorted(rings) == sorted(str(leading[sink]) for sink in sinks)
    graph = chain.graph(0.05)
    far = [edge for edge in graph.edges if graph.edges[edge]["long_jump"] and graph.edges[edge]["count"]]
    colors = [matplotlib_color(patch) for patch in ax.patches]
    assert colors.count(LONG_JUMP) == sum(child not in sinks for _, child in far) > 0


def test_reachability_draws_the_strongest_and_says_so(archive, ax):
    chain = archive.chain()
    plots.plot_reachability(archive, chain, ax, most=7)
    assert len(ax.patches) == 7
    rings = sum(int(note.get_text()) for note in ax.texts)
    edges = [
        (i, j)
        for i, j, data in chain.graph().edges(data=True)
        if data["count"] and chain.outside not in (i, j)
    ]
    assert ax.get_title().startswith(f"Reachability: the 7 strongest of {len(edges) - rings} transitions")


def test_figures_make_an_axes_where_none_is_given(archive):
    import matplotlib.pyplot as plt

    drawn = plots.plot_visits(archive)
    assert drawn.get_title().endswith("outside")
    plt.close(drawn.figure)


def matplotlib_color(patch):
    from matplotlib.colors import to_hex

    return to_hex(patch.get_facecolor())


@pytest.mark.parametrize(("names", "strip"), [("xyz", True), ("wxyz", True), ("x", False)])
def test_maps_need_one_or_two_axes_of_behavior(ax, names, strip):
    facts = type("Facts", (), {"behavior_names": tuple(names), "unit": "m"})()
    space = type("Space", (), {"meta": type("Meta", (), {"facts": facts})()})()
    with pytest.raises(NichechainError, match=f"{len(names)} axes"):
        behavior_axes(ax, space, strip=strip)


def test_dollars_in_names_are_no_formulas(archive):
    """An unknown command between two of them would end a figure in a traceback."""
    figure = Figure()
    ax = figure.subplots()
    name = r"$\frac{$x$"
    ax.set_xlabel(plain(name))
    figure.canvas.draw()
    assert ax.xaxis.label.get_text().replace("\\$", "$") == name
    behavior_axes(ax, archive)
    assert "$" not in ax.get_xlabel()


def test_axes_of_very_different_length_are_not_to_scale(archive, ax):
    wide = copy.copy(archive)
    wide.niches = nc.GridNiches(archive.niches.shape, ((-1.0, 1.0), (-0.9, 1e19)))
    plots.plot_visits(wide, ax)
    assert ax.get_aspect() == "auto"
    ax.figure.savefig(io.BytesIO())
