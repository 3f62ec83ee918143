"""Solutions of (I − Q) x = b whichever way they are found."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from nichechain import NichechainError
from nichechain.chain.structure import linear
from nichechain.chain.structure.inside import solve_substochastic


def _substochastic(size, per_row, leak, seed=0):
    rng = np.random.default_rng(seed)
    i = np.repeat(np.arange(size), per_row)
    weight = sparse.csr_array((rng.random(i.size), (i, rng.integers(size, size=i.size))), shape=(size, size))
    return sparse.csr_array(sparse.diags_array((1.0 - leak) / weight.sum(axis=1)) @ weight)


# Small and dense; iterations; a band; and what neither dense nor band would have been tried for.
@pytest.mark.parametrize(
    "inner",
    [
        _substochastic(7, 3, 0.1),
        _substochastic(1200, 5, 0.01),
        _substochastic(1200, 5, 0.01).T.tocsr(),
        sparse.csr_array(sparse.diags_array([np.full(4999, 0.5)] * 2, offsets=[-1, 1])),
    ],
    ids=["small", "iterated", "transposed", "band"],
)
def test_solutions_solve(inner):
    size = inner.shape[0]
    right = np.random.default_rng(1).random(size)
    found = solve_substochastic(inner, right)
    scale = max(1.0, np.abs(found).max())
    np.testing.assert_allclose(found - inner @ found, right, atol=1e-12 * scale)


def test_nothing_to_solve():
    assert solve_substochastic(sparse.csr_array((0, 0)), np.empty(0)).shape == (0,)


def test_direct_solution_where_iterations_fail(monkeypatch):
    inner = _substochastic(1200, 5, 0.01)
    right = np.ones(1200)
    expected = solve_substochastic(inner, right)
    for name in ("_bicgstab", "_gmres"):
        monkeypatch.setattr(linear, name, lambda _, right: np.full(right.size, np.nan))
    np.testing.assert_allclose(solve_substochastic(inner, right), expected, rtol=1e-9)
    monkeypatch.setattr(linear, "_DIRECT_CELLS", 1000)
    with pytest.raises(NichechainError, match="passage between 1200 states cannot be solved"):
        solve_substochastic(inner, right)
