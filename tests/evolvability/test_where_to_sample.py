"""Where to sample: the adjoint against finite differences, the rest against closed forms."""

from __future__ import annotations

import importlib

import numpy as np
import pytest
from scipy import sparse

from nichechain import GridNiches, NicheChain, NichechainError, TransitionCounts, estimate, l_evolvability
from nichechain.evolvability.coverage import expected_coverage
from nichechain.evolvability.where_to_sample import evolvability_derivative, where_to_sample

# The package gives the function's name to the function.
sampling = importlib.import_module("nichechain.evolvability.where_to_sample")

CONVENTIONS = ["definition", "procedure"]


def _value(transition, niche, l, lineages, convention, counted):
    literal = convention == "procedure"
    first = np.eye(len(transition)) if literal else transition
    covered = expected_coverage(transition, first, l + literal, lineages, counted=counted)[:counted]
    return covered.mean() if niche is None else covered[niche]


@pytest.mark.parametrize("form", [np.array, sparse.csr_array])
@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("niche", [None, 2])
@pytest.mark.parametrize(("l", "lineages"), [(1, 1), (1, 5), (2, 3), (4, 7)])
def test_derivative_equals_finite_differences(form, convention, niche, l, lineages, monkeypatch):
    # Blocks smaller than the chain, so that all of them count.
    monkeypatch.setattr(sampling, "_COLUMNS", 2)
    rng = np.random.default_rng(l)
    transition = rng.dirichlet(np.full(6, 0.5), 6)
    chain = NicheChain(form(transition), outside=5)
    found = evolvability_derivative(chain, niche=niche, l=l, lineages=lineages, convention=convention)
    step = 1e-5
    for i in range(6):
        for j in range(6):
            either = []
            for sign in (1, -1):
                moved = transition.copy()
                moved[i, j] += sign * step
                either.append(_value(moved, niche, l, lineages, convention, 5))
            assert found[i, j] == pytest.approx((either[0] - either[1]) / (2 * step), rel=1e-5, abs=1e-7)


def test_derivative_of_children_by_hand():
    # l = 1, U = 1 from niche 0: one niche for sure unless outside; slope 1 to niches, 0 to outside.
    chain = NicheChain(np.full((3, 3), 1 / 3), outside=2)
    found = evolvability_derivative(chain, niche=0, l=1, lineages=1)
    np.testing.assert_allclose(found, [[1, 1, 0], [0, 0, 0], [0, 0, 0]])


NICHES = GridNiches((2, 2), ((0.0, 1.0), (0.0, 1.0)))


def _chain():
    rng = np.random.default_rng(3)
    parent = rng.choice(5, 200, p=[0.5, 0.3, 0.1, 0.0, 0.1])
    return estimate(TransitionCounts.from_pairs(parent, rng.integers(5, size=200), NICHES))


def test_one_row_matters_to_children_of_one_niche():
    chain = _chain()
    frame = where_to_sample(chain, niche=1, l=1, lineages=4, births=3, seed=2)
    assert frame["state"].tolist()[0] == 1
    assert frame["share"].tolist() == [1.0, 0.0, 0.0, 0.0, 0.0]
    # Only that row is uncertain, so the variance is that of l-evolvability over the same draws.
    scored = l_evolvability(chain, niche=1, l=1, lineages=4, seed=2)
    variance = scored.standard_error**2 * 50
    assert frame["variance"][0] == pytest.approx(variance)
    total = chain.births[1] / chain.posterior.design_effect[1] + chain.posterior.strength
    more = 3 / chain.posterior.design_effect[1]
    assert frame["narrowing"][0] == pytest.approx(variance * more / (more + total))


def test_narrowing_of_a_linear_question_is_the_expected_one():
    # P(child is inside), the l-evolvability of l = U = 1, is a Beta variate: α/(α + β) of births.
    chain = estimate(
        TransitionCounts.from_pairs([0] * 12, [0, 1, 2, 3, 4, 4] * 2, NICHES), "dirichlet", strength=5.0
    )
    frame = where_to_sample(chain, niche=0, l=1, lineages=1, births=1, draws=3000).set_index("state")
    a, b = 8.0 + 4.0, 4.0 + 1.0
    now = a * b / ((a + b) ** 2 * (a + b + 1))
    assert frame["sensitivity"][0] == pytest.approx(np.sqrt(a * b) / (a + b))
    assert frame["variance"][0] == pytest.approx(now, rel=0.1)

    def beta(a, b):
        return a * b / ((a + b) ** 2 * (a + b + 1))

    later = a / (a + b) * beta(a + 1, b) + b / (a + b) * beta(a, b + 1)
    assert frame["narrowing"][0] / frame["variance"][0] == pytest.approx((now - later) / now)


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("niche", [None, (0, 1)])
def test_a_row_for_each_state(niche, convention):
    chain = _chain()
    frame = where_to_sample(chain, niche=niche, l=3, lineages=6, convention=convention, draws=20)
    assert sorted(frame["state"]) == [0, 1, 2, 3, 4]
    assert dict(zip(frame["state"], frame["index"], strict=True))[4] == "outside"
    assert frame["share"].sum() == pytest.approx(1.0)
    assert frame["narrowing"].is_monotonic_decreasing
    assert (frame["narrowing"] < frame["variance"]).all()
    np.testing.assert_array_equal(frame.sort_values("state")["births"], chain.births)
    np.testing.assert_array_equal(frame.sort_values("state")["visits"], chain.counts.visits)


def test_more_births_are_worth_more_but_ever_less():
    narrowing = [
        where_to_sample(_chain(), niche=0, l=2, lineages=3, draws=5, births=births)["narrowing"].sum()
        for births in (1, 2, 4)
    ]
    assert narrowing[0] < narrowing[1] < 2 * narrowing[0]
    assert narrowing[1] < narrowing[2] < 2 * narrowing[1]


def test_an_absorbing_outside_tells_nothing():
    niches = GridNiches((2, 2), ((0.0, 1.0), (0.0, 1.0)), "absorb")
    counts = TransitionCounts.from_pairs([0, 0, 1, 2, 2], [1, 4, 2, 0, 4], niches)
    frame = where_to_sample(estimate(counts), l=3, draws=5).set_index("state")
    assert frame["share"][4] == pytest.approx(0.0, abs=1e-12)
    assert (frame["share"].drop(4) > 0).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"births": 0}, "births is 0"),
        ({"draws": 1}, "draws is 1"),
        ({"l": 0}, "l is 0"),
        ({"lineages": 0}, "lineages is 0"),
        ({"convention": "x"}, "convention is 'x'"),
        ({"niche": 5}, "niche is 5"),
    ],
)
def test_bad_input(options, message):
    with pytest.raises(NichechainError, match=message):
        where_to_sample(_chain(), **options)


def test_a_given_chain_cannot_be_narrowed():
    counts = TransitionCounts.from_pairs([0], [1], NICHES)
    for chain in (NicheChain(np.eye(2)), estimate(counts, "mle")):
        with pytest.raises(NichechainError, match="narrow nothing"):
            where_to_sample(chain)


def test_more_generations_than_there_is_room_for_are_refused():
    with pytest.raises(NichechainError, match="room for"):
        evolvability_derivative(NicheChain(np.full((3, 3), 1 / 3)), l=10**9)
