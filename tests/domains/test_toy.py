"""The maps of Doncieux et al. (2020) with the figures of their study."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nichechain.core.errors import NichechainError
from nichechain.domains import CosinusMap, Domain, LinearMap, Noise, Perturbable, make
from nichechain.evolvability.visits import uniformity
from nichechain.variation.polynomial import PolynomialMutation

MAPS = [CosinusMap, LinearMap]
mutate = PolynomialMutation(-5.0, 5.0, eta=45.0)


def histogram(genome, children, rng):
    """Children of a genome in 50 bins on [-5, 5]."""
    offspring = mutate(np.tile(np.float32(genome), (children, 1)), rng)
    return np.histogram(CosinusMap().evaluate(offspring).behavior[:, 0], np.linspace(-5, 5, 51))[0]


# Mean and standard deviation over 40 repeats.
@pytest.mark.parametrize(
    ("genome", "coverage", "coverage_sd", "even", "even_sd"),
    [
        ((0.0, 0.0), 0.640, 0.031, 0.496, 0.017),
        ((0.0, 4.5), 1.000, 0.0, 0.787, 0.015),
        ((0.0, -4.5), 0.420, 0.027, 0.461, 0.021),
    ],
)
def test_evolvability_of_the_study(genome, coverage, coverage_sd, even, even_sd):
    rng = np.random.default_rng(7)
    counts = np.stack([histogram(genome, 1000, rng) for _ in range(40)])
    covered, evenness = (counts > 0).mean(axis=1), uniformity(counts, occupied=True)
    # Theirs and ours are both means of 40: four standard errors of their difference.
    error = 4 * math.sqrt(2 / 40)
    assert covered.mean() == pytest.approx(coverage, abs=error * coverage_sd)
    assert evenness.mean() == pytest.approx(even, abs=error * even_sd)
    # A standard deviation of 40 values is known to a ninth or so.
    assert covered.std() == pytest.approx(coverage_sd, rel=0.4, abs=1e-12)
    assert evenness.std() == pytest.approx(even_sd, rel=0.4)


def test_evolvability_of_the_first_population():
    """Coverage of 0.52 before any search, by 300 children each."""
    rng = np.random.default_rng(3)
    covered = [(histogram(genome, 300, rng) > 0).mean() for genome in CosinusMap().sample(400, seed=3)]
    assert np.mean(covered) == pytest.approx(0.52, abs=0.005)


def test_behavior_is_the_formula():
    genomes = np.random.default_rng(0).uniform(-5, 5, (50, 2)).astype(np.float32)
    cosinus, linear = (kind().evaluate(genomes) for kind in MAPS)
    for genome, behavior, objective in zip(genomes, cosinus.behavior, cosinus.objective, strict=True):
        first, second = map(float, genome)
        # A cosine a quarter turn ahead is minus a sine.
        expected = -5 * math.sin(2 * math.pi * first / (11 - 1.8 * second))
        assert behavior[0] == pytest.approx(expected, abs=1e-12)
        assert objective == pytest.approx(-abs(expected + 4), abs=1e-12)
    np.testing.assert_array_equal(linear.behavior[:, 0], genomes[:, 0])


@pytest.mark.parametrize("kind", MAPS)
def test_is_a_domain(kind):
    domain = make(kind.name, seed=3)
    assert isinstance(domain, Domain)
    assert isinstance(domain, Perturbable)
    assert repr(domain) == f"{kind.__name__}(seed=3)"
    sample = domain.sample(400, seed=1)
    assert np.abs(sample).max() <= 0.5
    np.testing.assert_array_equal(domain.sample(5, seed=1), sample[:5])
    with pytest.raises(TypeError, match="two genes, not a controller"):
        domain.controller(sample[0])


@pytest.mark.parametrize("kind", MAPS)
def test_bits_do_not_depend_on_the_batch(kind):
    domain = kind()
    genomes = np.random.default_rng(1).uniform(-5, 5, (1003, 2)).astype(np.float32)
    whole = domain.evaluate(genomes)
    for size in (1, 7):
        parts = [domain.evaluate(genomes[i : i + size]).behavior for i in range(0, 1003, size)]
        np.testing.assert_array_equal(np.concatenate(parts), whole.behavior)


@pytest.mark.parametrize("kind", MAPS)
def test_outside_of_the_square_is_the_nearest_inside(kind):
    far = kind().evaluate([[9.0, 1.0], [-7.0, 6.2], [0.0, np.nan], [np.inf, 0.0]])
    near = kind().evaluate([[5.0, 1.0], [-5.0, 5.0]])
    np.testing.assert_array_equal(far.behavior[:2], near.behavior)
    assert far.failed.tolist() == [False, False, True, True]
    assert far.reasons == ("", "", "genotype is not finite", "genotype is not finite")
    assert np.isnan(far.behavior[2:]).all()


@pytest.mark.parametrize("kind", MAPS)
def test_noise_moves_genes(kind):
    domain = kind()
    genomes = np.zeros((3000, 2), np.float32)
    moved = domain.evaluate_noisy(genomes, Noise(action=0.1), np.arange(3000)).behavior[:, 0]
    # To first order by the slope at 0, which is 1 for the line and -10π/11 for the cosine.
    slope = 1.0 if kind is LinearMap else 10 * math.pi / 11
    assert moved.std() == pytest.approx(0.1 * slope, rel=0.06)
    with pytest.raises(NichechainError, match="only noise of action"):
        domain.evaluate_noisy(genomes[:1], Noise(observation=0.1), [0])
