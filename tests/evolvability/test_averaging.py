"""l-evolvability of estimated chains: averages over draws, intervals, seeds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nichechain import NicheChain, estimate, l_evolvability, niche_evolvability
from nichechain.core.randomness import Purpose, keyed

from .samples import GRID, simulated_counts


def test_an_estimated_chain_is_averaged_over_draws():
    counts, _ = simulated_counts(60)
    chain = estimate(counts, strength=4.0)
    result = niche_evolvability(chain, l=3, lineages=20, draws=40, seed=5)
    drawn = []
    for number in range(40):
        matrix = chain.posterior.draw(keyed(5, Purpose.POSTERIOR, number)).toarray()
        drawn.append(niche_evolvability(NicheChain(matrix, outside=9), l=3, lineages=20).value)
    np.testing.assert_allclose(result.value, np.mean(drawn, axis=0), rtol=1e-9)
    np.testing.assert_allclose(
        result.standard_error, np.std(drawn, axis=0, ddof=1) / math.sqrt(40), rtol=1e-9
    )
    np.testing.assert_allclose(result.low, np.quantile(drawn, 0.05, axis=0, method="weibull"), rtol=1e-9)
    np.testing.assert_allclose(result.high, np.quantile(drawn, 0.95, axis=0, method="weibull"), rtol=1e-9)
    np.testing.assert_array_equal(result.births, counts.births[:9])
    for i in (0, 4):
        one = l_evolvability(chain, niche=GRID.index(i), l=3, lineages=20, draws=40, seed=5)
        assert one.value == pytest.approx(result.value[i], rel=1e-12)
        assert one.births == counts.births[i]


def test_plugging_in_the_posterior_mean_overstates():
    # Coverage is concave in a row of T, so its mean over draws lies below its value at their mean
    # (at l = 1, where it depends on one row only).
    counts, _ = simulated_counts(60)
    chain = estimate(counts, strength=4.0)
    averaged = niche_evolvability(chain, l=1, lineages=30, draws=100)
    plugged_in = niche_evolvability(NicheChain(chain.T, outside=9), l=1, lineages=30).value
    assert (averaged.value + 4 * averaged.standard_error < plugged_in).all()


def test_monte_carlo_on_an_estimated_chain_agrees_with_exact():
    counts, _ = simulated_counts(200)
    chain = estimate(counts, strength=4.0)
    options = {"niche": 4, "l": 3, "lineages": 10, "draws": 60, "seed": 3}
    exact = l_evolvability(chain, **options)
    sampled = l_evolvability(chain, method="monte-carlo", repeats=6000, **options)
    # The same draws of T: what differs is the simulations' own error, at most 3 niches / √6000 or so.
    assert abs(sampled.value - exact.value) <= 4 * 3 / math.sqrt(6000)
    assert sampled.low < sampled.value < sampled.high


def test_births_narrow_the_interval():
    widths = []
    for births in (50, 1000, 20_000):
        counts, _ = simulated_counts(births)
        result = niche_evolvability(estimate(counts), l=3, lineages=10)
        widths.append(float(np.mean(result.high - result.low)))
    # 20 times the births, once they outweigh the prior, make it √20 = 4.5 times as narrow.
    assert widths[0] > widths[1] > 3 * widths[2]


def test_many_births_lead_to_the_truth():
    counts, truth = simulated_counts(40_000)
    exact = niche_evolvability(NicheChain(truth, outside=9), l=3, lineages=10).value
    for estimator in ("dirichlet", "mle"):
        value = niche_evolvability(estimate(counts, estimator), l=3, lineages=10).value
        # 4,000 births per row leave about 1/√4000 of a share open.
        np.testing.assert_allclose(value, exact, rtol=0.02)


def test_results_are_functions_of_the_seed():
    counts, _ = simulated_counts(60)
    chain = estimate(counts)
    for options in ({}, {"method": "monte-carlo", "repeats": 60}):
        values = [
            l_evolvability(chain, niche=4, l=2, lineages=3, seed=seed, draws=20, **options).value
            for seed in (1, 1, 2)
        ]
        assert values[0] == values[1] != values[2]
