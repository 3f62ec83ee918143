"""NicheChain: what it accepts, what it refuses, what its states are called."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate

T = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]])


def _third(dtype):
    """Rows of thirds, which sum to 1 in no binary precision."""
    return np.full((3, 3), np.asarray(1, dtype) / np.asarray(3, dtype), dtype)


@pytest.mark.parametrize(
    "transition",
    [
        T,
        T.tolist(),
        np.asfortranarray(T),
        T.astype(np.float32),
        T.astype(np.float16),
        np.array([[0, 1], [1, 0]]),
        np.eye(3, dtype=bool),
        _third(np.float64),
        _third(np.float32),
        _third(np.float16),
        [[1.0]],
    ],
    ids=lambda value: f"{getattr(value, 'dtype', 'list')}",
)
def test_arrays_of_any_real_type(transition):
    chain = NicheChain(transition)
    assert chain.T.dtype == np.float64
    assert isinstance(chain.T, np.ndarray)
    np.testing.assert_array_equal(chain.T, np.asarray(transition, float))
    assert chain.states == chain.n_niches == len(transition)
    assert chain.estimator == "given"
    assert chain.births is None


@pytest.mark.parametrize(
    "form", [sparse.csr_array, sparse.csc_array, sparse.coo_array, sparse.csr_matrix, sparse.lil_array]
)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_sparse_stays_sparse(form, dtype):
    chain = NicheChain(form(T.astype(dtype)))
    assert isinstance(chain.T, sparse.csr_array)
    assert chain.T.dtype == np.float64
    np.testing.assert_array_equal(chain.T.toarray(), T)
    assert chain.n_niches == 3


def test_sparse_integers():
    np.testing.assert_array_equal(NicheChain(sparse.eye_array(3, dtype=int)).T.toarray(), np.eye(3))


def test_many_thirds_in_float32_are_rounding_not_an_error():
    rng = np.random.default_rng(0)
    for n in (10, 400):
        NicheChain(rng.dirichlet(np.ones(n), n).astype(np.float32))
        NicheChain(sparse.csr_array(rng.dirichlet(np.ones(n), n)))


BAD = [
    (np.full((2, 3), 1 / 3), r"shape \(2, 3\), but must be square"),
    (np.full((3, 2), 0.5), r"shape \(3, 2\)"),
    (np.array([1.0]), r"shape \(1,\)"),
    (np.ones((1, 1, 1)), r"shape \(1, 1, 1\)"),
    (np.empty((0, 0)), r"shape \(0, 0\).*at least one state"),
    (1.0, r"shape \(\)"),
    ([[np.nan, 1.0], [0.0, 1.0]], "NaN or infinite"),
    ([[np.inf, 1.0], [0.0, 1.0]], "NaN or infinite"),
    ([[-0.5, 1.5], [0.0, 1.0]], "value of -0.5"),
    ([[1.0, 0.0], [0.5, 0.4]], "row 1 of T sums to 0.9"),
    ([[1.0, 0.0], [0.5, 0.6]], "row 1 of T sums to 1.1"),
    ([[1.0, 0.0], [0.0, 0.0]], "row 1 of T sums to 0"),
    (np.array([[3, 1], [0, 4]]), "row 0 of T sums to 4"),
    (np.array([[0.999, 0.0], [0.0, 1.0]], np.float32), "row 0 of T sums to 0.999"),
    (np.array([[1 - 1e-6, 0.0], [0.0, 1.0]]), "row 0 of T sums to 0.999999.*normalize=True"),
    (np.array([[1, 0], [0.5 + 0.3j, 0.5 - 0.3j]]), "T has complex numbers"),
]


@pytest.mark.parametrize(("transition", "message"), BAD)
def test_bad_matrices(transition, message):
    with pytest.raises(NichechainError, match=message):
        NicheChain(transition)


@pytest.mark.parametrize(("transition", "message"), [row for row in BAD if np.ndim(row[0]) == 2])
def test_bad_sparse_matrices(transition, message):
    with pytest.raises(NichechainError, match=message):
        NicheChain(sparse.csr_array(np.asarray(transition)))


@pytest.mark.parametrize(
    "transition", [[["a", "b"], ["c", "d"]], [[1.0, 0.0], [1.0]], [[None, 1.0], [0.0, 1.0]]]
)
def test_what_holds_no_numbers(transition):
    with pytest.raises(NichechainError, match="T has"):
        NicheChain(transition)


@pytest.mark.parametrize("outside", [0, 1, 3, -1])
def test_outside_must_be_the_last_state(outside):
    with pytest.raises(NichechainError, match=f"outside is {outside}, but must be the last state, 2"):
        NicheChain(T, outside=outside)


def test_outside_is_a_state_but_no_niche():
    chain = NicheChain(T, outside=2)
    assert (chain.states, chain.n_niches, chain.outside) == (3, 2, 2)
    assert [chain.label(state) for state in range(3)] == ["0", "1", "outside"]
    assert chain.niche_evolvability(l=2, lineages=5).shape == (2,)
    assert repr(chain) == "NicheChain(2 niches and outside, estimator: given)"
    assert chain.state("outside") == chain.state(2) == 2
    with pytest.raises(NichechainError, match="niches 0 to 1"):
        chain.state(3)


@pytest.mark.parametrize("niche", [-1, 3, 1000])
def test_a_niche_that_does_not_exist(niche):
    with pytest.raises(NichechainError, match=f"niche is {niche}, but this chain has niches 0 to 2"):
        NicheChain(T).state(niche)


def test_a_chain_without_a_grid_has_numbers_only():
    chain = NicheChain(T)
    assert chain.state(2) == chain.state(np.int32(2)) == 2
    assert chain.label(1) == "1"
    assert repr(chain) == "NicheChain(3 niches, estimator: given)"
    with pytest.raises(NichechainError, match="no grid: give its number"):
        chain.state((1, 1))


def test_a_grid_names_the_states():
    niches = GridNiches((3, 2), ((0.0, 3.0), (0.0, 2.0)))
    chain = NicheChain(np.eye(7), niches=niches, outside=6)
    assert chain.state((2, 1)) == chain.state(5) == 5
    assert [chain.label(state) for state in (0, 5, 6)] == ["0,0", "2,1", "outside"]
    assert chain.state("outside") == chain.state(6) == 6
    for niche in ((3, 0), (0, 2), (-1, 0), (0,), 7, -1, "inside"):
        with pytest.raises(NichechainError, match="niche is"):
            chain.state(niche)


@pytest.mark.parametrize(("size", "outside"), [(6, 5), (7, None), (8, 7), (5, None)])
def test_a_grid_of_another_size(size, outside):
    niches = GridNiches((3, 2), ((0.0, 3.0), (0.0, 2.0)))
    with pytest.raises(NichechainError, match="but the grid has 6"):
        NicheChain(np.eye(size), niches=niches, outside=outside)


def test_a_chain_needs_one_source():
    counts = TransitionCounts.from_pairs([0], [1], GridNiches((2,), ((0.0, 1.0),)))
    posterior = estimate(counts).posterior
    with pytest.raises(NichechainError, match="either a transition matrix or a posterior"):
        NicheChain()
    with pytest.raises(NichechainError, match="either a transition matrix or a posterior"):
        NicheChain(np.eye(3), posterior=posterior)


@pytest.mark.parametrize("form", [np.array, sparse.csr_array])
def test_a_chain_is_its_own(form):
    given = form(T)
    chain = NicheChain(given)
    given[0, 0] = 0.25
    assert chain.T[0, 0] == 0.5


def test_a_chain_cannot_be_written_to():
    chain = NicheChain(T)
    with pytest.raises(ValueError, match="read-only"):
        chain.T[0, 0] = 1.0
    chain = NicheChain(sparse.csr_array(T))
    with pytest.raises(ValueError, match="read-only"):
        chain.T.data[0] = 1.0


def test_the_matrix_of_an_estimated_chain_is_its_posterior_mean():
    niches = GridNiches((2, 2), ((0.0, 1.0), (0.0, 1.0)))
    counts = TransitionCounts.from_pairs([0, 0, 1, 4], [1, 4, 1, 2], niches)
    chain = estimate(counts, strength=2.0)
    np.testing.assert_array_equal(chain.T, chain.posterior.mean())
    assert (chain.states, chain.n_niches, chain.outside) == (5, 4, 4)
    assert chain.births.tolist() == [2, 1, 0, 0, 1]


@pytest.mark.parametrize("form", [np.array, sparse.csr_array])
def test_rows_are_divided_by_their_sums_where_that_is_asked_for(form):
    rows = np.random.default_rng(0).random((400, 400)).astype(np.float32)
    rows /= rows.sum(axis=1, keepdims=True)
    given = form(rows.astype(np.float64))
    with pytest.raises(NichechainError, match="normalize=True divides each row by its sum"):
        NicheChain(given)
    chain = NicheChain(given, normalize=True)
    np.testing.assert_allclose(np.asarray(chain.T.sum(axis=1)).ravel(), 1.0, rtol=1e-14)
    counts = NicheChain(form(np.array([[3, 1], [0, 2]])), normalize=True).T
    np.testing.assert_array_equal(counts if form is np.array else counts.toarray(), [[0.75, 0.25], [0, 1]])
    with pytest.raises(NichechainError, match="row 1 of T sums to 0, so normalize=True cannot"):
        NicheChain(form(np.array([[1.0, 1.0], [0.0, 0.0]])), normalize=True)


def test_a_large_posterior_mean_is_refused_before_memory_is_asked_for():
    niches = GridNiches((268, 268), ((0.0, 1.0), (0.0, 1.0)))
    chain = estimate(TransitionCounts.from_pairs([0, 5], [1, 9], niches), strength=5.0)
    with pytest.raises(NichechainError, match=r"T of 71825 states would take 38\.4 GiB as a matrix"):
        _ = chain.T


def test_an_estimate_needs_counts():
    with pytest.raises(NichechainError, match="counts is of type ndarray, but must be TransitionCounts"):
        estimate(np.eye(3))
