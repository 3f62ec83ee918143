"""Estimators of T: what unvisited rows do, and strengths and mixtures learned from births."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from nichechain import GridNiches, NichechainError, TransitionCounts, estimate
from nichechain.chain.posterior import DirichletPosterior

ROW = GridNiches((4,), ((0.0, 4.0),))
# Niche 0 has three children at home and one in 1, niche 2 one outside, the outside one in 1.
PARENT, CHILD = [0, 0, 0, 0, 2, 4], [0, 0, 0, 1, 4, 1]
OBSERVED = {0: [0.75, 0.25, 0, 0, 0], 2: [0, 0, 0, 0, 1], 4: [0, 1, 0, 0, 0]}
LANDED = np.array([3, 2, 0, 0, 1]) / 6


def _dense(chain):
    return chain.T.toarray() if sparse.issparse(chain.T) else chain.T


@pytest.mark.parametrize(
    ("unvisited", "fill"),
    [
        (None, lambda i: np.eye(5)[i]),
        ("self", lambda i: np.eye(5)[i]),
        ("uniform", lambda _: np.full(5, 0.2)),
        ("base", lambda _: LANDED),
        ("absorb", lambda _: np.eye(5)[4]),
    ],
)
def test_mle_is_the_shares_and_unvisited_rows_do_as_told(unvisited, fill):
    counts = TransitionCounts.from_pairs(PARENT, CHILD, ROW)
    chain = estimate(counts, "mle", unvisited=unvisited)
    expected = [OBSERVED.get(i, fill(i)) for i in range(5)]
    np.testing.assert_allclose(_dense(chain), expected, rtol=1e-15)
    assert chain.estimator == f"mle, unvisited rows: {unvisited or 'self'}"
    assert (chain.outside, chain.n_niches, chain.posterior) == (4, 4, None)
    assert chain.births.tolist() == [4, 0, 1, 0, 1]
    assert sparse.issparse(chain.T)


@pytest.mark.parametrize("unvisited", ["self", "uniform", "base", "absorb"])
def test_mle_with_every_row_visited_fills_nothing(unvisited):
    rng = np.random.default_rng(0)
    parent = np.concatenate([np.arange(5), rng.integers(5, size=100)])
    child = rng.integers(5, size=105)
    table = np.zeros((5, 5))
    np.add.at(table, (parent, child), 1)
    chain = estimate(TransitionCounts.from_pairs(parent, child, ROW), "mle", unvisited=unvisited)
    np.testing.assert_allclose(_dense(chain), table / table.sum(axis=1, keepdims=True), rtol=1e-14)


@pytest.mark.parametrize("unvisited", ["self", "uniform"])
def test_mle_without_births(unvisited):
    chain = estimate(TransitionCounts.from_pairs([], [], ROW), "mle", unvisited=unvisited)
    expected = np.eye(5) if unvisited == "self" else np.full((5, 5), 0.2)
    np.testing.assert_allclose(_dense(chain), expected)


@pytest.mark.parametrize("estimator", ["mle", "dirichlet", "empirical-bayes"])
@pytest.mark.parametrize("parents_outside", [False, True])
def test_an_absorbing_outside_is_never_left(estimator, parents_outside):
    # Births of parents outside, from walks say, do not count against the decree.
    niches = GridNiches((4,), ((0.0, 4.0),), "absorb")
    births = slice(None) if parents_outside else slice(-1)
    chain = estimate(TransitionCounts.from_pairs(PARENT[births], CHILD[births], niches), estimator)
    np.testing.assert_array_equal(_dense(chain)[4], np.eye(5)[4])
    np.testing.assert_allclose(_dense(chain).sum(axis=1), 1.0, rtol=1e-12)


@pytest.mark.parametrize("estimator", ["mle", "dirichlet", "empirical-bayes"])
def test_clipped_niches_have_no_outside_state(estimator):
    niches = GridNiches((4,), ((0.0, 4.0),), "clip")
    chain = estimate(TransitionCounts.from_pairs([0, 0], [1, 0], niches), estimator)
    assert (chain.states, chain.outside) == (4, None)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"estimator": "bayes"}, "estimator is 'bayes', but must be one of empirical-bayes, dirichlet, mle"),
        (
            {"estimator": "mle", "unvisited": "stay"},
            "unvisited is 'stay', but must be one of self, uniform, base",
        ),
        ({"estimator": "mle", "strength": 2.0}, "strength belongs to empirical-bayes and dirichlet"),
        ({"unvisited": "self"}, "unvisited belongs to mle"),
        ({"strength": "jeffreys"}, "strength is 'jeffreys', but must be a number for empirical-bayes"),
        ({"estimator": "dirichlet", "strength": "much"}, "strength is 'much'"),
        ({"estimator": "dirichlet", "strength": -2.0}, "strength is -2.0"),
        ({"strength": 0.0}, "strength is 0.0"),
        ({"strength": -1.0}, "strength is -1.0"),
        ({"strength": np.nan}, "strength is nan"),
        ({"strength": np.inf}, "strength is inf"),
    ],
)
def test_bad_arguments(arguments, message):
    counts = TransitionCounts.from_pairs(PARENT, CHILD, ROW)
    with pytest.raises(NichechainError, match=message):
        estimate(counts, **arguments)


def test_no_outside_to_leave_to():
    niches = GridNiches((4,), ((0.0, 4.0),), "clip")
    with pytest.raises(NichechainError, match="no outside state"):
        estimate(TransitionCounts.from_pairs([0], [1], niches), "mle", unvisited="absorb")


def test_no_birth_to_learn_a_base_from():
    with pytest.raises(NichechainError, match="no birth says where children land"):
        estimate(TransitionCounts.from_pairs([], [], ROW), "mle", unvisited="base")


def test_a_given_strength_is_taken():
    counts = TransitionCounts.from_pairs(PARENT, CHILD, ROW)
    chain = estimate(counts, strength=7.5)
    assert chain.posterior.strength == 7.5
    assert chain.estimator == "empirical-bayes, strength 7.5"


@pytest.mark.parametrize(("strength", "size"), [(None, 1.0), ("1/n", 1.0), ("jeffreys", 2.5), (3, 3.0)])
def test_dirichlet_adds_so_much_to_every_state(strength, size):
    counts = TransitionCounts.from_pairs(PARENT, CHILD, ROW)
    table = counts.matrix.toarray()
    expected = (table + size / 5) / (table.sum(axis=1, keepdims=True) + size)
    np.testing.assert_allclose(estimate(counts, "dirichlet", strength=strength).T, expected)


def test_without_births_a_posterior_is_its_base():
    chain = estimate(TransitionCounts.from_pairs([], [], ROW))
    np.testing.assert_allclose(chain.T.sum(axis=1), 1.0)
    assert (chain.T > 0).all()
    assert chain.births.sum() == 0


def test_the_posterior_of_an_estimate_rests_on_its_counts():
    counts = TransitionCounts.from_pairs(PARENT, CHILD, ROW)
    chain = estimate(counts)
    assert isinstance(chain.posterior, DirichletPosterior)
    assert chain.posterior.counts is chain.counts is counts
    assert chain.niches == ROW
