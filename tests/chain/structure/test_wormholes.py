"""Wormholes: what is expected of a pair by births of others, tails, flags."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest
from scipy import sparse, stats

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate
from nichechain.chain.structure import transitions
from nichechain.chain.structure.wormholes import wormhole_exposure, wormholes

GRID = GridNiches((6, 5), ((0.0, 6.0), (0.0, 10.0)))
JUMP = (2, 27)


def _births(rng, size=4000, jumps=40):
    """Children next to their parents, a few outside, and a wormhole from niche 2 to niche 27."""
    x, y = rng.integers(6, size=size), rng.integers(5, size=size)
    to = np.clip(x + rng.integers(-1, 2, size), 0, 5), np.clip(y + rng.integers(-1, 2, size), 0, 4)
    parent, child = x * 5 + y, to[0] * 5 + to[1]
    child[rng.random(size) < 0.05] = 30
    parent, child = np.append(parent, np.full(jumps, JUMP[0])), np.append(child, np.full(jumps, JUMP[1]))
    return TransitionCounts.from_pairs(parent, child, GRID)


def _by_hand(counts, i, j):
    """Displacement and destination of a pair from all births but its own, counted one by one."""
    cells = [divmod(niche, 5) for niche in range(30)]
    matrix = counts.matrix.toarray()
    matrix[i, j] = 0
    kernel = {}
    for a in range(30):
        for b in range(30):
            move = (cells[b][0] - cells[a][0], cells[b][1] - cells[a][1])
            # Half a birth at no distance, once, as the base measure has it.
            kernel[move] = kernel.get(move, 0.0) + matrix[a, b]
    kernel[0, 0] += 0.5
    ways = {b: (cells[b][0] - cells[i][0], cells[b][1] - cells[i][1]) for b in range(30)}
    inside = matrix[:30, :30].sum()
    leaving = matrix[:30, 30].sum() / (matrix[:30, 30].sum() + inside)
    so_far = (kernel[ways[j]] + 0.5 / 30) / (sum(kernel[move] for move in ways.values()) + 0.5)
    there = (matrix[:, j].sum() + 1 / 31 + 0.5 / 30) / (matrix.sum() + 1.0 + 0.5)
    return (1 - leaving) * so_far, there


def test_expected_without_the_pairs_own_births():
    counts = _births(np.random.default_rng(0))
    frame = wormholes(estimate(counts))
    rows = frame.set_index(["parent", "child"])
    matrix = counts.matrix.toarray()
    for i, j in (JUMP, (0, 1), (12, 17), (29, 24), tuple(frame.loc[len(frame) - 1, ["parent", "child"]])):
        row = rows.loc[i, j]
        displacement, destination = _by_hand(counts, i, j)
        assert row["displacement"] == pytest.approx(displacement, rel=1e-9)
        assert row["destination"] == pytest.approx(destination, rel=1e-9)
        assert row["count"] == matrix[i, j]
        assert row["exposure"] == matrix[i].sum()
    # Cells are 1 by 2.
    assert rows.loc[JUMP, "distance"] == pytest.approx(np.hypot(5.0, 0.0))
    assert rows.loc[(0, 1), "distance"] == pytest.approx(2.0)
    assert rows.loc[JUMP, "parent_index"] == "0,2"
    assert rows.loc[JUMP, "child_index"] == "5,2"


def test_every_observed_pair_of_niches_is_there_once():
    counts = _births(np.random.default_rng(1))
    frame = wormholes(estimate(counts))
    matrix = counts.matrix.toarray()[:30, :30]
    np.fill_diagonal(matrix, 0)
    assert {(i, j) for i, j in zip(frame["parent"], frame["child"], strict=True)} == set(
        zip(*(axis.tolist() for axis in np.nonzero(matrix)), strict=True)
    )
    assert len(frame) == np.count_nonzero(matrix)
    assert (frame["singleton"] == (frame["count"] == 1)).all()


def test_posterior_tail_is_that_of_the_beta_marginal():
    counts = _births(np.random.default_rng(2))
    chain = estimate(counts, "dirichlet", strength="jeffreys")
    frame = wormholes(chain, times=3.0)
    # Half a birth in each of 31 states: Beta(c + 1/2, births − c + 30/2).
    a = frame["count"] + 0.5
    b = frame["exposure"] - frame["count"] + 15.0
    np.testing.assert_allclose(frame["probability"], a / (a + b))
    np.testing.assert_allclose(frame["exceeds"], stats.beta.sf(3.0 * frame["displacement"], a, b))
    both = wormholes(chain, times=3.0, beyond="both").set_index(["parent", "child"])
    expected = 3.0 * np.maximum(both["displacement"], both["destination"])
    a, b = both["count"] + 0.5, both["exposure"] - both["count"] + 15.0
    np.testing.assert_allclose(both["exceeds"], stats.beta.sf(expected, a, b))


@pytest.mark.parametrize("beyond", ["displacement", "both"])
def test_the_wormhole_is_found_and_nothing_else(beyond):
    counts = _births(np.random.default_rng(3), jumps=100)
    frame = wormholes(estimate(counts), beyond=beyond, times=5.0, expected_false=0.05)
    assert tuple(frame.loc[0, ["parent", "child"]]) == JUMP
    assert frame["wormhole"].tolist() == [True] + [False] * (len(frame) - 1)


def test_a_place_where_all_fall_is_no_wormhole_for_both():
    rng = np.random.default_rng(4)
    counts = _births(rng, jumps=0)
    broken = rng.integers(30, size=3000)
    counts = counts + TransitionCounts.from_pairs(broken, np.full(3000, 12), GRID)
    by_displacement = wormholes(estimate(counts), times=4.0)
    far = by_displacement[by_displacement["wormhole"]]
    assert len(far) > 3
    assert set(far["child"]) == {12}
    assert not wormholes(estimate(counts), times=4.0, beyond="both")["wormhole"].any()


def test_flags_stay_within_the_expected_number_of_false_ones():
    chain = estimate(_births(np.random.default_rng(5)))
    sizes = []
    for allowed in (0.0, 0.1, 1.0, 10.0):
        frame = wormholes(chain, times=2.0, expected_false=allowed)
        flagged = frame[frame["wormhole"]]
        assert (1.0 - flagged["exceeds"]).sum() <= allowed
        # Flagged from the top, as many as can be, and never what is less likely than not.
        assert frame["wormhole"].is_monotonic_decreasing
        after = frame.loc[len(flagged)]
        assert after["cumulated_false"] > allowed or after["exceeds"] <= 0.5
        assert (flagged["exceeds"] > 0.5).all()
        sizes.append(len(flagged))
    assert sizes == sorted(sizes)


def test_false_flags_are_rare_where_displacement_is_all():
    # Uniform mutations on a torus-free grid, no wormhole: the budget of one false flag holds.
    flagged = [
        wormholes(estimate(_births(np.random.default_rng(seed), jumps=0)), times=3.0)["wormhole"].sum()
        for seed in range(10)
    ]
    assert np.mean(flagged) <= 1.0


def test_no_births_no_wormholes():
    frame = wormholes(estimate(TransitionCounts.from_pairs([], [], GRID)))
    assert len(frame) == 0
    assert {"count", "exceeds", "wormhole"} <= set(frame.columns)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"times": 0.5}, "times is 0.5"),
        ({"times": np.inf}, "times is inf"),
        ({"expected_false": -1.0}, "expected_false is -1"),
        ({"expected_false": np.nan}, "expected_false is nan"),
        ({"beyond": "all"}, "beyond is 'all'"),
    ],
)
def test_bad_input(options, message):
    with pytest.raises(NichechainError, match=message):
        wormholes(estimate(_births(np.random.default_rng(6))), **options)


def test_only_estimated_chains_have_wormholes():
    for chain in (NicheChain(np.eye(2)), estimate(_births(np.random.default_rng(7)), "mle")):
        with pytest.raises(NichechainError, match="need a chain with a posterior"):
            wormholes(chain)


def test_exposure_by_enumeration():
    """All lineages of three generations on four niches, of which two transitions are wormholes."""
    transition = np.random.default_rng(2).dirichlet(np.ones(4), 4)
    found = pd.DataFrame({"parent": [0, 2, 1], "child": [3, 0, 2], "wormhole": [True, True, False]})
    ways = {(0, 3), (2, 0)}
    expected = np.zeros(4)
    for lineage in itertools.product(range(4), repeat=4):
        steps = list(itertools.pairwise(lineage))
        if ways & set(steps):
            expected[lineage[0]] += np.prod([transition[step] for step in steps])
    for form in (np.array, sparse.csr_array):
        chain = NicheChain(form(transition))
        np.testing.assert_allclose(wormhole_exposure(chain, found, l=3), expected, rtol=1e-13)
    np.testing.assert_allclose(
        wormhole_exposure(chain, found), [transition[0, 3], 0, transition[2, 0], 0], rtol=1e-15
    )
    none = found.assign(wormhole=False)
    assert wormhole_exposure(chain, none, l=3).tolist() == [0, 0, 0, 0]


def test_exposure_where_t_is_kept_in_parts(monkeypatch):
    niches = GridNiches((12, 12), ((0.0, 1.0), (0.0, 1.0)))
    pairs = np.random.default_rng(0).integers(niches.states, size=(2, 2000))
    chain = estimate(TransitionCounts.from_pairs(*pairs, niches), strength=5.0)
    found = pd.DataFrame({"parent": pairs[0], "child": pairs[1], "wormhole": True}).drop_duplicates()
    whole = wormhole_exposure(chain, found, l=4)
    monkeypatch.setattr(transitions, "_WHOLE", 10)
    np.testing.assert_allclose(wormhole_exposure(chain, found, l=4), whole, rtol=1e-12)


@pytest.mark.parametrize(
    ("found", "message"),
    [
        (pd.DataFrame({"parent": [0], "child": [1]}), "no column wormhole"),
        (
            pd.DataFrame({"parent": [0], "child": [9], "wormhole": [True]}),
            "state 9, but this chain has 3 states",
        ),
    ],
)
def test_tables_that_name_no_wormholes(found, message):
    with pytest.raises(NichechainError, match=message):
        wormhole_exposure(NicheChain(np.eye(3)), found)


def test_a_lineage_without_end_takes_some_wormhole():
    chain = NicheChain([[0.9, 0.1, 0.0], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]])
    found = pd.DataFrame({"parent": [1], "child": [2], "wormhole": [True]})
    np.testing.assert_allclose(wormhole_exposure(chain, found, l=10**30), [1.0, 1.0, 0.0], atol=1e-12)
    with pytest.raises(NichechainError, match="found has no column parent"):
        wormhole_exposure(chain, np.zeros(3))
