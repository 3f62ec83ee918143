"""Questions to a chain: which cannot be asked, what a long one says before, which rows it draws."""

from __future__ import annotations

import numpy as np
import pytest

from nichechain import NicheChain, NichechainError, l_evolvability, niche_evolvability
from nichechain.core import duration
from nichechain.evolvability import (
    Question,
    bootstrap_elites,
    elite_evolvability,
    evolvability_derivative,
    genotype_evolvability,
    prior_sensitivity,
    question,
    visit_metrics,
    where_to_sample,
)
from nichechain.evolvability.by_generation import evolvability_table
from nichechain.evolvability.reach import reach

from .samples import T


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"l": 0}, "l is 0, but must be at least 1"),
        ({"l": -2}, "l is -2"),
        ({"l": 1.5}, "l is 1.5"),
        ({"lineages": 0}, "lineages is 0, but must be at least 1"),
        ({"lineages": -1}, "lineages is -1"),
        ({"lineages": 2.5}, "lineages is 2.5"),
        ({"method": "exactly"}, "method is 'exactly', but must be one of auto, exact, monte-carlo"),
        ({"convention": "literal"}, "convention is 'literal', but must be one of definition, procedure"),
        ({"repeats": 0}, "repeats is 0"),
        ({"draws": 0}, "draws is 0"),
    ],
)
def test_bad_arguments(arguments, message):
    chain = NicheChain(T)
    with pytest.raises(NichechainError, match=message):
        l_evolvability(chain, niche=0, **arguments)
    with pytest.raises(NichechainError, match=message):
        niche_evolvability(chain, **arguments)


@pytest.mark.parametrize(
    ("root", "message"),
    [
        ({}, "either a niche or the distribution"),
        ({"niche": 0, "offspring": [1, 0, 0]}, "either a niche or the distribution"),
        ({"niche": 3}, "niche is 3, but this chain has niches 0 to 2"),
        ({"niche": -1}, "niche is -1"),
        ({"niche": (0, 1)}, "no grid"),
        ({"offspring": [0.5, 0.5]}, r"shape \(2,\), but must be \(3,\)"),
        ({"offspring": [[0.5, 0.5, 0]]}, r"shape \(1, 3\)"),
        ({"offspring": [0.5, 0.4, 0]}, "sums to 0.9"),
        ({"offspring": [1.5, -0.5, 0]}, "not negative"),
        ({"offspring": [np.nan, 0.5, 0.5]}, "offspring"),
        ({"offspring": [3, 4, 5]}, "sums to 12"),
    ],
)
def test_bad_roots(root, message):
    with pytest.raises(NichechainError, match=message):
        l_evolvability(NicheChain(T), **root)


FEW = {"l": 2, "lineages": 2, "draws": 2}


@pytest.mark.parametrize(
    "ask",
    [
        lambda a: l_evolvability(a.chain(), niche=0, **FEW),
        lambda a: niche_evolvability(a.chain(), method="monte-carlo", repeats=2, **FEW),
        lambda a: reach(a.chain(), niche=0, **FEW),
        lambda a: visit_metrics(a.chain(), niche=0, repeats=2, **FEW),
        lambda a: elite_evolvability(a, **FEW),
        lambda a: genotype_evolvability(a, a.elite(int(a.elites.niche[0])), **FEW),
        lambda a: where_to_sample(a.chain(), niche=0, **FEW),
        lambda a: evolvability_derivative(a.chain(), niche=0, l=2),
        lambda a: evolvability_table(a.chain(), 2, [2], draws=2),
        lambda a: prior_sensitivity(a.counts, **FEW),
        lambda a: bootstrap_elites(a.counts, resamples=2, **FEW),
    ],
    ids=lambda ask: ask.__code__.co_names[0],
)
def test_what_could_take_over_ten_minutes_is_said_before(ask, arm_archive, monkeypatch):
    monkeypatch.setattr(duration, "_LONG", 1e-12)
    with pytest.warns(UserWarning, match="could take") as told:
        ask(arm_archive)
    # Once, also where many questions make one answer.
    (said,) = (str(warning.message) for warning in told)
    assert said == "this could take 0 minutes: fewer roots, lineages, generations or draws take less"


def test_minutes_of_many_questions_are_those_of_all(arm_archive, monkeypatch):
    """Two resamples of 3 draws, and the value of 50: a question of 56 draws."""
    told = []
    monkeypatch.setattr(question, "warn_if_long", lambda seconds, *_, **__: told.append(seconds))
    bootstrap_elites(arm_archive.counts, resamples=2, l=2, lineages=2, draws=3)
    niche_evolvability(arm_archive.chain(), l=2, lineages=2, draws=56)
    assert told[0] == told[1] > 0


def test_rows_of_elites_do_not_depend_on_who_else_is_asked_for():
    rows = np.random.default_rng(0).dirichlet(np.full(40, 0.5), 40)
    drawn = question.DrawnChain(rows, rows, 9.0, seed=3, number=2)
    some = np.array([39, 3, 17, 16])
    whole = drawn.children(np.arange(40))
    np.testing.assert_array_equal(drawn.children(some), whole[some])
    np.testing.assert_allclose(whole.sum(axis=1), 1.0)
    other = question.DrawnChain(rows, rows, 9.0, seed=3, number=1).children(some)
    assert np.abs(other - whole[some]).max() > 0.1


def test_short_numbers_do_not_overflow():
    asked = Question(np.int8(3), lineages=np.int8(100), repeats=np.int8(5), seed=np.uint8(1))
    assert asked == Question(3, lineages=100, repeats=5, seed=1)
    chain = NicheChain(T)
    short, plain = (
        l_evolvability(chain, niche=0, lineages=lineages, method="monte-carlo", repeats=3)
        for lineages in (np.int8(100), 100)
    )
    assert short.value == plain.value
