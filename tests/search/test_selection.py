"""Selections of parents: mixtures, temperature, and what may be asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nichechain import BuildConfig, NichechainError
from nichechain.niches import GridNiches
from nichechain.search.config import parse_selection
from nichechain.search.selection import Mixture, Tempered, Told, UniformParents, draw_parents, retrace
from nichechain.steering import make_selection

CONFIG = BuildConfig("arm", (4, 4), ((-1.0, 1.0), (-1.0, 1.0)))
NICHE = np.arange(3)


class Given:
    """Weights as given, and what was told, in order."""

    def __init__(self, *weights: float) -> None:
        self.given = np.array(weights) if weights else None
        self.heard: list[object] = []

    def tell(self, births):
        self.heard.append(births.child_niche.tolist())

    def begin(self, step):
        self.heard.append(f"step {step}")

    def weights(self, niche, uid):  # noqa: ARG002
        return self.given


def test_a_temperature_is_a_power_of_the_weights():
    found = Tempered(Given(1.0, 2.0, 4.0), 0.5).weights(NICHE, NICHE)
    np.testing.assert_allclose(found / found.sum(), np.array([1.0, 4.0, 16.0]) / 21.0)
    np.testing.assert_array_equal(Tempered(Given(1.0, 2.0, 4.0), 1.0).weights(NICHE, NICHE), [1.0, 2.0, 4.0])
    assert Tempered(UniformParents(), 0.1).weights(NICHE, NICHE) is None
    # The least positive float to the tenth power is 0, but not its ratio to the largest.
    assert Tempered(Given(5e-324, 5e-324, 0.0), 0.1).weights(NICHE, NICHE).tolist() == [1.0, 1.0, 0.0]


def test_a_mixture_adds_probabilities():
    mixed = Mixture([Given(1.0, 1.0, 2.0), Given()], [0.6, 0.4]).weights(NICHE, NICHE)
    np.testing.assert_allclose(mixed, [0.15 + 0.4 / 3, 0.15 + 0.4 / 3, 0.3 + 0.4 / 3])
    assert Mixture([Given(), UniformParents()], [0.6, 0.4]).weights(NICHE, NICHE) is None


def test_nobody_of_no_weight_is_drawn():
    assert set(draw_parents(np.array([0.0, 1.0, 1.0]), 3, 500, np.random.default_rng(0)).tolist()) == {1, 2}
    assert set(draw_parents(None, 3, 500, np.random.default_rng(0)).tolist()) == {0, 1, 2}


def test_births_are_told_step_by_step_as_they_came():
    none = np.zeros(5, np.int64)
    births = Told(none, none, np.array([3, 1, 4, 1, 5]), none > 0, np.array([0, 0, 1, 1, 3]), none, none > 0)
    parents = Given()
    retrace(Mixture([parents, Given()], [0.5, 0.5]), births)
    assert parents.heard == [[3, 1], "step 1", [4, 1], "step 3", [5]]
    retrace(parents, births[:0])
    assert len(parents.heard) == 5


def test_a_selection_is_a_name_or_shares_of_several():
    assert parse_selection("curiosity") == (("curiosity", 1.0),)
    assert parse_selection("reach:0.7, uniform:0.3") == (("reach", 0.7), ("uniform", 0.3))
    assert parse_selection("reach:1") == (("reach", 1.0),)
    niches = GridNiches((4, 4), CONFIG.bounds)
    assert isinstance(make_selection(CONFIG, niches), UniformParents)
    mixture = make_selection(replace(CONFIG, selection="curiosity:0.25,reach:0.75", temperature=0.5), niches)
    assert isinstance(mixture, Mixture)
    assert mixture.shares == [0.25, 0.75]
    assert [part.temperature for part in mixture.selections] == [0.5, 0.5]


@pytest.mark.parametrize(
    ("selection", "message"),
    [
        ("rank", "selection is 'rank', but must be one of uniform, curiosity, reach"),
        ("", "selection is '', but must be one of uniform"),
        ("reach,uniform", "share of reach must be a number, as in 'reach:0.7,uniform:0.3'"),
        ("reach:half,uniform:0.5", "share of reach must be a number"),
        ("reach:0.7,uniform:0.4", "shares must be above 0 and sum to 1"),
        ("reach:1.5,uniform:-0.5", "shares must be above 0 and sum to 1"),
        ("reach:nan,uniform:0.5", "shares must be above 0 and sum to 1"),
        ("reach:0.5,reach:0.5", "must name each of its parts once"),
        (7, "selection is 7, but must be a name"),
    ],
)
def test_odd_selections_are_refused_with_the_reason(selection, message):
    with pytest.raises(NichechainError, match=message):
        replace(CONFIG, selection=selection)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"temperature": 0.0}, "temperature is 0.0, but must be"),
        ({"temperature": float("inf")}, "temperature is inf"),
        ({"temperature": "hot"}, "temperature is 'hot'"),
        ({"selection_l": 0}, "selection_l is 0, but must be at least 1"),
        ({"selection_l": 2.5}, "selection_l is 2.5, but must be a whole number"),
        ({"selection_lineages": 0}, "selection_lineages is 0, but must be at least 1"),
    ],
)
def test_odd_settings_of_a_selection_are_refused(values, message):
    with pytest.raises(NichechainError, match=message):
        replace(CONFIG, **values)
