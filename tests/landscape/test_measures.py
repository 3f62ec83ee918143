"""All local measures at once, and their names."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from nichechain import NichechainError
from nichechain.landscape import MEASURES, find_measure, find_measures, measure_behaviors, measures
from nichechain.niches import GridNiches

NICHES = GridNiches((4, 4), ((-1.0, 1.0), (-1.0, 1.0)))


@st.composite
def samples(draw):
    """Parents and their offspring, some of which failed."""
    size = draw(st.integers(1, 3)), draw(st.integers(2, 7))
    numbers = st.floats(-1.5, 1.5)
    parent = draw(hnp.arrays(float, (size[0], 2), elements=numbers))
    offspring = draw(hnp.arrays(float, (*size, 2), elements=numbers))
    offspring[draw(hnp.arrays(bool, size))] = np.nan
    return parent, offspring


@given(samples())
def test_every_measure_is_what_the_definitions_say(sample):
    parents, families = sample
    found = measure_behaviors(parents, families, NICHES)
    for g, (parent, family) in enumerate(zip(parents, families, strict=True)):
        alive = [tuple(child) for child in family if not np.isnan(child).any()]
        away = [math.dist(parent, child) for child in alive]
        ordered = [math.dist(a, b) for a, b in itertools.permutations(alive, 2)]
        assert found.failed[g] == len(family) - len(alive)
        expected = {
            "local_sensitivity": max(away, default=math.nan),
            "expected_local_sensitivity": np.mean(away) if away else math.nan,
            "evolvability": max(ordered, default=0.0) if away else math.nan,
            "expected_evolvability": np.mean(ordered) if ordered else math.nan,
        }
        for name, value in expected.items():
            assert found[name][g] == pytest.approx(value, rel=1e-12, abs=1e-300, nan_ok=True)
        cells = {(math.floor(2 * x + 2), math.floor(2 * y + 2)) for x, y in alive}
        # pyribs' cells, which ours are, begin a hair early; the very edges are tested with the niches.
        if all(abs(2 * v - round(2 * v)) > 1e-4 for child in alive for v in child):
            inside = {cell for cell in cells if max(cell) < 4 and min(cell) >= 0}
            assert found.one_hot_evolvability[g] == len(inside) / 16
        rounding = 1 + 1e-14
        if away:
            assert found.evolvability[g] <= 2 * found.local_sensitivity[g] * rounding
            assert 0 <= found.ratio[g] <= 2 * rounding
        if ordered:
            assert 0 <= found.expected_ratio[g] <= 2 * rounding


def test_without_niches_nothing_is_counted():
    found = measure_behaviors(np.zeros((1, 2)), np.zeros((1, 3, 2)))
    assert np.isnan(found.one_hot_evolvability).all()
    assert len(found) == 1


def test_large_sets_are_measured_in_blocks_to_the_same_bits(monkeypatch):
    rng = np.random.default_rng(0)
    parent, offspring = rng.normal(size=(7, 2)), rng.normal(size=(7, 5, 2))
    whole = measure_behaviors(parent, offspring)
    monkeypatch.setattr(measures, "_PAIRS", 25)
    for name in MEASURES:
        np.testing.assert_array_equal(measure_behaviors(parent, offspring)[name], whole[name])


def test_a_name_may_have_hyphens_and_counts_once():
    assert find_measure(" expected-ratio ").symbol == "r*"
    assert [m.symbol for m in find_measures(["ratio", "hull-volume", "ratio"])] == ["r", "hull"]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: find_measure("fitness"), "no measure 'fitness': it must be one of local-sensitivity, "),
        (lambda: find_measures([]), "no measure is named"),
        (lambda: measure_behaviors(np.zeros((1, 2)), np.zeros((1, 1, 2))), "sample_size is 1"),
        (
            lambda: measure_behaviors(np.zeros((2, 2)), np.zeros((1, 3, 2))),
            r"shapes \(2, 2\) and \(1, 3, 2\)",
        ),
        (lambda: measure_behaviors(np.zeros((1, 3)), np.zeros((1, 3, 2))), r"must be \(G, B\) and"),
        (lambda: measure_behaviors([[np.nan]], np.zeros((1, 3, 1))), "or parents NaN"),
        (lambda: measure_behaviors([[0.0]], [[[np.inf], [0.0]]]), "behaviors have infinite values"),
    ],
)
def test_bad_input_is_one_sentence(call, message):
    with pytest.raises(NichechainError, match=message):
        call()
