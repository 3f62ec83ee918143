"""Solutions of (I − Q) x = b whichever way they are found."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from nichechain import NichechainError
from nichechain.chain.structure import inside as module
from nichechain.chain.structure.inside import Inside


def _substochastic(size, per_row, leak, seed=0):
    rng = np.random.default_rng(seed)
    i = np.repeat(np.arange(size), per_row)
    weight = sparse.csr_array((rng.random(i.size), (i, rng.integers(size, size=i.size))), shape=(size, size))
    return sparse.csr_array(sparse.diags_array((1.0 - leak) / weight.sum(axis=1)) @ weight)


def _inside(inner):
    """These states of a chain that has one more, which lineages leave to."""
    size = inner.shape[0]
    leaving = 1.0 - np.asarray(inner.sum(axis=1)).ravel()
    rows = sparse.block_array(
        [[inner, sparse.csr_array(leaving[:, None])], [None, sparse.csr_array([[1.0]])]], format="csr"
    )
    return Inside.of(rows, np.arange(size))


# Small and dense; iterations; a band; and what neither dense nor band would have been tried for.
@pytest.mark.parametrize(
    "inner",
    [
        _substochastic(7, 3, 0.1),
        _substochastic(130, 5, 0.01),
        _substochastic(2100, 5, 0.01),
        sparse.csr_array(sparse.diags_array([np.full(4999, 0.5)] * 2, offsets=[-1, 1])),
    ],
    ids=["small", "blocks", "iterated", "band"],
)
@pytest.mark.parametrize("transposed", [False, True])
def test_solutions_solve(inner, transposed):
    size = inner.shape[0]
    right = np.random.default_rng(1).random(size)
    inside = _inside(inner)
    found = inside.solve_transposed(right) if transposed else inside.solve(right)
    scale = max(1.0, np.abs(found).max())
    onward = found @ inner if transposed else inner @ found
    np.testing.assert_allclose(found - onward, right, atol=1e-9 * scale)


@pytest.mark.parametrize("size", [2100, 2500])
def test_right_sides_with_zeros_are_proven_by_the_times(size):
    inner = _substochastic(size, 5, 0.05)
    right = np.zeros(size)
    right[7] = 1.0
    expected = np.linalg.solve(np.eye(size) - inner.toarray(), right)
    np.testing.assert_allclose(_inside(inner).solve(right), expected, atol=1e-9)


def test_nothing_to_solve():
    assert Inside.of(sparse.csr_array((3, 3)), np.empty(0, np.int64)).solve(np.empty(0)).shape == (0,)


def test_elimination_where_iterations_fail(monkeypatch):
    inner = _substochastic(2100, 5, 0.01)
    right = np.ones(2100)
    expected = _inside(inner).solve(right)
    for name in ("_bicgstab", "_gmres"):
        monkeypatch.setattr(module, name, lambda _, __, right: np.full(right.size, np.nan))
    np.testing.assert_allclose(_inside(inner).solve(right), expected, rtol=1e-9)
    monkeypatch.setattr(module, "_DENSE_STATES", 1000)
    monkeypatch.setattr(module, "_BAND_CELLS", 1000)
    with pytest.raises(NichechainError, match="passage between 2100 states cannot be solved"):
        _inside(inner).solve(right)


def test_a_solution_that_is_not_proven_is_no_solution(monkeypatch):
    """An iteration that is off by a hundred-thousandth is not taken."""
    inner = _substochastic(2100, 5, 0.01)
    right = np.ones(2100)
    right_one = _inside(inner).solve(right)
    for name in ("_bicgstab", "_gmres"):
        monkeypatch.setattr(module, name, lambda *_: right_one * (1.0 + 1e-5) * 0.25)
    monkeypatch.setattr(module, "_DENSE_STATES", 1000)
    monkeypatch.setattr(module, "_BAND_CELLS", 1000)
    with pytest.raises(NichechainError, match="cannot be solved"):
        _inside(inner).solve(right)
