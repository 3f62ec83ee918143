"""Inputs that other programs were reported to answer wrongly, each beside its right value.

PyEMMA 564, 714, 786, 1443; QuantEcon.py 18, 19; pyGPCCA 66; pyribs 74, 226; CellRank 567, 652;
msmbuilder 825.
"""

from __future__ import annotations

import numpy as np
import pytest

import nichechain as nc
from nichechain.chain.structure.metastable import metastable_sets
from nichechain.chain.structure.passage import mean_first_passage_times
from nichechain.chain.structure.quasi_stationary import quasi_stationary_distribution
from nichechain.chain.structure.stationary import stationary_distribution
from nichechain.cli.parsing import domain_options

LINE = nc.GridNiches((4,), ((0, 4),), "clip")
SLOW, SLOWER = 1e-9, 1e-14


def ladder(top: int, up: float) -> nc.NicheChain:
    """Birth and death: up with this probability, else down, held at both ends."""
    T = np.zeros((top + 1, top + 1))
    for i in range(top + 1):
        T[i, min(i + 1, top)] += up
        T[i, max(i - 1, 0)] += 1 - up
    return nc.NicheChain(T)


def test_a_ladder_that_is_hardly_ever_climbed():
    chain = ladder(20, 0.1)
    assert mean_first_passage_times(chain, 20)[0] == pytest.approx(1.7096717051798807e19, rel=1e-14)
    # 1 - 5.85e-20 is 1 to the last bit, and never above it.
    assert quasi_stationary_distribution(chain, list(range(20))).survival == 1.0


def test_two_rare_steps_one_after_the_other():
    chain = nc.NicheChain([[1 - SLOW, SLOW, 0], [1 - SLOW, 0, SLOW], [0, 0, 1]])
    assert mean_first_passage_times(chain, 2)[0] == pytest.approx(1.000000001e18, rel=1e-7)


def test_two_states_that_are_hardly_ever_left():
    chain = nc.NicheChain([[1 - SLOWER, SLOWER], [SLOWER / 10, 1 - SLOWER / 10]])
    np.testing.assert_allclose(stationary_distribution(chain)[0], [1 / 11, 10 / 11], rtol=1e-14)


def test_pairs_that_swap_are_the_groups_in_which_lineages_stay():
    pytest.importorskip("pygpcca")
    pairs = nc.NicheChain([[0, 0.95, 0.05, 0], [0.95, 0, 0, 0.05], [0.05, 0, 0, 0.95], [0, 0.05, 0.95, 0]])
    found = metastable_sets(pairs, 2)
    assert found.group[0] == found.group[1] != found.group[2] == found.group[3]
    np.testing.assert_allclose(np.diag(found.transition), 0.95, rtol=1e-12)
    apart = nc.NicheChain([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]])
    assert metastable_sets(apart, 3).group.tolist() == [0, 1, 2, 2]


def test_corners_in_single_precision_are_in_the_grid():
    grid = nc.GridNiches((20, 20), ((1.05, 1.55), (0.4, 1.1)))
    assert grid.of(np.array([[1.55, 1.1], [1.05, 0.4]], np.float32)).tolist() == [399, 0]


@pytest.mark.parametrize("births", [[2**62] * 3, [1e19, 1, 1]])
def test_births_that_cannot_be_counted_are_refused(births):
    with pytest.raises(nc.NichechainError, match=r"births in all, but at most 2\*\*53"):
        nc.TransitionCounts.from_pairs([0, 0, 0], [1, 1, 2], LINE, n=births)


def test_a_sentinel_that_fits_no_signed_number_is_refused():
    with pytest.raises(nc.NichechainError, match=r"18446744073709551615, but must be below 2\*\*63"):
        nc.TransitionCounts.from_births(np.array([2**64 - 1, 0], np.uint64), [1, 2], LINE)


def test_complex_rows_are_refused_and_rows_of_single_precision_told_the_remedy():
    with pytest.raises(nc.NichechainError, match="complex"):
        nc.NicheChain(np.array([[1, 0], [0.5 + 0.3j, 0.5 - 0.3j]]))
    rows = np.random.default_rng(0).random((400, 400)).astype(np.float32)
    rows /= rows.sum(axis=1, keepdims=True)
    with pytest.raises(nc.NichechainError, match="normalize=True"):
        nc.NicheChain(rows.astype(float))
    assert nc.NicheChain(rows.astype(float), normalize=True).states == 400


def test_a_matrix_is_no_table_of_counts():
    with pytest.raises(nc.NichechainError, match=r"TransitionCounts\.from_matrix"):
        nc.estimate(np.eye(3))


def test_false_is_not_true():
    assert domain_options(["env.flag=False", "env.other=True"]) == {"env.flag": False, "env.other": True}


def test_the_shipped_archive():
    archive = nc.load("fetch-pick-and-place")
    births = archive.births()
    counts = nc.TransitionCounts.from_births(births.parent_niche, births.child_niche, archive.niches)
    assert counts.births.sum() == births.parent_niche.notna().sum()
    outside = archive.elite(400)
    assert outside.state == 400
    assert outside.uid == archive.elite("outside").uid
    with pytest.raises(nc.NichechainError, match=r"groups is 3, but this chain has \d+ recurrent classes"):
        metastable_sets(archive.chain(estimator="mle", unvisited="self"), 3)
