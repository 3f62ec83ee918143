"""The native engine against gymnasium-robotics, bit for bit.

Policies are Xavier weights plus Cauchy noise. A random policy rarely touches the block, so most of
them also get the weights of one that reaches for it: contacts are where physics could differ.
"""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import gymnasium_robotics
import numpy as np
import pytest
from numpy.typing import NDArray

from nichechain.domains import FetchPickAndPlace
from nichechain.domains.engine import libraries
from nichechain.domains.engine.fetch import NativeFetch, Rollout, SteppedFetch, fetch_episodes
from nichechain.domains.policies.controllers import MLP

gymnasium.register_envs(gymnasium_robotics)

SCALES = (0.0, 0.1, 1.0)
STEPS = 50
# The block settles by less than this when nobody touches it.
MOVED = 1e-3


@pytest.fixture(scope="module")
def domain() -> FetchPickAndPlace:
    return FetchPickAndPlace()


def reaching(mlp: MLP, offset: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights that move the gripper towards the block plus an offset (3,), without biases."""
    inputs, hidden, _, outputs = mlp.sizes
    first = np.zeros((hidden, inputs))
    second = np.zeros((hidden, hidden))
    third = np.zeros((outputs, hidden))
    for axis in range(3):
        # Two rectified units carry the two signs; the gripper's x, about 1.3 m, stands for 1.
        for sign, unit in ((1, 2 * axis), (-1, 2 * axis + 1)):
            first[unit, 6 + axis] = sign
            first[unit, 0] = sign * offset[axis]
            second[unit, unit] = 1
            third[axis, unit] = sign
    return 200.0 * np.concatenate([weight.ravel() for weight in (first, second, third)])


def policies(mlp: MLP, n: int, seed: int) -> NDArray[np.float32]:
    """Genotypes at every mutation scale, two of three of them reaching for the block."""
    rng = np.random.default_rng(seed)
    genotypes = mlp.sample(n, seed).astype(np.float64)
    for i, genotype in enumerate(genotypes):
        if i % 9 < 6 and mlp.sizes[0] == 25:
            genotype += reaching(mlp, np.array([*rng.uniform(-0.08, 0.08, 2), -0.01]))
        genotype += SCALES[i % 3] * rng.standard_cauchy(genotype.size)
    return genotypes.astype(np.float32)


def stepped(env: Any, seed: int, mlp: MLP, genotype: NDArray[np.float32]) -> Rollout:
    """The same episode as a user of Gymnasium would write it."""
    observation, _ = env.reset(seed=seed)
    observations, actions = [observation["observation"]], []
    for _ in range(STEPS):
        actions.append(mlp.actions(genotype, observations[-1][None])[0])
        observation, *_ = env.step(actions[-1])
        observations.append(observation["observation"])
    return Rollout(np.array(observations), np.array(actions), "")


def assert_same_bits(ours: Rollout, theirs: Rollout) -> None:
    assert ours.failure == ""
    assert ours.observations.shape == (STEPS + 1, theirs.observations.shape[1])
    assert ours.actions.shape == (STEPS, 4)
    assert ours.observations.dtype == theirs.observations.dtype == np.float64
    assert ours.actions.dtype == theirs.actions.dtype == np.float32
    np.testing.assert_array_equal(ours.actions.view(np.int32), theirs.actions.view(np.int32))
    np.testing.assert_array_equal(ours.observations.view(np.int64), theirs.observations.view(np.int64))


def assert_parity(domain: FetchPickAndPlace, genotypes: NDArray[np.float32]) -> int:
    """Compare every genotype with the environment; how many moved the block."""
    env = gymnasium.make(domain.env_id)
    evaluation = domain.evaluate(genotypes)
    assert not evaluation.failed.any()
    moved = 0
    for genotype, behavior in zip(genotypes, evaluation.behavior, strict=True):
        reference = stepped(env, domain.seed, domain.network, genotype)
        assert_same_bits(domain.episode(genotype), reference)
        np.testing.assert_array_equal(
            behavior.view(np.int64), np.ascontiguousarray(reference.observations[-1, 3:5]).view(np.int64)
        )
        block = reference.observations[:, 3:5]
        moved += bool(np.linalg.norm(block[-1] - block[0]) > MOVED)
    env.close()
    return moved


def test_bits_equal_those_of_gymnasium_robotics(domain: FetchPickAndPlace) -> None:
    assert assert_parity(domain, policies(domain.network, 24, seed=1)) >= 8


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2, 3])
def test_bits_of_a_hundred_policies(domain: FetchPickAndPlace, seed: int) -> None:
    assert assert_parity(domain, policies(domain.network, 100, seed)) >= 30


def test_bits_from_another_reset() -> None:
    assert assert_parity(FetchPickAndPlace(seed=7), policies(MLP(), 6, seed=4)) >= 2


def test_bits_with_evolved_biases() -> None:
    domain = FetchPickAndPlace(evolve_biases=True)
    rng = np.random.default_rng(6)
    genotypes = domain.sample(6, seed=5)
    genotypes += (0.3 * rng.standard_cauchy(genotypes.shape)).astype(np.float32)
    assert_parity(domain, genotypes)


@pytest.mark.parametrize("env_id", ["FetchPush-v4", "FetchSlide-v4", "FetchReach-v4"])
def test_bits_of_the_other_fetch_tasks(env_id: str) -> None:
    native = NativeFetch(env_id, seed=3)
    mlp = MLP((native.inputs, 32, 32, 4))
    assert native.inputs == (10 if env_id == "FetchReach-v4" else 25)
    env = gymnasium.make(env_id)
    seen = []
    for genotype in policies(mlp, 6, seed=8):
        episode = native.run(mlp, genotype, STEPS)
        assert_same_bits(episode, stepped(env, 3, mlp, genotype))
        seen.append(episode.observations)
    if env_id != "FetchReach-v4":
        assert any(np.linalg.norm(block[-1, 3:5] - block[0, 3:5]) > MOVED for block in seen)
    env.close()


def test_episodes_leave_nothing_behind(domain: FetchPickAndPlace) -> None:
    """The pooled physics state starts every episode anew, whatever ran before."""
    genotypes = policies(domain.network, 4, seed=9)
    before = [domain.episode(genotype) for genotype in genotypes]
    after = [domain.episode(genotype) for genotype in genotypes[::-1]][::-1]
    for first, second in zip(before, after, strict=True):
        assert_same_bits(first, second)


def test_stepped_episodes_have_the_bits_of_native_ones() -> None:
    native = NativeFetch("FetchPickAndPlace-v4", seed=0)
    fallback = SteppedFetch("FetchPickAndPlace-v4", seed=0)
    assert native.inputs == fallback.inputs
    np.testing.assert_array_equal(native.goal, fallback.goal)
    mlp = MLP()
    for genotype in policies(mlp, 6, seed=10):
        assert_same_bits(native.run(mlp, genotype, STEPS), fallback.run(mlp, genotype, STEPS))


def test_falls_back_to_gymnasium_with_a_warning(
    domain: FetchPickAndPlace, monkeypatch: pytest.MonkeyPatch
) -> None:
    genotypes = policies(domain.network, 3, seed=11)
    native = domain.evaluate(genotypes)

    def unavailable() -> None:
        raise libraries.NativeUnavailableError("this machine is imaginary")

    monkeypatch.setattr(libraries, "load", unavailable)
    with pytest.warns(RuntimeWarning, match="slower: this machine is imaginary"):
        episodes = fetch_episodes("FetchPickAndPlace-v4", 0, MLP())
    assert isinstance(episodes, SteppedFetch)
    with pytest.warns(RuntimeWarning, match="stepped through Gymnasium"):
        fallback = FetchPickAndPlace().evaluate(genotypes)
    np.testing.assert_array_equal(native.behavior.view(np.int64), fallback.behavior.view(np.int64))
    np.testing.assert_array_equal(native.objective.view(np.int64), fallback.objective.view(np.int64))


def test_native_episodes_are_what_this_machine_gets() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        assert isinstance(fetch_episodes("FetchPickAndPlace-v4", 0, MLP()), NativeFetch)


def test_fatal_physics_warnings_are_named() -> None:
    """MuJoCo resets a state that it found bad, so a result after one means nothing."""
    native = NativeFetch("FetchPickAndPlace-v4", seed=0)
    # A block that starts at an infinite speed: the first substep finds it.
    native._start.qvel[:] = np.inf
    episode = native.run(MLP(), np.zeros(MLP().genotype_length, np.float32), 1)
    assert episode.failure.startswith("unstable physics (")
    assert "BADQVEL" in episode.failure
