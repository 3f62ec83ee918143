"""Step sizes as genes: their law, and that nothing else than them and the weights moves."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from nichechain import BuildConfig, NichechainError, Threads, build, load
from nichechain.domains import Domain, PlanarArm
from nichechain.variation import Bound, SelfAdaptiveDomain, SelfAdaptiveMutation
from nichechain.variation.noise import CauchyNoise, GaussianNoise


def parent_of(layers, steps, dtype=np.float64):
    return np.concatenate([np.zeros(sum(layers)), np.log(steps)]).astype(dtype)


def test_step_sizes_follow_the_log_normal_rule():
    layers, steps = (4, 25), (2.0, 0.01)
    mutate = SelfAdaptiveMutation(GaussianNoise(), layers)
    parent, rng = parent_of(layers, steps), np.random.default_rng(0)
    children = np.array([mutate(parent, rng) for _ in range(4000)])
    for k, (n, step) in enumerate(zip(layers, steps, strict=True)):
        change = (children[:, 29 + k] - np.log(step)) * np.sqrt(n)
        assert stats.kstest(change, stats.norm.cdf).pvalue > 1e-3
    assert abs(np.corrcoef(children[:, 29], children[:, 30])[0, 1]) < 4 / np.sqrt(4000)


def test_weights_move_by_the_new_step_sizes():
    layers, steps = (4, 25), (2.0, 0.01)
    mutate = SelfAdaptiveMutation(GaussianNoise(), layers)
    parent, rng = parent_of(layers, steps), np.random.default_rng(1)
    children = np.array([mutate(parent, rng) for _ in range(3000)])
    scale = np.repeat(np.exp(children[:, 29:]), layers, axis=1)
    assert stats.kstest((children[:, :29] / scale).ravel(), stats.norm.cdf).pvalue > 1e-3
    # With the parent's step sizes the steps of the small layer would be a mixture, not normal.
    assert stats.kstest((children[:, :4] / 2.0).ravel(), stats.norm.cdf).pvalue < 1e-6


@given(seed=st.integers(0, 2**32), size=st.floats(1e-3, 10), kind=st.sampled_from(["cube", "ball"]))
@settings(max_examples=60, deadline=None)
def test_bounds_hold_for_the_weights(seed, size, kind):
    bound = Bound("per-coordinate" if kind == "cube" else "rescaled", size)
    mutate = SelfAdaptiveMutation(CauchyNoise(), (10, 20), bound)
    parent = parent_of((10, 20), (3.0, 0.2), np.float32)
    child = mutate(parent, np.random.default_rng(seed))
    step = child[:30].astype(np.float64)
    assert np.abs(step).max() <= size if kind == "cube" else np.linalg.norm(step) < size
    assert child.dtype == np.float32
    np.testing.assert_array_equal(child, mutate(parent, np.random.default_rng(seed)))


def test_the_domain_evaluates_the_weights_alone():
    arm = PlanarArm(6)
    domain = SelfAdaptiveDomain(arm, (0.3, 2.0))
    assert isinstance(domain, Domain)
    genotypes = domain.sample(5, seed=3)
    assert genotypes.shape == (5, domain.genotype_length) == (5, 8)
    assert genotypes.dtype == np.float32
    np.testing.assert_array_equal(genotypes[:, :6], arm.sample(5, seed=3))
    np.testing.assert_allclose(domain.step_sizes_of(genotypes), np.tile([0.3, 2.0], (5, 1)), rtol=1e-6)
    changed = genotypes.copy()
    changed[:, 6:] = 17.0
    for given_genotypes in (genotypes, changed):
        np.testing.assert_array_equal(
            domain.evaluate(given_genotypes).behavior, arm.evaluate(genotypes[:, :6]).behavior
        )
    assert (domain.name, domain.bounds, domain.chunk) == (arm.name, arm.bounds, arm.chunk)


def test_the_domain_travels_to_other_processes():
    domain = pickle.loads(pickle.dumps(SelfAdaptiveDomain(PlanarArm(6), (0.3,))))
    genotypes = domain.sample(2, seed=0)
    expected = PlanarArm(6).evaluate(genotypes[:, :6]).behavior
    np.testing.assert_array_equal(domain.evaluate(genotypes).behavior, expected)


def test_the_domain_strips_step_sizes_for_a_controller():
    class Taker(PlanarArm):
        def controller(self, genotype):
            return np.asarray(genotype)

    domain = SelfAdaptiveDomain(Taker(4), (1.0,))
    np.testing.assert_array_equal(domain.controller(np.arange(5.0)), np.arange(4.0))


def test_an_archive_is_built_resumed_and_loaded(tmp_path):
    config = BuildConfig(
        "arm", (10, 10), PlanarArm.bounds, evaluations=700, initial=50, scale=0.05, self_adaptive=True
    )
    with Threads(1) as executor:
        build(config, tmp_path / "once", executor)
        for evaluations in (333, 700):
            halfway = BuildConfig.from_json({**config.to_json(), "evaluations": evaluations})
            build(halfway, tmp_path / "twice", executor)
    once, twice = load(tmp_path / "once"), load(tmp_path / "twice")
    np.testing.assert_array_equal(once.elites.genotype, twice.elites.genotype)
    assert once.births().equals(twice.births())
    elite = once.elite(int(once.elites.niche[5]))
    assert elite.genotype.shape == (11,)
    found = once.domain.evaluate(elite.genotype[None]).behavior[0]
    np.testing.assert_array_equal(found, elite.behavior)
    deep = once.elites.depth >= 3
    steps = np.exp(once.elites.genotype[:, 10])
    assert deep.any()
    assert steps[deep].std() > 0.005
    # A child of an elite comes from its own step size, not from the one that the build began with.
    child = once.mutate(elite.genotype, np.random.default_rng(0))
    assert child.shape == (11,)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: SelfAdaptiveMutation(GaussianNoise(), ()), r"layers are \(\), but each has at least"),
        (lambda: SelfAdaptiveMutation(GaussianNoise(), (3, 0)), r"layers are \(3, 0\)"),
        (lambda: SelfAdaptiveDomain(PlanarArm(3), (1.0, -2.0)), "step_size is -2"),
        (
            lambda: SelfAdaptiveMutation(GaussianNoise(), (3, 4))(np.zeros(7), np.random.default_rng(0)),
            "genotype has length 7, but 7 weights and 2 step sizes make 9",
        ),
    ],
)
def test_what_does_not_fit_is_named(make, message):
    with pytest.raises(NichechainError, match=message):
        make()
