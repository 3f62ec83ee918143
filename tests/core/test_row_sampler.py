"""Draws from rows, against the rows."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse, stats

from nichechain.core.row_sampler import RowSampler

weights = st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12).filter(lambda row: sum(row) > 1e-6)


@settings(deadline=None)
@given(weights)
def test_cells_give_every_entry_its_share(row):
    """Without drawing: the cells of a row add up to its probabilities."""
    sampler = RowSampler(sparse.csr_array(np.array([row])))
    cells = sampler._keep.size
    share = np.zeros(len(row))
    np.add.at(share, sampler._column, sampler._keep / cells)
    np.add.at(share, sampler._other, (1.0 - sampler._keep) / cells)
    np.testing.assert_allclose(share, np.array(row) / sum(row), atol=1e-12)
    assert ((sampler._keep >= 0) & (sampler._keep <= 1)).all()


def test_draws_are_those_of_the_row_asked_for():
    rng = np.random.default_rng(0)
    T = sparse.random_array((30, 30), density=0.3, rng=rng) + sparse.eye_array(30)
    T = sparse.csr_array(T)
    rows = np.repeat(np.arange(30), 20_000)
    drawn = RowSampler(T).draw(rows, rng)
    dense = T.toarray() / T.toarray().sum(axis=1, keepdims=True)
    for i in range(30):
        found = np.bincount(drawn[rows == i], minlength=30)
        possible = dense[i] > 0
        assert not found[~possible].any()
        assert stats.chisquare(found[possible], 20_000 * dense[i, possible]).pvalue > 1e-5


def test_duplicates_add_up_and_zeros_are_never_drawn():
    matrix = sparse.csr_array(
        (np.array([1.0, 2.0, 0.0, 1.0]), np.array([4, 2, 3, 4]), np.array([0, 4])), shape=(1, 5)
    )
    drawn = RowSampler(matrix).draw(np.zeros(40_000, np.int64), np.random.default_rng(1))
    found = np.bincount(drawn, minlength=5) / 40_000
    assert found[[0, 1, 3]].tolist() == [0, 0, 0]
    assert found[4] == pytest.approx(0.5, abs=0.01)
    assert matrix.nnz == 4
