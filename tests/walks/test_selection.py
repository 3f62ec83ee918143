"""Selection rules: against sorting by hand, with ties and failures; the draw."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from nichechain import NichechainError
from nichechain.walks import AtLeast, BetterThanParent, Selective, TopFraction, Uniform
from nichechain.walks.selection import Scores, draw


@st.composite
def scores(draw_from, largest=12):
    """Few different scores, so that ties are the rule; some individuals failed."""
    rng = np.random.default_rng(draw_from(st.integers(0, 2**32)))
    walks, count = draw_from(st.integers(1, 4)), draw_from(st.integers(1, largest))
    score = rng.integers(0, 4, (walks, count)).astype(float)
    eligible = rng.random((walks, count)) < 0.8
    score[~eligible & (rng.random((walks, count)) < 0.5)] = np.nan
    parent = np.broadcast_to(rng.integers(0, 4, (walks, 1)).astype(float), score.shape)
    return Scores(score, parent, rng.random((walks, count)), eligible, draw_from(st.integers(1, 3)))


def _ranked(given_scores, walk):
    """The eligible of a walk, the best first."""
    columns = np.flatnonzero(given_scores.eligible[walk]).tolist()
    score, key = given_scores.score[walk], given_scores.tie_key[walk]
    return sorted(columns, key=lambda i: (-score[i], -key[i]))


@given(scores(), st.integers(1, 20), st.integers(1, 20))
def test_the_best_share_passes(given_scores, above, below):
    share = Fraction(min(above, below), max(above, below))
    passing = TopFraction(float(share)).candidates(given_scores)
    everyone = TopFraction(float(share), ties="all").candidates(given_scores)
    for walk, row in enumerate(passing):
        ranked = _ranked(given_scores, walk)
        count = max(given_scores.places, math.ceil(share * len(ranked)))
        best = ranked[:count]
        assert np.flatnonzero(row).tolist() == sorted(best)
        score = given_scores.score[walk]
        tied = [i for i in ranked if score[i] >= score[best[-1]]]
        assert np.flatnonzero(everyone[walk]).tolist() == sorted(tied)


@given(scores())
def test_the_best_only(given_scores):
    passing = Selective().candidates(given_scores)
    for walk, row in enumerate(passing):
        best = _ranked(given_scores, walk)[: given_scores.places]
        assert np.flatnonzero(row).tolist() == sorted(best)


@pytest.mark.parametrize(
    ("fraction", "n", "count"),
    [
        (0.07, 100, 7),
        (0.1, 30, 3),
        (0.1, 29, 3),
        (1 / 30, 30, 1),
        (1 / 49, 49, 1),
        (0.75, 30, 23),
        (0.57, 100, 57),
        (0.58, 50, 29),
        (1e-6, 30, 1),
        (1.0, 30, 30),
    ],
)
def test_rounding_does_not_let_one_more_pass(fraction, n, count):
    flat = Scores(
        np.zeros((1, n)), np.zeros((1, n)), np.random.default_rng(0).random((1, n)), np.ones((1, n), bool), 1
    )
    assert TopFraction(fraction).candidates(flat).sum() == count


@given(scores())
def test_thresholds(given_scores):
    score, parent, eligible = given_scores.score, given_scores.parent_score, given_scores.eligible
    for rule, passes in (
        (AtLeast(2.0), lambda own, _: own >= 2.0),
        (BetterThanParent(), lambda own, others: own > others),
        (BetterThanParent(strict=False), lambda own, others: own >= others),
        (Uniform(), lambda own, others: True),  # noqa: ARG005
    ):
        found = rule.candidates(given_scores)
        for index in np.ndindex(score.shape):
            assert found[index] == (eligible[index] and passes(score[index], parent[index]))


def test_a_draw_is_uniform_over_the_candidates():
    candidates = np.array([[False, True, False, True, True]])
    # The middles of three equal parts of [0, 1).
    drawn = [draw(candidates, np.array([[middle]])).item() for middle in (1 / 6, 3 / 6, 5 / 6)]
    assert drawn == [1, 3, 4]
    pairs = {
        tuple(draw(candidates, np.array([[a, b]]))[0].tolist())
        for a in (1 / 6, 3 / 6, 5 / 6)
        for b in (0.25, 0.75)
    }
    assert pairs == {(1, 3), (1, 4), (3, 1), (3, 4), (4, 1), (4, 3)}


def test_places_without_a_candidate_stay_open():
    candidates = np.array([[False, True, False], [False, False, False], [True, True, True]])
    drawn = draw(candidates, np.zeros((3, 2)))
    assert drawn.tolist() == [[1, -1], [-1, -1], [0, 1]]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: TopFraction(0.0), "fraction is 0.0, but must be above 0 and at most 1"),
        (lambda: TopFraction(1.0001), "fraction is 1.0001"),
        (lambda: TopFraction(-0.1), "fraction is -0.1"),
        (lambda: TopFraction(math.nan), "fraction is nan"),
        (lambda: TopFraction(0.1, ties="first"), "ties is 'first'"),
        (lambda: AtLeast(math.nan), "threshold is nan"),
    ],
)
def test_bad_input_is_one_sentence(call, message):
    with pytest.raises(NichechainError, match=message):
        call()
