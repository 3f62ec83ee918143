"""Noise that leaves a domain pure, and how sensitive a genotype is to it."""

from __future__ import annotations

import hashlib
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nichechain as nc
from nichechain.core.errors import NichechainError
from nichechain.domains import (
    Domain,
    Evaluation,
    FetchReach,
    Noise,
    Noisy,
    PlanarArm,
    WithSensitivity,
    make,
    noise_sensitivity,
)
from nichechain.domains.noise import average, evaluation_seeds
from nichechain.execution import Threads


def arm(noise=0.1, repeats=6, **options):
    return Noisy(PlanarArm(**options), Noise(action=noise), repeats=repeats)


def postures(n=30, joints=10, seed=0):
    return np.random.default_rng(seed).normal(0, 0.5, (n, joints)).astype(np.float32)


def test_is_a_domain_like_the_one_inside():
    domain = arm(seed=3)
    assert isinstance(domain, Domain)
    for name in (
        "name",
        "seed",
        "genotype_length",
        "behavior_names",
        "unit",
        "objective_name",
        "bounds",
        "chunk",
    ):
        assert getattr(domain, name) == getattr(domain.domain, name)
    np.testing.assert_array_equal(domain.start, domain.domain.start)
    np.testing.assert_array_equal(domain.sample(3, seed=1), domain.domain.sample(3, seed=1))
    assert repr(domain) == (
        "Noisy(PlanarArm(joints=10, seed=3), Noise(observation=0.0, action=0.1, initial=0.0), repeats=6)"
    )
    with pytest.raises(TypeError, match="not a controller"):
        domain.controller(postures(1)[0])
    assert not hasattr(domain, "network")
    assert Noisy(FetchReach(), Noise()).network.inputs == 10


@settings(deadline=None, max_examples=30)
@given(st.permutations(range(12)), st.integers(1, 12))
def test_same_genotype_same_bits_whatever_the_batch(order, size):
    domain, genotypes = arm(), postures(12)
    whole = domain.evaluate(genotypes)
    batches = [np.array(order[first : first + size]) for first in range(0, 12, size)]
    for batch in batches:
        part = domain.evaluate(genotypes[batch])
        for name in ("behavior", "objective", "spread"):
            np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[batch])


@pytest.mark.parametrize("workers", [1, 3])
def test_workers_keep_the_spread(workers):
    domain = pickle.loads(pickle.dumps(arm()))
    domain.domain.chunk = 7
    genotypes = postures()
    with Threads(workers) as executor:
        evaluation = executor.evaluate(domain, genotypes)
    whole = arm().evaluate(genotypes)
    np.testing.assert_array_equal(evaluation.behavior, whole.behavior)
    np.testing.assert_array_equal(evaluation.spread, whole.spread)


def test_seeds_are_cut_from_a_digest():
    genotype = np.array([[0.5, -1.0]], np.float32)
    # IEEE 754 single precision, little-endian, written out.
    content = hashlib.sha256(bytes.fromhex("0000003f000080bf")).digest()
    for repeat in range(2):
        digest = hashlib.sha256(f"7/{repeat}/".encode() + content).digest()
        expected = int.from_bytes(digest[:8], "little") // 2
        assert evaluation_seeds(7, genotype, 2)[0, repeat] == expected


def test_seeds_differ_between_domains_genotypes_and_repeats():
    genotypes = postures(50)
    seeds = np.concatenate([evaluation_seeds(seed, genotypes, 4) for seed in (0, 1)])
    assert len(np.unique(seeds)) == 2 * 50 * 4
    assert (seeds >= 0).all()
    np.testing.assert_array_equal(evaluation_seeds(0, genotypes, 2), seeds[:50, :2])
    # 63 uniform bits: the mean of 400 of them, to five standard errors.
    assert seeds.mean() / 2**63 == pytest.approx(0.5, abs=5 / math.sqrt(12 * 400))


