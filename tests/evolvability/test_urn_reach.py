"""Reach by lineages that are followed: what the closed form says, within the noise of both."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from nichechain.core.intervals import drawn_interval
from nichechain.evolvability import question as asked
from nichechain.evolvability import urn_reach
from nichechain.evolvability.reach import reach


@pytest.fixture(scope="module")
def chain(arm_archive):
    return arm_archive.chain()


def _both(chain, monkeypatch, **asks):
    exact = reach(chain, draws=300, **asks)
    monkeypatch.setattr(asked, "MOST_EXACT", 1)
    monkeypatch.setattr(urn_reach, "_DESCENDANTS", 4_000)
    return exact, reach(chain, draws=300, **asks)


@pytest.mark.parametrize("convention", ["definition", "procedure"])
def test_lineages_of_a_niche_reach_what_the_closed_form_says(chain, monkeypatch, convention):
    niche = int(np.argmax(chain.births))
    spreads = []

    def interval(some):
        spreads.append(np.std(some, axis=0))
        return drawn_interval(some)

    monkeypatch.setattr(sys.modules[reach.__module__], "drawn_interval", interval)
    exact, drawn = _both(chain, monkeypatch, niche=niche, l=3, lineages=8, convention=convention)
    # 300 draws of 1,333 lineages or fewer, and the spread of T over draws.
    (spread,) = spreads
    assert (np.abs(drawn.at_least_one - exact.at_least_one) < 6 * (spread + 1e-3) / np.sqrt(150)).all()
    np.testing.assert_allclose(drawn.visit, exact.visit, atol=0.01)
    np.testing.assert_allclose(drawn.expected_visits, exact.expected_visits, atol=0.12)
    assert drawn.expected_visits.sum() == pytest.approx(exact.expected_visits.sum(), abs=0.1)
    assert drawn.evolvability == pytest.approx(exact.evolvability, rel=0.02)
    own = 1.0 if convention == "procedure" else drawn.visit[niche]
    assert drawn.visit[niche] == own
    likely = exact.at_least_one > 0.3
    np.testing.assert_allclose((drawn.high - drawn.low)[likely], (exact.high - exact.low)[likely], atol=0.12)
    assert drawn.low.min() >= 0.0
    assert drawn.high.max() <= 1.0


def test_children_of_a_genotype_count_as_its_first_generation(chain, monkeypatch):
    offspring = np.zeros(chain.n_niches)
    offspring[[3, 40]] = 0.25, 0.75
    exact, drawn = _both(chain, monkeypatch, offspring=offspring, l=1, lineages=2)
    np.testing.assert_allclose(drawn.visit, offspring, atol=0.003)
    np.testing.assert_allclose(drawn.at_least_one, exact.at_least_one, atol=0.005)
