"""Answers as frames and rankings, and what they say of themselves."""

from __future__ import annotations

import numpy as np

from nichechain import NicheChain, TransitionCounts, estimate, l_evolvability, niche_evolvability

from .samples import GRID, T


def test_saturation_is_said():
    chain = NicheChain(T)
    # From niche 0, one lineage of l = 1 sees 1 of the 2 niches there are to see, fifty see both.
    assert not l_evolvability(chain, niche=0, l=1, lineages=1).saturated
    assert l_evolvability(chain, niche=0, l=1, lineages=50).saturated
    wide = NicheChain(np.full((50, 50), 0.02))
    assert not niche_evolvability(wide, l=2, lineages=10).saturated
    assert niche_evolvability(wide, l=2, lineages=200).saturated


def test_the_frame_and_the_ranking():
    parent = [0] * 25 + [4] * 20 + [5] * 19 + [8] * 30
    child = [0] * 25 + [3, 4] * 10 + [0, 1, 2, 3, 4, 5, 6, 7, 8] * 2 + [9] + [1, 2, 8] * 10
    chain = estimate(TransitionCounts.from_pairs(parent, child, GRID), "mle")
    result = niche_evolvability(chain, l=1, lineages=1000)
    frame = result.to_frame(chain)
    assert frame["niche"].tolist() == list(range(9))
    assert frame["index"].tolist() == ["0,0", "0,1", "0,2", "1,0", "1,1", "1,2", "2,0", "2,1", "2,2"]
    assert frame["births"].tolist() == [25, 0, 0, 0, 20, 19, 0, 0, 30]
    np.testing.assert_allclose(frame["value"], [1, 1, 1, 1, 2, 9, 1, 1, 3], rtol=1e-9)
    # Niche 5 sees the most, but has 19 births; 20 are enough.
    assert result.ranking(chain)["niche"].tolist() == [8, 4, 0]
    assert result.ranking(chain, min_births=19)["niche"].tolist() == [5, 8, 4, 0]
    assert len(result.ranking(chain, min_births=0)) == 9


def test_a_given_chain_is_ranked_whole():
    result = niche_evolvability(NicheChain(T), l=1, lineages=10)
    assert result.births is None
    assert result.ranking(NicheChain(T))["niche"].tolist() == [0, 1, 2]