def test_mean_and_spread_are_those_of_the_repeats():
    domain, genotypes = arm(repeats=5, seed=2), postures(9)
    seeds = evaluation_seeds(2, genotypes, 5)
    each = [domain.domain.evaluate_noisy(genotypes, domain.noise, column) for column in seeds.T]
    evaluation = domain.evaluate(genotypes)
    behavior = np.stack([part.behavior for part in each])
    np.testing.assert_allclose(evaluation.behavior, behavior.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(evaluation.spread, behavior.std(axis=0, ddof=1), rtol=1e-10)
    np.testing.assert_allclose(
        evaluation.objective, np.mean([part.objective for part in each], axis=0), rtol=1e-12
    )
    np.testing.assert_array_equal(domain.evaluate(genotypes, seeds=seeds).behavior, evaluation.behavior)


def test_fresh_seeds_see_other_noise_of_the_same_size():
    domain, genotypes = arm(repeats=40), np.zeros((1, 10), np.float32)
    fresh = domain.evaluate(genotypes, seeds=[list(range(40))])
    usual = domain.evaluate(genotypes)
    assert (fresh.behavior != usual.behavior).all()
    # A chi-squared variable of 39 degrees of freedom lies within these factors but once in a million.
    assert 0.5 < noise_sensitivity(fresh)[0] / noise_sensitivity(usual)[0] < 2


def test_sensitivity_of_a_stretched_arm_is_known():
    """The hand of a straight arm of n links moves in y by Σ over joints of noise·(links beyond)/n."""
    joints, noise, repeats = 4, 0.01, 2000
    domain = Noisy(PlanarArm(joints), Noise(action=noise), repeats=repeats)
    sensitivity = noise_sensitivity(domain.evaluate(np.zeros((1, joints))))[0]
    lengths = np.arange(joints, 0, -1) / joints
    assert sensitivity == pytest.approx(noise * math.sqrt((lengths**2).sum()), rel=0.06)


@settings(deadline=None)
@given(st.integers(0, 2**31), st.floats(0.01, 100))
def test_sensitivity_is_the_root_mean_square_distance_and_scales(seed, factor):
    points = np.random.default_rng(seed).normal(size=(7, 1, 3))

    def sensitivity(values):
        parts = [Evaluation(v, np.zeros(1), np.zeros(1, bool), ("",)) for v in values]
        return noise_sensitivity(average(parts))[0]

    # The mean over pairs of squared distances is twice the variance.
    pairs = [np.sum((a - b) ** 2) for i, a in enumerate(points) for b in points[:i]]
    assert sensitivity(points) == pytest.approx(math.sqrt(np.mean(pairs) / 2), rel=1e-9)
    assert sensitivity(factor * points) == pytest.approx(factor * sensitivity(points), rel=1e-9)


def test_one_repeat_has_no_spread_and_none_no_sensitivity():
    assert np.isnan(arm(repeats=1).evaluate(postures(2)).spread).all()
    with pytest.raises(NichechainError, match="has no spread"):
        noise_sensitivity(PlanarArm().evaluate(postures(2)))


def test_a_repeat_that_fails_fails_the_row():
    good = Evaluation(np.ones((2, 2)), np.ones(2), np.zeros(2, bool), ("", ""))
    bad = Evaluation(
        np.array([[1.0, 1.0], [np.nan, np.nan]]),
        np.array([1.0, np.nan]),
        np.array([False, True]),
        ("", "fell"),
    )
    evaluation = average([good, bad, good])
    assert evaluation.failed.tolist() == [False, True]
    assert evaluation.reasons == ("", "fell")
    assert np.isnan(evaluation.behavior[1]).all()
    assert np.isnan(evaluation.spread[1]).all()
    assert evaluation.behavior[0].tolist() == [1, 1]
    assert evaluation.spread[0].tolist() == [0, 0]


def test_no_noise_is_the_domain_itself():
    genotypes = postures()
    silent = arm(noise=0.0, repeats=3).evaluate(genotypes)
    np.testing.assert_allclose(silent.behavior, PlanarArm().evaluate(genotypes).behavior, rtol=1e-15)
    np.testing.assert_allclose(silent.spread, 0, atol=1e-15)


def test_sensitivity_as_an_axis_of_behavior():
    inner = arm(repeats=8)
    domain = WithSensitivity(inner, ["sensitivity", "y"], most=0.4)
    genotypes = postures()
    evaluation = domain.evaluate(genotypes)
    plain = inner.evaluate(genotypes)
    np.testing.assert_array_equal(evaluation.behavior[:, 0], noise_sensitivity(plain))
    np.testing.assert_array_equal(evaluation.behavior[:, 1], plain.behavior[:, 1])
    assert isinstance(domain, Domain)
    assert domain.behavior_names == ("sensitivity", "y")
    assert domain.bounds == ((0.0, 0.4), (-1.0, 1.0))
    assert domain.start is None
    # A quarter of the shortest extent, which is 2.
    assert WithSensitivity(inner, ["x", "sensitivity"]).bounds[1] == (0.0, 0.5)


def test_an_archive_over_sensitivity_is_rebuilt_from_its_folder(tmp_path):
    options = {"joints": 4, "noise": "action:0.2", "repeats": 4, "axes": "x,sensitivity"}
    domain = make("arm", seed=1, **options)
    config = nc.BuildConfig(
        "arm", (8, 8), domain.bounds, domain_seed=1, evaluations=400, scale=0.3, domain_options=options
    )
    with Threads(1) as executor:
        nc.build(config, tmp_path, executor)
    archive = nc.load(tmp_path)
    assert archive.meta.facts.behavior_names == ("x", "sensitivity")
    assert archive.filled > 20
    again = archive.domain.evaluate(archive.elites.genotype)
    np.testing.assert_array_equal(again.behavior, archive.elites.behavior)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("action:0.1", Noise(action=0.1)),
        ("initial:2, observation:1e-3", Noise(observation=1e-3, initial=2.0)),
        ("action:0", Noise()),
    ],
)
def test_noise_from_text(text, expected):
    assert Noise.parse(text) == expected


