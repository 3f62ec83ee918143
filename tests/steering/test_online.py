"""The chain that is kept while births come in, against the one that is estimated afterwards."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from nichechain import GridNiches, TransitionCounts, estimate
from nichechain.search.selection import Told
from nichechain.steering.online import OnlineChain


def told(parent, child, elite) -> Told:
    none = np.zeros(len(parent), np.int64)
    nobody = none.astype(bool)
    return Told(np.asarray(elite), np.asarray(parent), np.asarray(child), nobody, none, none, nobody)


def drifting(size: int, states: int, seed: int) -> Told:
    """Births near their parents, of three elites in each niche; some failed, some are nobody's children."""
    rng = np.random.default_rng(seed)
    parent = rng.integers(-1, states, size)
    child = np.clip(np.abs(parent) + rng.integers(-2, 3, size), 0, states - 1)
    child[rng.random(size) < 0.05] = -1
    return told(parent, child, np.where(parent < 0, -1, 3 * parent + rng.integers(3, size=size)))


@pytest.mark.parametrize("outside", ["state", "absorb", "clip"])
def test_it_is_the_chain_of_the_same_births(outside):
    niches = GridNiches((5, 6), ((0.0, 1.0), (0.0, 1.0)), outside)
    births = drifting(800, niches.states, 1)
    online = OnlineChain(niches)
    online.tell(births)
    assert online.settle()
    counts = TransitionCounts.from_births(
        births.parent_niche, births.child_niche, niches, elite=births.parent_uid
    )
    chain = estimate(counts)
    columns = np.random.default_rng(0).random((niches.states, 3))
    # The strength is kept to three digits.
    np.testing.assert_allclose(online @ columns, chain.T @ columns, rtol=3e-3)
    np.testing.assert_allclose(online @ columns[:, 0], (online @ columns)[:, 0], rtol=1e-12)
    exact = replace(chain.posterior, strength=online.strength).mean()
    np.testing.assert_allclose(online @ columns, exact @ columns, rtol=1e-9)
    np.testing.assert_allclose(online.backwards(columns), exact.T @ columns, rtol=1e-9)
    never = np.flatnonzero(counts.matrix.diagonal() == 0)
    never = never[never < len(niches)]
    np.testing.assert_allclose(online.staying()[never], np.diag(exact)[never], rtol=1e-9)


def test_births_are_added_and_the_prior_is_fitted_when_there_are_four_times_as_many():
    niches = GridNiches((5, 6), ((0.0, 1.0), (0.0, 1.0)))
    births = drifting(800, niches.states, 2)
    online = OnlineChain(niches)
    fitted = [0]
    for start in range(0, 800, 100):
        online.tell(births[start : start + 100])
        due = online.births >= 4 * fitted[-1]
        assert online.settle() == due
        fitted += [online.births] if due else []
    assert online.fits == len(fitted) - 1 == 2
    counts = TransitionCounts.from_births(births.parent_niche, births.child_niche, niches)
    assert online.births == counts.births.sum()
    np.testing.assert_allclose(online.total - online.strength, counts.births / online.design_effect)
    np.testing.assert_allclose(online @ np.ones(niches.states), 1.0)


def test_it_does_not_matter_how_births_are_cut():
    niches = GridNiches((5, 6), ((0.0, 1.0), (0.0, 1.0)))
    births = drifting(600, niches.states, 3)
    found = []
    for cuts in ([0, 600], [0, 1, 250, 599, 600]):
        online = OnlineChain(niches)
        for start, end in pairwise(cuts):
            online.tell(births[start:end])
        online.settle()
        found.append(online @ np.linspace(0.0, 1.0, niches.states))
    np.testing.assert_array_equal(*found)
