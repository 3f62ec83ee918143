"""Parents by l-evolvability and by information, against what the chain says when all births are there."""

from __future__ import annotations

import numpy as np
import pytest

from nichechain import GridNiches, TransitionCounts, estimate
from nichechain.evolvability.coverage import expected_coverage
from nichechain.evolvability.where_to_sample import evolvability_derivative
from nichechain.search.selection import Told
from nichechain.steering.evolvable import EvolvableParents, spread
from nichechain.steering.information import InformedParents, derivative_spread
from nichechain.steering.online import OnlineChain

NICHES = GridNiches((5, 6), ((0.0, 1.0), (0.0, 1.0)))


def births(size: int = 600) -> Told:
    """Births that go the farther, the larger the number of the parent's niche; few of parents in the last."""
    rng = np.random.default_rng(4)
    parent = rng.choice(31, size=size, p=np.array([*[1.0] * 28, 0.1, 0.1, 0.1]) / 28.3)
    child = (parent + rng.integers(0, 1 + parent // 4, size)) % 30
    none = np.zeros(size, np.int64)
    return Told(parent + 100, parent, child, none.astype(bool), none + 1, none, none.astype(bool))


@pytest.fixture(scope="module")
def online():
    chain = OnlineChain(NICHES)
    chain.tell(births())
    chain.settle()
    return chain


@pytest.fixture(scope="module")
def chain(online):
    given = births()
    counts = TransitionCounts.from_births(
        given.parent_niche, given.child_niche, NICHES, elite=given.parent_uid
    )
    return estimate(counts, strength=online.strength)


def test_weights_are_l_evolvabilities_of_the_posterior_mean(chain):
    parents = EvolvableParents(NICHES, 4, 30)
    states = np.arange(30)
    assert parents.weights(states, states) is None
    parents.tell(births())
    parents.begin(1)
    found = parents.weights(states, states)
    np.testing.assert_allclose(found, expected_coverage(chain.T, chain.T, 4, 30, counted=30)[:30], rtol=1e-9)
    # Half as many births more change nothing before the prior is fitted again.
    parents.tell(births(300))
    parents.begin(2)
    np.testing.assert_array_equal(parents.weights(states, states), found)


def test_information_is_that_of_where_to_sample(online, chain):
    slope = evolvability_derivative(chain, l=3, lineages=20)
    mean = np.asarray(chain.T)
    expected = (mean * slope**2).sum(axis=1) - (mean * slope).sum(axis=1) ** 2
    found = derivative_spread(online, np.arange(30), np.arange(30), 3, 20)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-12)


def test_niches_that_little_is_known_of_are_preferred():
    parents = InformedParents(NICHES, 3, 20)
    states = np.arange(30)
    parents.tell(births())
    parents.begin(1)
    weights = parents.weights(states, states)
    assert weights[28:].min() > np.median(weights)
    before = weights[29] / weights[5]
    one = np.full(50, 29)
    parents.tell(Told(one, one, np.arange(50) % 30, one.astype(bool), one, one, one < 0))
    parents.begin(2)
    weights = parents.weights(states, states)
    assert weights[29] / weights[5] < before


def test_targets_are_spread_over_all_niches():
    assert spread(3, 10).tolist() == [0, 1, 2]
    assert spread(101, 5).tolist() == [0, 25, 50, 75, 100]
