"""The Fetch tasks against gymnasium-robotics, undisturbed and under noise, bit for bit."""

from __future__ import annotations

import gymnasium
import gymnasium_robotics
import numpy as np
import pytest

from nichechain.core.errors import NichechainError
from nichechain.domains import (
    Domain,
    FetchPickAndPlace,
    FetchPush,
    FetchReach,
    FetchSlide,
    Noise,
    Perturbable,
    make,
)
from nichechain.domains.engine.fetch import Disturbance, NativeFetch, SteppedFetch
from nichechain.domains.policies.controllers import MLP, ModuleController

gymnasium.register_envs(gymnasium_robotics)

TASKS = [FetchPickAndPlace, FetchPush, FetchSlide, FetchReach]


def policies(domain, n=4, seed=0):
    """Initial weights; from the second on with Cauchy noise too."""
    rng = np.random.default_rng(seed)
    genotypes = domain.sample(n, seed=seed).astype(np.float64)
    genotypes[1:] += rng.standard_cauchy(genotypes[1:].shape)
    return genotypes.astype(np.float32)


@pytest.mark.parametrize("task", TASKS)
def test_behavior_and_objective_are_those_of_gymnasium_robotics(task):
    domain = task(seed=3)
    assert isinstance(domain, Domain)
    assert isinstance(domain, Perturbable)
    genotypes = policies(domain)
    evaluation = domain.evaluate(genotypes)
    env = gymnasium.make(task.env_id, reward_type="dense")
    for genotype, behavior, objective in zip(
        genotypes, evaluation.behavior, evaluation.objective, strict=True
    ):
        observation, _ = env.reset(seed=3)
        # What is achieved is the block's place, or the gripper's: the environment's own word for it.
        np.testing.assert_array_equal(domain.start, observation["achieved_goal"][:2])
        for _ in range(domain.steps):
            action = domain.actions(genotype, observation["observation"][None])[0]
            observation, reward, *_ = env.step(action)
        np.testing.assert_array_equal(behavior, observation["achieved_goal"][:2])
        assert objective == reward
    env.close()
    assert isinstance(domain._episodes, NativeFetch)


@pytest.mark.parametrize(("task", "inputs"), [(FetchPush, 25), (FetchSlide, 25), (FetchReach, 10)])
def test_sizes_are_those_of_the_observations(task, inputs):
    domain = task()
    assert domain.genotype_length == inputs * 32 + 32 * 32 + 32 * 4
    assert task(evolve_biases=True).genotype_length == domain.genotype_length + 32 + 32 + 4
    assert task(controller="mlp-tanh:8").network == MLP((inputs, 8, 4), "tanh", "tanh")


@pytest.mark.parametrize("task", [FetchPickAndPlace, FetchPush, FetchSlide])
def test_bounds_are_the_table(task):
    env = gymnasium.make(task.env_id)
    model = env.unwrapped.model
    body = model.body("table0")
    half = model.geom_size[body.geomadr[0]]
    for axis, (low, high) in enumerate(task.bounds):
        assert low == pytest.approx(body.pos[axis] - half[axis], abs=0.0051)
        assert high == pytest.approx(body.pos[axis] + half[axis], abs=0.0051)
    env.close()


@pytest.mark.parametrize("task", [FetchPickAndPlace, FetchReach])
@pytest.mark.parametrize(
    "kinds", [("observation",), ("action",), ("shift",), ("observation", "action", "shift")]
)
def test_disturbed_episodes_are_alike_natively_and_stepped(task, kinds):
    if "shift" in kinds and not task.has_block:
        pytest.skip("there is no block to move")
    rng = np.random.default_rng(1)
    noise = {
        "observation": 0.05 * rng.standard_normal((50, task.inputs)),
        "action": (0.5 * rng.standard_normal((50, 4))).astype(np.float32),
        "shift": np.array([0.03, -0.05]),
    }
    disturbance = Disturbance(**{kind: noise[kind] for kind in kinds})
    domain = task(seed=1)
    genotype = policies(domain, 2)[1]
    episodes = [kind(task.env_id, 1) for kind in (NativeFetch, SteppedFetch)]
    native, stepped = (each.run(domain.network, genotype, 50, disturbance) for each in episodes)
    np.testing.assert_array_equal(native.observations, stepped.observations)
    np.testing.assert_array_equal(native.actions, stepped.actions)
    undisturbed = episodes[0].run(domain.network, genotype, 50)
    assert (native.observations != undisturbed.observations).any()
    if "shift" in kinds:
        moved = native.observations[0, 3:5] - undisturbed.observations[0, 3:5]
        np.testing.assert_allclose(moved, noise["shift"], atol=1e-12)
    elif "observation" in kinds:
        # Noise is in the eye of the policy, not in what is recorded.
        np.testing.assert_array_equal(native.observations[0], undisturbed.observations[0])


def test_actions_beyond_the_bounds_are_clipped_as_the_environment_does():
    """Outputs of a network without tanh go where they like."""
    domain = FetchPickAndPlace(controller="mlp:4")
    network = MLP((25, 4, 4), "relu", "identity")
    genotype = 5 * network.sample(1, 3)[0]
    native, stepped = (
        kind(domain.env_id, 0).run(network, genotype, 50) for kind in (NativeFetch, SteppedFetch)
    )
    assert np.abs(native.actions).max() > 1
    np.testing.assert_array_equal(native.observations, stepped.observations)


def test_noise_depends_on_the_seed_alone():
    domain = FetchPickAndPlace()
    genotypes = policies(domain, 3)
    noise = Noise(observation=0.01, action=0.2, initial=0.02)
    whole = domain.evaluate_noisy(genotypes, noise, [7, 8, 9])
    alone = domain.evaluate_noisy(genotypes[1:2], noise, [8])
    np.testing.assert_array_equal(whole.behavior[1:2], alone.behavior)
    other = domain.evaluate_noisy(genotypes, noise, [10, 11, 12])
    assert (whole.behavior != other.behavior).all()
    silent = domain.evaluate_noisy(genotypes, Noise(), [7, 8, 9])
    np.testing.assert_array_equal(silent.behavior, domain.evaluate(genotypes).behavior)


def test_reach_has_no_block_to_displace():
    domain = FetchReach()
    with pytest.raises(NichechainError, match="only noise of observation, action"):
        domain.evaluate_noisy(domain.sample(1, seed=0), Noise(initial=0.1), [0])


@pytest.mark.parametrize("seeds", [[1], [1, 2, 3], [1, -2], [[1, 2]]])
def test_seeds_that_do_not_fit(seeds):
    domain = FetchReach()
    with pytest.raises(NichechainError, match="one for each genotype"):
        domain.evaluate_noisy(domain.sample(2, seed=0), Noise(), seeds)


@pytest.mark.parametrize("text", ["mlp", "mlp:8,x", "mlp:-3", "lstm:8", "mlp:8,,8", "mlp:٣"])
def test_controllers_that_are_none(text):
    with pytest.raises(NichechainError, match="but must be mlp:UNITS,UNITS"):
        make("fetch-reach", controller=text)


def test_a_module_of_another_kind_is_stepped():
    from torch import nn

    domain = FetchReach(controller=nn.Sequential(nn.Linear(10, 4), nn.Sigmoid()))
    assert isinstance(domain.network, ModuleController)
    assert domain.evaluate(domain.sample(1, seed=0)).behavior.shape == (1, 2)
    assert isinstance(domain._episodes, SteppedFetch)
