import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy import sparse

import nichechain as nc
from nichechain.core.errors import NichechainError
from nichechain.evolvability.coverage import coverage_by_generation, expected_coverage
from nichechain.plots.growth import plot_generations, plot_lineages


@pytest.fixture
def ax():
    return Figure().add_subplot()


def random_chain(states, nonzeros, seed):
    rng = np.random.default_rng(seed)
    matrix = np.zeros((states, states))
    for row in matrix:
        row[rng.choice(states, nonzeros, replace=False)] = rng.dirichlet(np.ones(nonzeros))
    return matrix


@pytest.mark.parametrize("nonzeros", [3, 150])
def test_every_length_is_the_coverage_of_that_length(nonzeros):
    matrix = random_chain(151, nonzeros, 0)
    roots, lineages = [3, 150, 77], [1, 20, 10**9]
    found = coverage_by_generation(sparse.csr_array(matrix), roots, 6, lineages, 150)
    assert found.shape == (3, 6, 3)
    for g in range(1, 7):
        expected = expected_coverage(matrix, matrix[roots], g, lineages, counted=150)
        np.testing.assert_allclose(found[:, g - 1], expected, rtol=1e-12)


def test_golden_of_the_three_state_chain():
    matrix = np.array([[0.5, 0.5, 0], [0, 0.5, 0.5], [0, 0, 1]])
    found = coverage_by_generation(matrix, [0], 2, [1, 2, 10], 3)[0]
    np.testing.assert_allclose(found, [[1, 1.5, 1.998046875], [1.5, 2.125, 2.942708969]], rtol=1e-9)


def test_curves_are_the_values_and_saturated_points_are_hollow(ax):
    # On a cycle, a lineage of l generations visits l niches, and all lineages the same.
    chain = nc.NicheChain(np.roll(np.eye(12), 1, axis=1))
    assert plot_generations(chain, ax, niches=[0, 5], lineages=3, longest=8) is ax
    for line in ax.lines[:1]:
        np.testing.assert_allclose(line.get_xydata(), np.repeat(np.arange(1, 9), 2).reshape(8, 2))
    points = [line for line in ax.lines if line.get_linestyle() == "None"]
    hollow = [line for line in points if line.get_markerfacecolor() == "white"]
    assert [len(line.get_xdata()) for line in hollow] == [8, 8]
    assert any("saturated" in entry.get_text() for entry in ax.get_legend().get_texts())


def test_few_lineages_of_a_wide_chain_are_not_saturated(ax):
    chain = nc.NicheChain(np.full((50, 50), 0.02))
    plot_lineages(chain, ax, niches=[7], l=1, most=1000)
    x, y = ax.lines[0].get_xydata().T
    np.testing.assert_allclose(y, 50 * (1 - 0.98**x), rtol=1e-9)
    filled, hollow = ax.lines[1], ax.lines[2]
    assert filled.get_xdata().max() < np.log(0.05) / np.log(0.98) < hollow.get_xdata().min()


def test_estimated_chain_has_a_band(ax):
    niches = nc.GridNiches((4, 4), ((0, 1), (0, 1)))
    rng = np.random.default_rng(1)
    counts = nc.TransitionCounts.from_pairs(rng.integers(0, 16, 300), rng.integers(0, 16, 300), niches)
    chain = nc.estimate(counts)
    plot_generations(chain, ax, niches=[(1, 2)], lineages=10, longest=3, draws=6, seed=2)
    values = [nc.l_evolvability(chain, niche=(1, 2), l=l, lineages=10, draws=6, seed=2) for l in (1, 2, 3)]
    np.testing.assert_allclose(ax.lines[0].get_ydata(), [value.value for value in values])
    corners = ax.collections[0].get_paths()[0].vertices[:, 1]
    assert set(np.round(corners, 9)) == {round(v, 9) for value in values for v in (value.low, value.high)}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"niches": []}, "0 niches are given"),
        ({"niches": [0, 1, 2, 3, 4]}, "5 niches are given"),
        ({"niches": [9]}, "niche is 9"),
        ({"niches": [0], "draws": 0}, "draws is 0"),
        ({"niches": [0], "longest": 0}, "longest is 0"),
        ({"niches": [0], "lineages": 0}, "lineages is 0"),
    ],
)
def test_bad_options(ax, options, said):
    with pytest.raises(NichechainError, match=said):
        plot_generations(nc.NicheChain(np.eye(5)), ax, **options)


def test_curve_against_lineages_needs_some(ax):
    with pytest.raises(NichechainError, match="most is 1"):
        plot_lineages(nc.NicheChain(np.eye(5)), ax, niches=[0], most=1)