@pytest.mark.parametrize("text", ["", "action", "action:", "action:x", "wind:1", "action=1", "0.1"])
def test_texts_that_are_no_noise(text):
    with pytest.raises(NichechainError, match="but must be like action:"):
        Noise.parse(text)


@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
@pytest.mark.parametrize("kind", ["observation", "action", "initial"])
def test_noise_that_is_none(kind, value):
    with pytest.raises(NichechainError, match=f"noise of {kind} is"):
        Noise(**{kind: value})


class Silent:
    """A domain that noise cannot act on."""

    name = "silent"


@pytest.mark.parametrize(
    ("make_it", "message"),
    [
        (lambda: Noisy(Silent(), Noise()), "noise cannot act on silent"),
        (lambda: arm(repeats=0), "repeats is 0"),
        (lambda: arm().evaluate(postures(2), seeds=[[1], [2], [3]]), r"must be \(2, R\)"),
        (lambda: arm().evaluate(postures(2), seeds=[[1], [-2]]), "from 0 on"),
        (lambda: Noisy(PlanarArm(), Noise(initial=1)).evaluate(postures(1)), "arm has only noise of action"),
        (lambda: WithSensitivity(arm(repeats=1), ["sensitivity"]), "needs two repeats or more"),
        (lambda: WithSensitivity(PlanarArm(), ["sensitivity"]), "needs two repeats or more"),
        (lambda: WithSensitivity(arm(), ["x", "y"]), "but must be sensitivity and some of x, y"),
        (lambda: WithSensitivity(arm(), ["sensitivity", "z"]), "axes are sensitivity, z"),
        (lambda: WithSensitivity(arm(), ["sensitivity", "x", "x"]), "each once"),
        (lambda: WithSensitivity(arm(), ["sensitivity"], most=0), "most is 0"),
    ],
)
def test_bad_input_is_one_sentence(make_it, message):
    with pytest.raises(NichechainError, match=message):
        make_it()
