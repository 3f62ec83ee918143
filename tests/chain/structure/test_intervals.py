"""Intervals over posterior draws: a row whose posterior is known, and how often they hold the truth."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate
from nichechain.chain.structure.intervals import posterior_interval
from nichechain.chain.structure.passage import hitting_probabilities, mean_first_passage_times
from nichechain.chain.structure.stationary import stationary_distribution
from nichechain.evolvability.reach import reach

NICHES = GridNiches((2,), ((0.0, 1.0),), "clip")
# Five of seven children leave niche 0, three of thirteen niche 1; a birth more, half in each niche.
CHAIN = estimate(TransitionCounts.from_matrix([[2, 5], [3, 10]], NICHES), "dirichlet", strength=1.0)


def test_a_row_has_its_beta_distribution():
    found = posterior_interval(CHAIN, lambda chain: chain.T.toarray()[0, 1], draws=400, level=0.8)
    truth = stats.beta(5.5, 2.5)
    assert found.mean == pytest.approx(truth.mean(), abs=0.03)
    assert found.low == pytest.approx(truth.ppf(0.1), abs=0.05)
    assert found.high == pytest.approx(truth.ppf(0.9), abs=0.05)
    assert (found.level, found.draws) == (0.8, 400)


def test_answers_are_transformed_draw_by_draw():
    """In two states the time is 1 / T_01 and the long run T_01 / (T_01 + T_10)."""
    step = posterior_interval(CHAIN, lambda chain: chain.T.toarray()[0, 1], draws=99)
    time = posterior_interval(CHAIN, lambda chain: mean_first_passage_times(chain, 1)[0], draws=99)
    # The fifth of 99 draws, and the fifth from above.
    assert time.low == pytest.approx(1.0 / step.high)
    assert time.high == pytest.approx(1.0 / step.low)
    run = posterior_interval(CHAIN, stationary_distribution, draws=99)
    assert run.mean.shape == run.low.shape == (1, 2)
    np.testing.assert_allclose(run.low[0, 0], 1.0 - run.high[0, 1])


def test_the_kth_of_n_draws_is_the_quantile_k_of_n_and_one():
    values = iter(np.random.default_rng(0).permutation(np.arange(19.0)))
    found = posterior_interval(CHAIN, lambda _: next(values), draws=19, level=0.9)
    # Weibull: the first and the last of 19.
    assert (found.low, found.high) == (0.0, 18.0)
    values = iter([np.inf] * 10 + [1.0] * 10)
    found = posterior_interval(CHAIN, lambda _: next(values), draws=20)
    assert (found.low, found.high, found.mean) == (1.0, np.inf, np.inf)


def test_any_question_of_a_chain():
    found = posterior_interval(CHAIN, lambda chain: reach(chain, niche=0, l=2).at_least_one, draws=5)
    assert found.mean.shape == (2,)
    assert posterior_interval(CHAIN, lambda chain: hitting_probabilities(chain, 0), draws=2).low.tolist() == [
        1,
        1,
    ]
    again = posterior_interval(CHAIN, lambda chain: mean_first_passage_times(chain, 1), draws=5, seed=3)
    same = posterior_interval(CHAIN, lambda chain: mean_first_passage_times(chain, 1), draws=5, seed=3)
    np.testing.assert_array_equal(again.mean, same.mean)


def test_what_is_refused():
    with pytest.raises(NichechainError, match="an interval needs a chain with a posterior"):
        posterior_interval(NicheChain(np.eye(2)), stationary_distribution)
    sizes = iter([1, 2])
    with pytest.raises(NichechainError, match=r"the answer has shape \(2,\) for draw 1"):
        posterior_interval(CHAIN, lambda _: np.zeros(next(sizes)))


def _first_share(chain):
    """Long-run share of the first of two states."""
    away, back = chain.operator[[0, 1], [1, 0]]
    return back / (away + back)


def test_intervals_hold_the_truth_as_often_as_they_say():
    """T drawn from the prior, births from T: 90 % intervals hold what is true of T nine times in ten."""
    rng = np.random.default_rng(5)
    held, trials = 0, 100
    for trial in range(trials):
        truth = rng.dirichlet([0.5, 0.5], 2)
        counts = np.stack([rng.multinomial(12, row) for row in truth])
        chain = estimate(TransitionCounts.from_matrix(counts, NICHES), "dirichlet", strength=1.0)
        found = posterior_interval(chain, _first_share, draws=19, level=0.9, seed=trial)
        held += bool(found.low <= _first_share(NicheChain(truth)) <= found.high)
    # Four standard errors of a binomial share.
    assert abs(held / trials - 0.9) < 4 * np.sqrt(0.09 / trials)
