"""Lineages on rows that are drawn where they are entered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import gammaln

from nichechain.archive.building import build
from nichechain.chain import TransitionCounts, estimate
from nichechain.evolvability import (
    elite_evolvability,
    genotype_evolvability,
    l_evolvability,
    niche_evolvability,
)
from nichechain.evolvability.coverage import rarefied_coverage
from nichechain.evolvability.niches import answer_for_niches
from nichechain.evolvability.question import MOST_EXACT, Question
from nichechain.evolvability.urns import Simulated, best_coverage, simulated_coverage
from nichechain.execution import Threads
from nichechain.niches import GridNiches
from nichechain.search.config import BuildConfig

_BOUNDS = ((0.0, 1.0), (0.0, 1.0))


def _counts(side=4, births=60, outside="state", seed=0):
    niches = GridNiches((side, side), _BOUNDS, outside)
    rng = np.random.default_rng(seed)
    parent = rng.integers(side * side // 2, size=births)
    child = np.minimum(rng.poisson(0.7 * parent + 2), niches.states - 1)
    return TransitionCounts.from_births(parent, child, niches)


def _posterior(counts, strength=3.0):
    return estimate(counts, strength=strength).posterior


@pytest.mark.parametrize("strength", [0.4, 5.0, 200.0])
def test_one_generation_equals_the_dirichlet_multinomial(strength):
    counts, lineages = _counts(), 7
    posterior = replace(_posterior(counts, strength), prior=None)
    roots = np.array([0, 3, 15])
    found = simulated_coverage(
        posterior, Question(l=1, draws=100, lineages=lineages), [lineages], roots=roots
    )
    alpha = posterior.weights.toarray()[roots] + strength * posterior.base.rows(roots)
    other = alpha.sum(axis=1, keepdims=True) - alpha
    whole = other + alpha
    missed = np.exp(gammaln(other + lineages) - gammaln(other) + gammaln(whole) - gammaln(whole + lineages))
    value, error, *_ = found.summary()
    np.testing.assert_array_less(np.abs(value - (1.0 - missed)[:, :16].sum(axis=1)), 4 * error)


@pytest.mark.parametrize(
    ("convention", "outside"), [("definition", "state"), ("procedure", "absorb"), ("definition", "clip")]
)
def test_equals_the_closed_form_over_draws(convention, outside):
    chain = estimate(_counts(outside=outside), strength=3.0)
    question = Question(l=4, lineages=9, convention=convention, draws=100)
    exact = niche_evolvability(chain, l=4, lineages=9, convention=convention, draws=100, method="exact")
    found = simulated_coverage(chain.posterior, question, [9, 2], roots=np.arange(16))
    value, error, low, high = found.summary()
    z = (value - exact.value) / np.hypot(error, exact.standard_error)
    assert np.abs(z).max() < 4.5
    np.testing.assert_allclose((high - low).mean(), (exact.high - exact.low).mean(), rtol=0.25)
    few = niche_evolvability(chain, l=4, lineages=2, convention=convention, draws=100, method="exact")
    value, error, *_ = found.summary(1)
    assert (np.abs(value - few.value) < 4.5 * np.hypot(error, few.standard_error)).all()


def test_offspring_begin_where_they_are():
    chain = estimate(_counts(), strength=3.0)
    share = np.zeros(17)
    share[[2, 9]] = 0.25, 0.75
    question = Question(l=3, lineages=6, draws=100)
    found = simulated_coverage(chain.posterior, question, [6], offspring=share)
    exact = l_evolvability(chain, offspring=share, l=3, lineages=6, draws=100, method="exact")
    value, error, *_ = found.summary()
    assert abs(value[0] - exact.value) < 4 * np.hypot(error[0], exact.standard_error)


def test_as_many_lineages_as_there_are_count_as_they_are():
    # Of all M lineages, M are drawn: rarefaction changes nothing.
    from nichechain.evolvability.urn_steps import count
    from nichechain.evolvability.urns import hit_probabilities

    states = np.array([[0, 1, 1, 2, 2, 1, 5, 2]])  # two generations of four lineages; 5 is no niche
    tables = [np.stack([hit_probabilities(m, u) for u in (1, 2)]) for m in (4, 2, 2)]
    whole, first, second = count(states, 4, 2, 5, *tables)
    # Lineages visit {0, 2}, {1}, {1, 5} and {2}.
    assert whole[0, 0] == pytest.approx((2 + 1 + 1 + 1) / 4)
    assert whole[0, 1] == pytest.approx(np.mean([3, 3, 2, 1, 2, 2]))
    assert (first[0, 1], second[0, 1]) == (3, 2)
    assert hit_probabilities(4, 2)[1] == pytest.approx(rarefied_coverage([1, 3], 2) - 1.0)


def test_simulation_does_not_widen_the_interval():
    rng = np.random.default_rng(0)
    truth = rng.normal(50.0, 3.0, (4000, 2, 1))
    noisy = truth + rng.normal(0.0, 4.0, truth.shape)
    low, high = Simulated(noisy, np.full(truth.shape, 16.0)).summary()[2:]
    np.testing.assert_allclose(high - low, 2 * 1.645 * 3.0, rtol=0.06)


def test_the_number_of_states_decides_by_default():
    side = 32
    assert side**2 > MOST_EXACT
    few, many = estimate(_counts()), estimate(_counts(side, 300))
    assert niche_evolvability(few, l=2, lineages=5, draws=2).method == "exact"
    roots = np.array([3, 7])
    found = answer_for_niches(many, Question(l=2, lineages=5, draws=3), roots=roots)
    assert found.method == "urns"
    assert np.flatnonzero(np.isfinite(found.value)).tolist() == roots.tolist()
    assert l_evolvability(many, niche=3, l=2, lineages=5, draws=3).method == "urns"
    exact = replace(Question(l=2, lineages=5, draws=3), method="exact")
    assert answer_for_niches(many, exact, roots=roots).method == "exact"


def test_scores_of_some_niches_are_those_of_all():
    chain = estimate(_counts())
    question = Question(l=3, lineages=5, draws=4)
    every, some = (
        answer_for_niches(chain, question),
        answer_for_niches(chain, question, roots=np.array([1, 8])),
    )
    np.testing.assert_allclose(some.value[[1, 8]], every.value[[1, 8]], rtol=1e-13)
    assert np.isnan(some.value[0])


def test_only_what_may_be_best_is_followed_to_the_end():
    chain = estimate(_counts(births=4000), strength=3.0)
    question, roots = Question(l=3, lineages=6, draws=60), np.arange(16)
    exact = niche_evolvability(chain, l=3, lineages=6, draws=400, method="exact")
    left, found = best_coverage(chain.posterior, question, roots, 2)
    assert set(np.argsort(exact.value)[-2:]) <= set(left)
    assert left.size < 16
    assert found.coverage.shape == (60, left.size, 1)
    value, error, *_ = found.summary()
    assert (np.abs(value - exact.value[left]) < 4.5 * np.hypot(error, exact.standard_error[left])).all()
    # Whoever asks for as many as there are gets them all, of as many draws.
    everyone, again = best_coverage(chain.posterior, question, roots, 16)
    np.testing.assert_array_equal(everyone, roots)
    assert again.coverage.shape == (60, 16, 1)


def test_a_copy_is_of_the_visit_that_its_number_says():
    # No birth and no base: the number alone says which of the visits before is copied, the newest first.
    from nichechain.chain.urn_steps import choose

    rng = np.random.default_rng(0)
    states = rng.integers(3, size=(4, 100))
    uniform, origin = rng.random((4, 50)), np.empty((4, 50), np.int64)
    nothing = np.zeros(4, np.int64)
    choose(nothing, nothing, np.zeros(1), np.zeros(3), -1, states, 7, 50, uniform, origin)
    for root in range(4):
        for k in range(50):
            alike = np.flatnonzero(states[root, 7 : 50 + k] == states[root, 50 + k]) + 7
            assert origin[root, k] == alike[::-1][int(uniform[root, k] * alike.size)]


@pytest.mark.parametrize("convention", ["definition", "procedure"])
def test_genotypes_of_a_record_agree_with_the_closed_form(tmp_path, monkeypatch, convention):
    config = BuildConfig("arm", (6, 6), ((-1, 1), (-1, 1)), evaluations=1500, scale=0.3)
    with Threads(1) as threads:
        archive = build(config, tmp_path / "a", threads)
    chain = archive.chain()
    asked = {"l": 3, "lineages": 12, "draws": 120, "convention": convention, "chain": chain}
    exact = elite_evolvability(archive, **asked).set_index("niche")
    elite = archive.elite(int(exact["recorded"].idxmax()))
    of_one = genotype_evolvability(archive, elite, **asked)
    share = genotype_evolvability(archive, elite, first_generation="empirical", **asked)
    monkeypatch.setattr(Question, "by_urns", lambda *_: True)
    simulated = elite_evolvability(archive, **asked).set_index("niche").loc[exact.index]
    assert (exact["method"] == "exact").all()
    assert (simulated["method"] == "urns").all()
    error = np.hypot(exact["standard_error"], simulated["standard_error"])
    assert (np.abs(simulated["value"] - exact["value"]) < 4.5 * error).all()
    for first, known in (("posterior", of_one), ("empirical", share)):
        found = genotype_evolvability(archive, elite, first_generation=first, **asked)
        assert (found.method, found.recorded) == ("urns", known.recorded)
        assert abs(found.value - known.value) < 4.5 * np.hypot(found.standard_error, known.standard_error)
