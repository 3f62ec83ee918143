"""What births of lineages say: found again where it was put in."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import sparse

import nichechain as nc
from nichechain.chain import estimate
from nichechain.chain.lineages import LineageLaw, fitted_law
from nichechain.chain.operator import PooledTransition
from nichechain.chain.urns import UrnRows
from nichechain.core.row_sampler import RowSampler
from nichechain.evolvability import niches as answers

GRID = nc.GridNiches((5, 5), ((0.0, 1.0), (0.0, 1.0)))
STATES, BROOD, LENGTH = 26, 10, 8


def truth(seed=0):
    """A T of which every row has eight niches that are likely."""
    return np.random.default_rng(seed).dirichlet(np.full(STATES, 0.3), size=STATES)


def tilted(T, stay):
    odds = T.copy()
    odds[np.diag_indices(STATES)] *= np.exp(stay)
    return odds / odds.sum(axis=1, keepdims=True)


def born(broods, *, stay=0.0, concentration=None, births=20_000, seed=1):
    """Births of a search with rows T, and broods whose elites have rows of their own."""
    rng = np.random.default_rng(seed)
    T = truth()
    parent = rng.integers(STATES, size=births)
    child = RowSampler(sparse.csr_array(T)).draw(parent, rng)
    # Every elite has one child: none takes after another.
    rows = [(10**6 + k, 10**7 + k, i, j, False) for k, (i, j) in enumerate(zip(parent, child, strict=True))]
    uid = 0
    for root in rng.integers(STATES, size=broods):
        own = tilted(T, stay)
        if concentration is not None:
            own = rng.standard_gamma(concentration * own)
            own /= own.sum(axis=1, keepdims=True)
        elite, uid = uid, uid + 1
        for _ in range(BROOD):
            here, before = root, elite
            for generation in range(LENGTH):
                there = rng.choice(STATES, p=(own if generation else T)[here])
                rows.append((uid, before, here, there, generation > 0))
                here, before, uid = there, uid, uid + 1
    names = ["uid", "parent_uid", "parent_niche", "child_niche", "lineage"]
    return pd.DataFrame(rows, columns=names).assign(run=0)


def counted(*args, **options):
    return nc.TransitionCounts.from_births(born(*args, **options), GRID)


def test_births_of_lineages_are_kept_apart():
    counts = counted(3)
    assert counts.births.sum() == 20_000 + 3 * BROOD
    assert counts.lineages.shape == (3 * BROOD * LENGTH, 6)
    assert counts.visits.sum() == 20_000 + 3 * BROOD * LENGTH
    both = counts + counts
    assert np.unique(both.lineages[:, 0]).size == 6
    assert np.unique(both.lineages[:, 1]).size == 6 * BROOD


def test_there_is_no_law_without_lineages():
    chain = estimate(counted(0))
    assert chain.posterior.law is None
    assert "calibrated" not in chain.estimator


@pytest.mark.parametrize("stay", [-0.7, 0.0, 1.5])
def test_odds_of_staying_are_found(stay):
    law = estimate(counted(120, stay=stay)).posterior.law
    assert law.stay == pytest.approx(stay, abs=3 * law.stay_error + 0.05)
    assert law.stay_error < 0.15
    # Those of the earlier half are left out.
    assert (law.broods, law.births) == (60, 60 * BROOD * LENGTH)


@pytest.mark.parametrize(
    ("concentration", "low", "high"), [(3.0, 1.8, 5.0), (20.0, 10.0, 45.0), (None, 60.0, 9e3)]
)
def test_rows_of_one_elite_are_found(concentration, low, high):
    law = estimate(counted(120, concentration=concentration)).posterior.law
    assert low < law.concentration < high
    assert law.spread < 1.35


def test_a_calibrated_chain_has_the_level_of_real_broods():
    """Of elites that it has not seen."""
    options = {"stay": 1.0, "concentration": 3.0}
    chain = estimate(counted(60, **options))
    others = counted(300, **options, births=10, seed=9).lineages
    reached = [np.unique(brood[brood[:, 4] < 25, 4]).size for brood in np.split(others, 300)]
    predicted = chain.niche_evolvability(l=LENGTH, lineages=BROOD)
    roots = others[:: BROOD * LENGTH, 3]
    expected = predicted[roots[roots < 25]].mean()
    assert expected == pytest.approx(np.mean(np.array(reached)[roots < 25]), rel=0.06)
    plain = nc.NicheChain(posterior=replace(chain.posterior, law=None), outside=25, niches=GRID)
    assert plain.niche_evolvability(l=LENGTH, lineages=BROOD)[roots[roots < 25]].mean() > 1.05 * expected


def test_urns_have_the_numbers_of_whole_draws(monkeypatch):
    chain = estimate(counted(20, stay=1.0, concentration=4.0))
    exact = nc.niche_evolvability(chain, l=3, lineages=20, draws=400)
    monkeypatch.setattr("nichechain.evolvability.question.MOST_EXACT", 1)
    urns = nc.niche_evolvability(chain, l=3, lineages=20, draws=400)
    assert (exact.method, urns.method) == ("exact", answers.URNS)
    slack = 5 * np.hypot(exact.standard_error, urns.standard_error)
    # Draws around draws are matched in two moments, so the level is the same to a few per cent.
    assert (np.abs(exact.value - urns.value) < slack + 0.03 * exact.value).all()
    assert np.mean(urns.value / exact.value) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("convention", ["definition", "procedure"])
def test_one_niche_has_the_number_of_all(convention):
    chain = estimate(counted(20, stay=1.0, concentration=4.0))
    options = {"l": 3, "lineages": 20, "convention": convention, "draws": 5}
    every = nc.niche_evolvability(chain, **options)
    for niche in (0, 13):
        one = nc.l_evolvability(chain, niche=niche, **options)
        assert [one.value, one.low, one.high] == pytest.approx(
            [every.value[niche], every.low[niche], every.high[niche]]
        )


def test_draws_around_draws_have_their_variance():
    """Rows worth 9 births, drawn around with τ = 4: 1/10 + 9/10 · 1/5 = 0.28 of m (1 − m)."""
    rows = UrnRows(sparse.csr_array(np.array([[2.0, 0.0], [0.0, 2.0]])), np.array([7.0, 7.0]))
    assert 1.0 / (rows.scattered(4.0).total + 1.0) == pytest.approx([0.28, 0.28])


def test_odds_of_staying_change_and_what_a_row_is_worth_does_not():
    rows = UrnRows(sparse.csr_array(np.array([[2.0, 1.0], [0.0, 2.0]])), np.array([6.0, 6.0]))
    own = np.array([0.5, 0.25])
    tilted_rows = rows.with_stay(own, np.log(3.0))
    assert tilted_rows.total == pytest.approx(rows.total)
    # The rows stayed with 5/9 and 3.5/8: odds of 5/4 and 7/9.
    stay = (tilted_rows.weights.diagonal() + tilted_rows.strength * own) / tilted_rows.total
    assert stay / (1.0 - stay) == pytest.approx([15 / 4, 21 / 9])


def _law(stay, concentration):
    return LineageLaw(stay, 0.0, np.array([np.log(concentration)]), np.array([1.0]), 1.0, 1, 1)


@pytest.mark.parametrize("form", [np.array, sparse.csr_array])
def test_later_rows_have_mean_and_variance(form):
    T = truth(3)
    law, rng = _law(1.0, 6.0), np.random.default_rng(0)
    drawn = [law.onward(form(T), rng) for _ in range(3000)]
    rows = np.array([matrix if isinstance(matrix, np.ndarray) else matrix.toarray() for matrix in drawn])
    assert rows.sum(axis=2) == pytest.approx(1.0)
    expected = tilted(T, 1.0)
    np.testing.assert_allclose(rows.mean(axis=0), expected, atol=0.03)
    np.testing.assert_allclose(rows.var(axis=0), expected * (1 - expected) / 7.0, atol=0.01)


def test_rows_in_parts_keep_their_sums():
    kept = sparse.csr_array(np.diag([0.5, 0.0, 0.25]))
    parts = PooledTransition.shared(kept, np.array([0.5, 1.0, 0.75]), np.full(3, 1 / 3))
    onward = _law(np.log(2.0), 5.0).onward(parts, np.random.default_rng(0))
    np.testing.assert_allclose(onward.toarray().sum(axis=1), 1.0)
    # Odds are doubled of what births say one by one: 1/2 becomes 2/3.
    np.testing.assert_allclose(onward.kept.diagonal(), [2 / 3, 0.0, 0.4])


def test_at_least_ten_broods_are_asked():
    assert [estimate(counted(broods)).posterior.law.broods for broods in (4, 12, 40)] == [4, 10, 20]


def test_a_law_is_the_same_whenever_it_is_fitted():
    posterior = estimate(counted(5)).posterior
    again = fitted_law(replace(posterior, law=None))
    assert again.stay == posterior.law.stay
    np.testing.assert_array_equal(again.weights, posterior.law.weights)


def test_a_law_taken_as_known_is_drawn_as_its_middle():
    law = estimate(counted(30, stay=0.5, concentration=20.0)).posterior.law
    for seed in range(5):
        stay, concentration = law.taken_as_known().drawn(np.random.default_rng(seed))
        assert stay == law.stay
        assert concentration == pytest.approx(law.concentration, rel=1e-12)
    assert len({law.drawn(np.random.default_rng(seed)) for seed in range(5)}) == 5
