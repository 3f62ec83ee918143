"""Maps of landscape measures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from nichechain import BuildConfig, NichechainError, Threads, build, load
from nichechain.landscape import measure_archive
from nichechain.plots.landscape import MAPS, plot_landscape, plot_measure

ARM = BuildConfig("arm", (6, 5), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=300, initial=50, batch=32, scale=0.2)


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    with Threads(1) as executor:
        build(ARM, folder, executor)
    return load(folder)


@pytest.fixture(scope="module")
def measured(archive):
    return measure_archive(archive, 5)


def test_a_niche_has_the_colour_of_its_elite(archive, measured):
    ax = Figure().add_subplot()
    plot_measure(archive, measured, ax, "expected-evolvability")
    (mesh,) = ax.collections
    shown = np.ma.filled(mesh.get_array().reshape(5, 6), np.nan).T.ravel()
    inside = measured.state < 30
    expected = np.full(30, np.nan)
    expected[measured.state[inside]] = measured.measures.expected_evolvability[inside]
    np.testing.assert_array_equal(shown, expected)
    assert ax.get_title() == "Expected evolvability, η*"


def test_dissimila_are_marked_on_their_ratio_alone(archive, measured):
    ax = Figure().add_subplot()
    plot_measure(archive, measured, ax, "expected_ratio")
    marks = [line for line in ax.lines if line.get_label().startswith("dissimila")]
    flagged = measured.state[measured.dissimila.dissimila]
    np.testing.assert_allclose(marks[0].get_xydata(), archive.niches.centers[flagged[flagged < 30]])
    ax = Figure().add_subplot()
    plot_measure(archive, measured, ax, "ratio")
    assert not any(line.get_label().startswith("dissimila") for line in ax.lines)


def test_neutral_elites_have_no_ratio(archive, measured):
    offspring = measured.offspring.copy()
    offspring[0] = measured.parent[0]
    still = replace(measured, offspring=offspring)
    for measure, shown in (("expected_ratio", False), ("ratio", False), ("evolvability", True)):
        ax = Figure().add_subplot()
        plot_measure(archive, still, ax, measure)
        x, y = np.unravel_index(measured.state[0], (6, 5))
        assert (~np.ma.getmaskarray(ax.collections[-1].get_array()).reshape(5, 6)[y, x]) == shown


@pytest.mark.parametrize(("measures", "panels"), [(MAPS, 6), (("hull-volume",), 1), (MAPS[:4], 4)])
def test_small_multiples(archive, measured, measures, panels):
    figure = Figure()
    plot_landscape(archive, measured, figure, measures)
    titled = [ax for ax in figure.axes if ax.get_title()]
    assert len(titled) == panels
    # The names of the axes are at the left and below, and only there.
    assert [bool(ax.get_ylabel()) for ax in titled] == [number % 3 == 0 for number in range(panels)]
    assert [bool(ax.get_xlabel()) for ax in titled] == [number + 3 >= panels for number in range(panels)]


def test_a_measure_that_there_is_not(archive, measured):
    with pytest.raises(NichechainError, match="no measure 'height'"):
        plot_landscape(archive, measured, Figure(), ["height"])
