"""Urns of few states do what urns of any size do."""

from dataclasses import replace

import numpy as np
import pytest

from nichechain.chain import TransitionCounts, estimate
from nichechain.chain.small_urns import SmallUrns, WholeRows
from nichechain.chain.urns import UrnRows, Urns
from nichechain.niches import GridNiches

MOVES, LINEAGES, ROOTS = 3, 4, 20_000


def posterior(outside="state"):
    niches = GridNiches((3, 3), ((0.0, 1.0), (0.0, 1.0)), outside)
    rng = np.random.default_rng(0)
    parent = rng.integers(9, size=80)
    child = np.minimum(rng.poisson(0.7 * parent + 2), niches.states - 1)
    return replace(
        estimate(TransitionCounts.from_births(parent, child, niches), strength=3.0).posterior, prior=None
    )


def alike(states):
    """How many niches lineages reach, how many are where they began, and how many end together."""
    last = states[:, -LINEAGES:]
    ordered = np.sort(states[:, LINEAGES:], axis=1)
    reached = (np.diff(ordered, axis=1) != 0).sum(axis=1) + 1.0
    return np.stack([reached, (last == states[:, :1]).sum(axis=1), (last[:, 0] == last[:, 1]) + 0.0])


@pytest.mark.parametrize("outside", ["state", "absorb"])
@pytest.mark.parametrize("concentration", [0.5, 6.0, 1e4])
def test_walks_are_distributed_alike(concentration, outside):
    some = posterior(outside)
    rows = UrnRows.of(some)
    first, later = rows.scattered(4.0), rows.scattered(concentration)
    root = np.full((ROOTS, LINEAGES), 4)
    large = Urns(some, first, later).walks(root, MOVES, np.random.default_rng(1), roots=True)
    base = some.base.rows(np.arange(rows.strength.size))
    whole = [WholeRows.of(each, base, absorbing=some.absorbing) for each in (first, later)]
    small = SmallUrns(*whole).walks(root, MOVES, np.random.default_rng(2))
    assert small.shape == large.shape
    ours, theirs = alike(small), alike(large)
    error = np.sqrt((ours.var(axis=1) + theirs.var(axis=1)) / ROOTS)
    assert (np.abs(ours.mean(axis=1) - theirs.mean(axis=1)) < 4.5 * error).all()


def test_kinds_of_roots_have_rows_as_sure_as_their_own():
    some = posterior()
    rows = UrnRows.of(some)
    first, base = rows.scattered(1e6), some.base.rows(np.arange(rows.strength.size))
    kinds = [rows.scattered(0.1), rows.scattered(1e6)]
    whole = WholeRows.of(kinds[0], base, absorbing=False)
    urns = SmallUrns(WholeRows.of(first, base, absorbing=False), whole.worth(kinds))
    reached = alike(urns.walks(np.full((2 * ROOTS, LINEAGES), 4), MOVES, np.random.default_rng(3)))[0]
    assert reached[:ROOTS].mean() < reached[ROOTS:].mean() - 0.3
