"""T of many states: each pixel has the largest of a square of entries, and stands where they would."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

import nichechain as nc
from nichechain.plots import pixels


@pytest.fixture(scope="module")
def chain():
    return nc.NicheChain(np.random.default_rng(0).dirichlet(np.full(7, 0.3), 7))


@pytest.mark.parametrize("at_once", [1, 4, 256])
def test_the_largest_of_each_square(chain, monkeypatch, at_once):
    monkeypatch.setattr(pixels, "_MOST", 3)
    monkeypatch.setattr(pixels, "_ROWS", at_once)
    rows, columns = np.array([6, 0, 2, -1, 5]), np.array([1, 0, 3, 4, 5, 6, 2])
    found, size = pixels.largest_entries(chain, rows, columns)
    assert size == 3
    whole = np.where(rows[:, None] < 0, 0.0, chain.T[rows][:, columns])
    expected = [[whole[i : i + 3, j : j + 3].max() for j in (0, 3, 6)] for i in (0, 3)]
    np.testing.assert_array_equal(found, expected)


def test_few_states_are_all_seen(chain):
    states = np.arange(7)
    found, size = pixels.largest_entries(chain, states, states)
    assert size == 1
    np.testing.assert_array_equal(found, chain.T)


def test_pixels_stand_where_their_entries_would(chain, monkeypatch):
    monkeypatch.setattr(pixels, "_MOST", 3)
    ax = Figure().add_subplot()
    picture, said = pixels.show_entries(ax, chain, np.arange(7), np.arange(7))
    assert said == "a pixel: the largest of 3 × 3 entries"
    # The last pixel begins at state 6, and the axes end with it.
    assert tuple(picture.get_extent()) == (-0.5, 8.5, 8.5, -0.5)
    assert (ax.get_xlim(), ax.get_ylim()) == ((-0.5, 6.5), (6.5, -0.5))


def test_an_estimated_chain_is_never_a_whole_matrix(arm_archive, monkeypatch):
    chain, states = arm_archive.chain(), np.arange(10)
    expected = np.asarray(arm_archive.chain().T)[:10, :10]
    monkeypatch.setattr(type(chain), "T", property(lambda _: pytest.fail("T was made")))
    found, _ = pixels.largest_entries(chain, states, states)
    np.testing.assert_allclose(found, expected, rtol=1e-12)
