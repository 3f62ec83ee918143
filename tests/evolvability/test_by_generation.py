import numpy as np
import pytest

import nichechain as nc
from nichechain.chain.counts import TransitionCounts
from nichechain.core.errors import NichechainError
from nichechain.evolvability import by_generation
from nichechain.evolvability.by_generation import evolvability_table
from nichechain.evolvability.coverage import expected_coverage
from nichechain.niches import GridNiches


@pytest.fixture(scope="module")
def chain():
    niches = GridNiches((6, 5), ((0, 1), (0, 1)), "state")
    rng = np.random.default_rng(1)
    parent = rng.integers(0, niches.states, 900)
    child = np.minimum(parent + rng.geometric(0.25, 900) - 1, niches.states - 1)
    return nc.estimate(TransitionCounts.from_births(parent, child, niches), "dirichlet")


def test_entries_are_those_of_niche_evolvability(chain):
    table = evolvability_table(chain, 6, [1, 7, 100, 3000], draws=5, seed=2)
    assert table.shape == (3, 4, 6, 30)
    for u, lineages in enumerate((1, 7, 100, 3000)):
        for l in (1, 4, 6):
            expected = nc.niche_evolvability(chain, l=l, lineages=lineages, draws=5, seed=2)
            found = table[:, u, l - 1]
            np.testing.assert_allclose(found, [expected.value, expected.low, expected.high], rtol=1e-9)


def test_given_matrix_is_exact():
    matrix = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]])
    table = evolvability_table(nc.NicheChain(matrix), 2, [10])
    assert table[0, 0, 1, 0] == pytest.approx(2.942708969, abs=1e-9)
    np.testing.assert_array_equal(table[0], table[1])
    np.testing.assert_array_equal(table[0], table[2])


def test_simulated_entries_agree_with_exact_ones(chain, monkeypatch):
    monkeypatch.setattr(by_generation, "MOST_EXACT", 10)
    found = evolvability_table(chain, 4, [1, 5, 20], draws=200, seed=3)
    monkeypatch.undo()
    expected = evolvability_table(chain, 4, [1, 5, 20], draws=200, seed=4)
    # A mean over 200 draws, each of 20 lineages, has a standard error of a few hundredths.
    np.testing.assert_allclose(found[0].mean(axis=-1), expected[0].mean(axis=-1), rtol=0.01)
    np.testing.assert_allclose(found[0], expected[0], rtol=0.06, atol=0.05)
    width, wanted = (table[2] - table[1] for table in (found, expected))
    np.testing.assert_allclose(width[2].mean(axis=-1), wanted[2].mean(axis=-1), rtol=0.2)


def test_one_draw_has_no_width(chain, monkeypatch):
    monkeypatch.setattr(by_generation, "MOST_EXACT", 10)
    mean, low, high = evolvability_table(chain, 2, [4], draws=1)
    np.testing.assert_array_equal(mean, low)
    np.testing.assert_array_equal(mean, high)


def test_one_lineage_of_one_generation_reaches_at_most_one(chain):
    value = evolvability_table(chain, 1, [1], draws=3)[0, 0, 0]
    first = expected_coverage(chain.T, chain.T[:30], 1, 1, counted=30)
    np.testing.assert_allclose(value, first, atol=0.1)
    assert value.max() <= 1.0 + 1e-12


@pytest.mark.parametrize(("longest", "lineages"), [(0, [1]), (1, [0])])
def test_numbers_out_of_range(chain, longest, lineages):
    with pytest.raises(NichechainError, match="is 0"):
        evolvability_table(chain, longest, lineages)
