"""The mean level of a chain on one draw of T, in closed form and by lineages."""

from __future__ import annotations

import numpy as np
import pytest

from nichechain import GridNiches, TransitionCounts, estimate
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability import question as asked
from nichechain.evolvability.coverage import expected_coverage
from nichechain.evolvability.level import level
from nichechain.evolvability.question import Question


@pytest.fixture(scope="module")
def posterior():
    rng = np.random.default_rng(0)
    niches = GridNiches((5, 5), ((0.0, 5.0), (0.0, 5.0)))
    parent = rng.integers(25, size=600)
    child = np.minimum(parent + rng.integers(0, 4, 600), 25)
    return estimate(TransitionCounts.from_pairs(parent, child, niches)).posterior


def test_the_level_is_the_mean_of_the_closed_form_on_the_same_draw(posterior):
    roots, question = np.array([0, 7, 19]), Question(l=3, lineages=8, seed=1)
    T = posterior.draw(keyed(1, Purpose.POSTERIOR, 0))
    expected = expected_coverage(T, T[roots], 3, [8, 1], counted=25).mean(axis=0)
    found = level(posterior, roots, question, [8, 1])
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_lineages_give_the_same_level_on_average(posterior, monkeypatch):
    roots = np.array([0, 7, 19])
    questions = [Question(l=3, lineages=8, seed=seed) for seed in range(200)]
    exact = [level(posterior, roots, question, [8, 1]) for question in questions]
    monkeypatch.setattr(asked, "MOST_EXACT", 1)
    drawn = [level(posterior, roots, question, [8, 1]) for question in questions]
    error = np.sqrt((np.var(exact, axis=0) + np.var(drawn, axis=0)) / 200)
    assert (np.abs(np.mean(exact, axis=0) - np.mean(drawn, axis=0)) < 4.5 * error).all()
