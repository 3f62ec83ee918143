"""l-evolvability of niches and distributions on a given chain: goldens, enumeration, laws, Monte Carlo."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from nichechain import NicheChain, l_evolvability, niche_evolvability
from nichechain.evolvability import expected_coverage

from .samples import T

# Worked out by hand for niche 0 of T: convention, l, U, niches.
GOLDENS = [
    ("definition", 1, 1, 1.0),
    ("definition", 1, 2, 1.5),
    ("definition", 1, 10, 1.998046875),
    ("definition", 2, 1, 1.5),
    ("definition", 2, 2, 2.125),
    ("definition", 2, 10, 2.942708969),
    ("procedure", 1, 1, 1.5),
    ("procedure", 1, 2, 1.75),
    ("procedure", 1, 10, 1.999023438),
    ("procedure", 2, 1, 2.0),
    ("procedure", 2, 2, 2.375),
    ("procedure", 2, 10, 2.943685532),
]


@pytest.mark.parametrize(("convention", "l", "lineages", "golden"), GOLDENS)
@pytest.mark.parametrize(
    "matrix", [T, sparse.csr_array(T), T.astype(np.float32)], ids=["dense", "sparse", "float32"]
)
def test_goldens(matrix, convention, l, lineages, golden):
    chain = NicheChain(matrix)
    options = {"l": l, "lineages": lineages, "convention": convention}
    result = l_evolvability(chain, niche=0, **options)
    # The goldens are written with ten digits.
    assert result.value == pytest.approx(golden, abs=1e-9)
    assert np.isnan([result.low, result.high]).all()
    assert result.standard_error == 0.0
    assert (result.l, result.lineages, result.convention) == (l, lineages, convention)
    assert (result.method, result.estimator, result.births) == ("exact", "given", None)
    assert niche_evolvability(chain, **options).value[0] == pytest.approx(golden, abs=1e-9)
    assert chain.niche_evolvability(**options)[0] == pytest.approx(golden, abs=1e-9)


@pytest.mark.parametrize(("convention", "l", "lineages", "golden"), GOLDENS)
def test_goldens_by_monte_carlo(convention, l, lineages, golden):
    chain = NicheChain(T)
    options = {
        "l": l,
        "lineages": lineages,
        "convention": convention,
        "method": "monte-carlo",
        "repeats": 4000,
    }
    result = l_evolvability(chain, niche=0, seed=1, **options)
    assert abs(result.value - golden) <= 4 * result.standard_error + 1e-12
    # A number of niches between 1 and 3 has a standard deviation of at most 1.
    assert result.standard_error <= 1 / math.sqrt(4000)
    assert result.method == "monte-carlo"
    every = niche_evolvability(chain, seed=2, **options)
    exact = niche_evolvability(chain, l=l, lineages=lineages, convention=convention).value
    # An event too rare to be seen in 4,000 repeats leaves no spread, but an error of this order.
    assert (np.abs(every.value - exact) <= 4 * np.maximum(every.standard_error, 1 / 4000)).all()


def _union_sizes(start, transition, transitions, lineages, counted):
    """E[niches in the union over lineages], every path of every lineage being enumerated.

    ``start`` holds (probability, state, whether it counts as visited) of a lineage's first state.
    """
    sets = Counter()
    states = range(len(transition))
    for probability, state, visited in start:
        for path in itertools.product(states, repeat=transitions):
            p = probability
            for i, j in itertools.pairwise((state, *path)):
                p *= transition[i, j]
            sets[frozenset((state, *path) if visited else path)] += p
    niches = frozenset(range(counted))
    possible = [(visited & niches, p) for visited, p in sets.items() if p]
    return sum(
        math.prod(p for _, p in chosen) * len(frozenset().union(*(visited for visited, _ in chosen)))
        for chosen in itertools.product(possible, repeat=lineages)
    )


@pytest.mark.parametrize("outside", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_equals_enumeration_of_all_paths(n, outside):
    rng = np.random.default_rng(100 * n + outside)
    states = n + outside
    transition = rng.dirichlet(np.full(states, 0.6), states)
    chain = NicheChain(transition, outside=n if outside else None)
    given_d = rng.dirichlet(np.ones(states))
    for l, lineages in itertools.product((1, 2, 3), (1, 2)):
        options = {"l": l, "lineages": lineages}
        standing, drawn = [(1.0, 0, False)], [(p, j, True) for j, p in enumerate(given_d)]
        # The root stands in niche 0; l transitions; itself counted only by the procedure.
        expected = _union_sizes(standing, transition, l, lineages, n)
        assert l_evolvability(chain, niche=0, **options).value == pytest.approx(expected, rel=1e-12)
        expected = _union_sizes([(1.0, 0, True)], transition, l, lineages, n)
        value = l_evolvability(chain, niche=0, convention="procedure", **options).value
        assert value == pytest.approx(expected, rel=1e-12)
        # D is generation 1; l − 1 transitions follow it, l by the procedure.
        expected = _union_sizes(drawn, transition, l - 1, lineages, n)
        assert l_evolvability(chain, offspring=given_d, **options).value == pytest.approx(expected, rel=1e-12)
        expected = _union_sizes(drawn, transition, l, lineages, n)
        value = l_evolvability(chain, offspring=given_d, convention="procedure", **options).value
        assert value == pytest.approx(expected, rel=1e-12)


def test_three_lineages_equal_enumeration():
    rng = np.random.default_rng(77)
    transition = rng.dirichlet(np.full(4, 0.5), 4)
    chain = NicheChain(transition, outside=3)
    expected = _union_sizes([(1.0, 1, False)], transition, 2, 3, 3)
    assert l_evolvability(chain, niche=1, l=2, lineages=3).value == pytest.approx(expected, rel=1e-12)


def test_the_papers_two_genotypes_with_equal_children():
    # A's children fall in niches 1 and 2, B's in 3 and 4. A's children only ever have children
    # where they are themselves; each child of B has some in two more niches.
    chain = np.eye(9)
    chain[3] = chain[4] = 0.0
    chain[3, [5, 6]] = chain[4, [7, 8]] = 0.5
    chain = NicheChain(chain)
    a, b = np.zeros(9), np.zeros(9)
    a[[1, 2]] = b[[3, 4]] = 0.5
    for lineages in (1, 2, 10, 100):
        children = [l_evolvability(chain, offspring=d, l=1, lineages=lineages).value for d in (a, b)]
        assert children[0] == pytest.approx(children[1], rel=1e-12)
        grandchildren = [l_evolvability(chain, offspring=d, l=2, lineages=lineages).value for d in (a, b)]
        assert grandchildren[0] == pytest.approx(2 * (1 - 0.5**lineages), rel=1e-12)
        assert grandchildren[1] == pytest.approx(
            2 * (1 - 0.5**lineages) + 4 * (1 - 0.75**lineages), rel=1e-12
        )


@given(seed=st.integers(0, 2**20), n=st.integers(1, 6), l=st.integers(1, 5), lineages=st.integers(1, 30))
@settings(deadline=None, max_examples=40)
def test_laws(seed, n, l, lineages):
    rng = np.random.default_rng(seed)
    transition = rng.dirichlet(np.full(n + 1, 0.4), n + 1)
    chain = NicheChain(transition, outside=n)
    options = {"l": l, "lineages": lineages}
    every = niche_evolvability(chain, **options).value
    assert every.shape == (n,)
    assert (every <= min(n, l * lineages) + 1e-12).all()
    one = [l_evolvability(chain, niche=i, **options).value for i in range(n)]
    np.testing.assert_allclose(every, one, rtol=1e-12)
    # A root in niche i is one whose offspring are distributed as row i of T.
    by_row = [l_evolvability(chain, offspring=transition[i], **options).value for i in range(n)]
    np.testing.assert_allclose(every, by_row, rtol=1e-12)
    # Counting the root's own state is a one-hot D, one transition longer.
    hot = [
        l_evolvability(chain, offspring=np.eye(n + 1)[i], l=l + 1, lineages=lineages).value for i in range(n)
    ]
    procedure = niche_evolvability(chain, convention="procedure", **options).value
    np.testing.assert_allclose(procedure, hot, rtol=1e-12)
    assert (procedure >= every - 1e-12).all()
    as_sparse = NicheChain(sparse.csr_array(transition), outside=n)
    np.testing.assert_allclose(niche_evolvability(as_sparse, **options).value, every, rtol=1e-12)


def test_a_distribution_over_niches_alone_leaves_nothing_outside():
    rng = np.random.default_rng(4)
    chain = NicheChain(rng.dirichlet(np.ones(4), 4), outside=3)
    short = l_evolvability(chain, offspring=[0.2, 0.8, 0.0], l=3, lineages=10)
    full = l_evolvability(chain, offspring=[0.2, 0.8, 0.0, 0.0], l=3, lineages=10)
    # Without an interval, whose NaN equals nothing.
    assert replace(short, low=0.0, high=0.0) == replace(full, low=0.0, high=0.0)


def test_one_root_of_many_sparse_states_has_the_closed_form():
    # A ring of 1,200 states, with steps of 1, 2 and 7 and some stays.
    states = np.arange(1200)
    steps, share = (0, 1, 2, 7), (0.1, 0.4, 0.3, 0.2)
    columns = np.stack([(states + step) % 1200 for step in steps], axis=1)
    entries = np.tile(share, 1200), (np.repeat(states, 4), columns.ravel())
    T = sparse.csr_array(entries, shape=(1200, 1200))
    found = l_evolvability(NicheChain(T), niche=5, l=6, lineages=20).value
    assert found == pytest.approx(expected_coverage(T, T[[5]], 6, 20)[0], rel=1e-12)


@pytest.mark.parametrize("l", range(1, 13))
def test_one_root_of_a_whole_matrix_has_the_closed_form(l):
    T = np.random.default_rng(l).dirichlet(np.full(30, 0.2), 30)
    found = l_evolvability(NicheChain(T), niche=5, l=l, lineages=20).value
    assert found == pytest.approx(expected_coverage(T, T[[5]], l, 20)[0], rel=1e-12)
