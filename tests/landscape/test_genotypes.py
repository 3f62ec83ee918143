"""Landscape measures of genotypes: their children are made, evaluated and measured."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nichechain import NichechainError, domains, landscape, variation
from nichechain.core.randomness import Purpose, keyed
from nichechain.execution import Threads
from nichechain.niches import GridNiches


def test_measures_of_a_genotype_are_those_of_its_children():
    domain, mutate = domains.make("arm"), variation.gaussian(0.3)
    genotype = domain.sample(1, seed=3)[0]
    niches = GridNiches((6, 6), domain.bounds)
    found = landscape.measure(domain, genotype, mutate, 12, 5, niches=niches)
    children = np.stack([mutate(genotype, keyed(5, Purpose.OFFSPRING, i)) for i in range(12)])
    parent = domain.evaluate(genotype[None]).behavior[0]
    offspring = domain.evaluate(children).behavior
    assert found.sample_size == 12
    assert found.failed == 0
    assert found.local_sensitivity == pytest.approx(max(np.linalg.norm(offspring - parent, axis=1)))
    assert found.expected_evolvability == landscape.expected_evolvability(offspring)
    assert found.one_hot_evolvability == len(set(niches.of(offspring).tolist())) / 36
    assert found.ratio == pytest.approx(found.evolvability / found.local_sensitivity)
    assert found.expected_ratio == pytest.approx(
        found.expected_evolvability / found.expected_local_sensitivity
    )
    assert found.hull_volume == landscape.hull_volume(offspring)


def test_measures_depend_neither_on_company_nor_on_workers():
    domain, mutate = domains.make("arm"), variation.cauchy()
    genotypes = domain.sample(5, seed=0)
    together = landscape.measure_genotypes(domain, genotypes, mutate, 8, 1)
    assert together[3] == landscape.measure(domain, genotypes[3], mutate, 8, 1)
    domain.chunk = 7
    with Threads(2) as threads:
        assert landscape.measure_genotypes(domain, genotypes, mutate, 8, 1, threads) == together


@settings(max_examples=10)
@given(st.integers(0, 100))
def test_children_that_fail_are_counted_and_left_out(seed):
    domain = domains.make("arm")

    def fragile(parent, rng):
        return np.full_like(parent, np.inf) if rng.random() < 0.5 else variation.gaussian()(parent, rng)

    found = landscape.measure(domain, domain.sample(1, seed=0)[0], fragile, 20, seed)
    lost = sum(keyed(seed, Purpose.OFFSPRING, i).random() < 0.5 for i in range(20))
    assert found.failed == lost
    assert found.evolvability <= 2 * found.local_sensitivity * (1 + 1e-14)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: _measure(np.zeros(9)), r"shape \(1, 9\), but must be \(N, 10\)"),
        (lambda: _measure(np.zeros(10), 1), "sample_size is 1"),
        (lambda: _measure(np.full(10, np.nan)), "genotype 0 failed to evaluate: genotype is not finite"),
    ],
)
def test_bad_input_is_one_sentence(call, message):
    with pytest.raises(NichechainError, match=message):
        call()


def _measure(genotype, sample_size=5):
    return landscape.measure(domains.make("arm"), genotype, variation.cauchy(), sample_size)
