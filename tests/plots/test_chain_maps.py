"""Reach, uncertainty, classes and wormholes as pictures."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from scipy.sparse.csgraph import connected_components

import nichechain as nc
from nichechain.chain.structure.wormholes import wormholes
from nichechain.core.errors import NichechainError
from nichechain.evolvability.reach import reach
from nichechain.plots.classes import plot_classes, plot_transitions_by_class
from nichechain.plots.graphs import plot_wormholes
from nichechain.plots.maps import plot_reach, plot_uncertainty
from nichechain.plots.style import LONG_JUMP


@pytest.fixture(scope="module")
def archive(arm_archive):
    return arm_archive


@pytest.fixture
def ax():
    return Figure().add_subplot()


def drawn(ax):
    """Values of the map, as (x, y)."""
    return ax.collections[0].get_array().T


def words(ax):
    return [entry.get_text() for entry in ax.get_legend().get_texts()]


def test_reach_shows_where_lineages_go(archive, ax):
    chain = archive.chain("mle")
    found = reach(chain, niche=(2, 4), l=3, lineages=20)
    assert plot_reach(archive, found, ax, niche=(2, 4)) is ax
    np.testing.assert_allclose(drawn(ax), found.at_least_one.reshape(6, 9))
    expected = nc.l_evolvability(chain, niche=(2, 4), l=3, lineages=20).value
    assert ax.get_title() == f"Reach from niche 2,4 in 3 generations: {expected:.1f} niches"
    for frame in ax.patches:
        assert frame.get_xy() == pytest.approx((-1 + 2 / 3, -1 + 8 / 9))
    assert ax.get_legend().get_title().get_text().startswith(chain.estimator)


def test_uncertainty_shows_the_width_of_the_interval(archive, ax):
    scores = nc.niche_evolvability(archive.chain(), l=2, lineages=5, draws=6)
    plot_uncertainty(archive, scores, ax)
    births = archive.counts.births[:54].reshape(6, 9)
    values = drawn(ax)
    assert (np.ma.getmaskarray(values) == (births == 0)).all()
    width = (scores.high - scores.low).reshape(6, 9)
    np.testing.assert_allclose(values.compressed(), width[births > 0])


def test_a_given_matrix_has_no_uncertainty(archive, ax):
    scores = nc.niche_evolvability(archive.chain("mle"), l=2, lineages=5)
    with pytest.raises(NichechainError, match="no interval"):
        plot_uncertainty(archive, scores, ax)


def components(archive, threshold):
    """Strong components of the states that were a parent, by SciPy on observed shares."""
    matrix = archive.counts.matrix.toarray()
    shares = matrix / np.maximum(1, matrix.sum(axis=1, keepdims=True))
    _, label = connected_components(shares > threshold, connection="strong")
    return label


@pytest.mark.parametrize("threshold", [0.0, 0.1])
def test_classes_have_one_colour_each(archive, ax, threshold):
    plot_classes(archive, archive.chain("mle"), ax, threshold=threshold)
    label = components(archive, threshold)[:54]
    code = drawn(ax).filled(-1).reshape(-1)
    sizes = np.bincount(components(archive, threshold))
    assert ax.get_title() == f"Communicating classes: {(sizes > 1).sum()} of several states"
    largest = label == np.argmax(sizes)
    assert (code[largest] == 0).all()
    assert (code[~largest] != 0).all()
    births, visits = archive.counts.births[:54], archive.counts.visits[:54]
    assert (code[(visits == 0) & (births == 0)] == -1).all()
    never = (visits > 0) & (births == 0)
    assert (code[never] == 8).all()
    alone = (sizes[label] == 1) & (births > 0)
    assert (code[alone] == 7).all()
    assert (f"a class alone: {alone.sum()}" in words(ax)) == alone.any()


@pytest.mark.parametrize("threshold", [0.0, 0.1])
def test_matrix_in_the_order_of_classes(archive, ax, threshold):
    chain = archive.chain("mle")
    plot_transitions_by_class(archive, chain, ax, threshold=threshold)
    picture = ax.images[0].get_array()
    seen = (archive.counts.visits > 0) | (archive.counts.births > 0)
    assert picture.shape == (seen.sum(), seen.sum())
    # A reordering keeps the row with its diagonal: the traces agree.
    dense = chain.T.toarray()
    known = seen & (archive.counts.births > 0)
    shown = np.where(np.ma.getmaskarray(picture), 0.0, picture.data)
    assert np.trace(shown) == pytest.approx(np.diag(dense)[known & (np.diag(dense) >= 1e-3)].sum())
    assert shown.sum() == pytest.approx(dense[known][dense[known] >= 1e-3].sum())
    sizes = np.bincount(components(archive, threshold)[seen])
    borders = sorted(line.get_ydata()[0] + 0.5 for line in ax.lines if to_hex(line.get_color()) == LONG_JUMP)
    ends = np.cumsum(np.sort(sizes[sizes > 1])[::-1])
    assert {int(border) for border in borders if border > 1} >= set(ends)


def test_threshold_of_classes_is_a_probability(archive, ax):
    with pytest.raises(NichechainError, match="threshold is 1"):
        plot_classes(archive, archive.chain("mle"), ax, threshold=1.0)


def test_wormholes_are_arrows_between_centres(archive, ax):
    found = wormholes(archive.chain(), times=1.0, expected_false=8.0)
    flagged = found[found["wormhole"]]
    assert len(flagged)
    assert plot_wormholes(archive, found, ax) is ax
    assert len(ax.patches) == len(flagged)
    centers = archive.niches.centers
    ends = {(*centers[row.parent], *centers[row.child]) for row in flagged.itertuples()}
    assert {(*a, *b) for a, b in (arrow._posA_posB for arrow in ax.patches)} == ends
    dotted = [arrow for arrow in ax.patches if arrow.get_linestyle() == ":"]
    assert len(dotted) == flagged["singleton"].sum()
    assert ax.get_title() == f"Wormholes: {len(flagged)} of {len(found)} observed transitions"


def test_no_wormholes_is_a_picture_too(archive, ax):
    found = wormholes(archive.chain(), times=1e6, expected_false=0.0)
    assert not found["wormhole"].any()
    assert isinstance(found, pd.DataFrame)
    plot_wormholes(archive, found, ax)
    assert not ax.patches
    ax.get_figure().canvas.draw()


def test_labels_of_wormholes_keep_off_each_other():
    archive = nc.load("fetch-pick-and-place")
    ax = plot_wormholes(archive, wormholes(archive.chain(), beyond="both"), Figure().subplots())
    labels = [text for text in ax.texts if "/" in text.get_text()]
    assert len(labels) > 2
    size = np.array([0.5, 0.7]) * (0.15, 0.035)
    places = np.array([label.get_position() if label.xyann is None else label.xyann for label in labels])
    apart = (np.abs(places[:, None] - places[None]) / size).max(axis=2)
    assert apart[~np.eye(len(labels), dtype=bool)].min() >= 1.0
