"""Kemeny's constant and implied timescales: closed forms, deeptime, exact arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from nichechain import NicheChain, NichechainError
from nichechain.chain.structure.passage import mean_first_passage_times
from nichechain.chain.structure.timescales import (
    implied_timescales,
    kemeny_constant,
    passage_between_all,
)

from .samples import MIXED, exact_solution, exact_stationary, exact_system, graded, ladder


@given(st.integers(0, 10_000), st.integers(2, 9))
@settings(max_examples=20, deadline=None)
@pytest.mark.filterwarnings("ignore:Using eigenvalues with non-zero imaginary part")
def test_equals_deeptime_and_eigenvalues(seed, size):
    analysis = pytest.importorskip("deeptime.markov.tools.analysis")
    transition = np.random.default_rng(seed).dirichlet(np.full(size, 0.7), size)
    chain = NicheChain(transition)
    found = implied_timescales(chain, k=size)
    assert found.shape == (size - 1,)
    np.testing.assert_allclose(found, analysis.timescales(transition)[1:], rtol=1e-8)
    others = np.sort_complex(np.linalg.eigvals(transition))[:-1]
    np.testing.assert_allclose(kemeny_constant(chain), [(1.0 / (1.0 - others)).sum().real], rtol=1e-9)


def test_what_hardly_ever_happens():
    """Two states with rates e and e/10: λ = 1 − 1.1 e, K = 1 / (1 − λ)."""
    for e in (1e-3, 1e-9, 1e-14, 1e-100):
        chain = NicheChain([[1 - e, e], [e / 10, 1 - e / 10]])
        expected = -1.0 / np.log1p(-1.1 * e)
        np.testing.assert_allclose(implied_timescales(chain), [expected], rtol=1e-12)
        np.testing.assert_allclose(kemeny_constant(chain), [1 / (1.1 * e)], rtol=1e-14)


@given(graded())
@settings(max_examples=20, deadline=None)
def test_kemeny_in_rational_arithmetic(transition):
    size = len(transition)
    share = exact_stationary(transition)
    expected = 0.0
    for target in range(1, size):
        rest = [i for i in range(size) if i != target]
        times = exact_solution(exact_system(transition, rest), [Fraction(1)] * len(rest))
        expected += share[target] * float(times[0])
    np.testing.assert_allclose(kemeny_constant(NicheChain(transition)), [expected], rtol=1e-11)


@pytest.mark.parametrize("size", [1, 2, 3, 8, 33])
def test_passage_between_all_pairs(size):
    transition = np.random.default_rng(size).dirichlet(np.full(size, 0.5), size)
    found = passage_between_all(transition, np.ones(size))
    each = [mean_first_passage_times(NicheChain(transition), target) for target in range(size)]
    np.testing.assert_allclose(found, np.stack(each, axis=1), rtol=1e-12)


def test_one_constant_for_each_class():
    # A walk that jumps anywhere alike needs n − 1 generations to a place drawn alike.
    both = sparse.block_diag([np.full((2, 2), 0.5), np.full((5, 5), 0.2), [[1.0]]])
    np.testing.assert_allclose(kemeny_constant(NicheChain(both)), [1.0, 4.0, 0.0])
    # Of a cycle, (n − 1) / 2.
    np.testing.assert_allclose(kemeny_constant(NicheChain(np.roll(np.eye(6), 1, axis=1))), [2.5])


def test_what_never_dies_out_has_no_timescale():
    assert implied_timescales(NicheChain(np.roll(np.eye(6), 1, axis=1))).tolist() == [np.inf] * 5
    found = implied_timescales(NicheChain(MIXED))
    # Two recurrent classes: the second 1 stays. Then the pair 0 ⇄ 1, the pair 3 ⇄ 4, and 5 dies at once.
    inner, pair = np.linalg.eigvals(MIXED[:2, :2]), -0.25
    expected = np.sort(-1.0 / np.log(np.abs([*inner, pair])))[::-1]
    assert found[0] == np.inf
    np.testing.assert_allclose(found[1:4], expected)
    assert found[4] == 0.0
    assert implied_timescales(NicheChain([[1.0]])).size == 0


def test_a_slow_way_out_of_a_transient_class():
    e = 1e-13
    inner = np.array([[0.5 - e, 0.5], [0.5, 0.5]])
    transition = np.zeros((3, 3))
    transition[:2, :2] = inner
    transition[0, 2], transition[2, 2] = e, 1.0
    # Half of the time in the state that is left: a rate of e / 2 to first order.
    assert implied_timescales(NicheChain(transition))[0] == pytest.approx(2 / e, rel=1e-9)


def test_sizes():
    with pytest.raises(NichechainError, match="class of 3001 states is too large"):
        kemeny_constant(NicheChain(ladder(3000, 0.5)))
    with pytest.raises(NichechainError, match="class of 3001 states is too large"):
        implied_timescales(NicheChain(ladder(3000, 0.5)))
    many = NicheChain(sparse.eye_array(20_000, format="csr"))
    assert (kemeny_constant(many) == 0.0).all()
    assert implied_timescales(many, 3).tolist() == [np.inf] * 3
    with pytest.raises(NichechainError, match="k is 0"):
        implied_timescales(many, 0)
