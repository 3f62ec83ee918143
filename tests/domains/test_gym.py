"""Gymnasium environments as domains: against a loop as a user of Gymnasium would write it."""

from __future__ import annotations

import pickle

import gymnasium
import numpy as np
import pytest

from nichechain import execution
from nichechain.core.errors import NichechainError
from nichechain.domains import Domain, Evaluation, Noise, Noisy, Perturbable, make
from nichechain.domains.noise import evaluation_seeds

from .environments import DOMAINS, cart_pole, machine, maze, policies, swimmer


def assert_same(first, second):
    for name in ("behavior", "objective", "failed"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert first.reasons == second.reasons


def by_hand(env, domain, genotype, seed, read, act, steps):
    """Observations, rewards and the last step of an episode."""
    observation, _ = env.reset(seed=seed)
    rewards = 0.0
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(
            act(domain.network.policy(genotype)(read(observation)[None])[0])
        )
        rewards += float(reward)
        if terminated or truncated:
            break
    return observation, rewards, info


def test_swimmer_is_that_of_gymnasium():
    domain = swimmer(seed=4)
    genotypes = policies(domain)
    evaluation = domain.evaluate(genotypes)
    env = gymnasium.make("Swimmer-v5")
    for genotype, behavior, objective in zip(
        genotypes, evaluation.behavior, evaluation.objective, strict=True
    ):
        _, rewards, info = by_hand(env, domain, genotype, 4, lambda o: o, lambda a: a, 40)
        assert behavior.tolist() == [info["x_position"], info["y_position"]]
        # The body really is there.
        np.testing.assert_array_equal(behavior, env.unwrapped.data.qpos[:2])
        assert objective == rewards
    env.close()


def test_maze_reads_the_observation_and_ends_where_the_ball_is():
    domain = maze(seed=2)
    genotypes = policies(domain)
    evaluation = domain.evaluate(genotypes)
    env = gymnasium.make("PointMaze_UMaze-v3")
    assert domain.network.inputs == 4
    for genotype, behavior in zip(genotypes, evaluation.behavior, strict=True):
        observation, *_ = by_hand(env, domain, genotype, 2, lambda o: o["observation"], lambda a: a, 40)
        np.testing.assert_array_equal(behavior, observation["achieved_goal"])
    env.close()


def test_discrete_actions_are_those_of_the_largest_output():
    domain = cart_pole()
    genotypes = policies(domain)
    evaluation = domain.evaluate(genotypes)
    env = gymnasium.make("CartPole-v1")
    lengths = set()
    for genotype, behavior, objective in zip(
        genotypes, evaluation.behavior, evaluation.objective, strict=True
    ):
        observation, rewards, _ = by_hand(
            env, domain, genotype, 0, lambda o: o, lambda a: int(np.argmax(a)), 500
        )
        np.testing.assert_array_equal(behavior, observation[[0, 2]].astype(np.float64))
        assert objective == rewards
        lengths.add(rewards)
    # A pole falls after as many steps as its policy is good for.
    assert len(lengths) > 1
    env.close()


@pytest.mark.parametrize("name", DOMAINS)
def test_bits_depend_on_neither_batch_nor_order(name):
    domain = DOMAINS[name]()
    genotypes = policies(domain)
    whole = domain.evaluate(genotypes)
    assert isinstance(domain, Domain)
    assert isinstance(domain, Perturbable)
    assert not whole.failed.any()
    assert len(np.unique(whole.behavior, axis=0)) > 1
    for row in (3, 0):
        assert_same(domain.evaluate(genotypes[row : row + 1]), Evaluation(*rows(whole, row)))
    fresh = DOMAINS[name]()
    np.testing.assert_array_equal(fresh.evaluate(genotypes[::-1]).behavior[::-1], whole.behavior)


def rows(evaluation, row):
    keep = slice(row, row + 1)
    return (
        evaluation.behavior[keep],
        evaluation.objective[keep],
        evaluation.failed[keep],
        evaluation.reasons[keep],
    )


@pytest.mark.parametrize("workers", ["threads:3", "processes:2"])
@pytest.mark.parametrize("name", ["swimmer", "lander"])
def test_bits_do_not_depend_on_the_workers(name, workers):
    domain = DOMAINS[name]()
    genotypes = policies(domain, 7)
    with execution.make(workers) as executor:
        assert_same(executor.evaluate(domain, genotypes), domain.evaluate(genotypes))


def test_goes_to_another_process_without_its_environments():
    domain = swimmer(repeats=2)
    genotypes = policies(domain, 2)
    before = domain.evaluate(genotypes)
    copy = pickle.loads(pickle.dumps(domain))
    assert copy._idle == []
    assert repr(copy) == f"GymDomain('Swimmer-v5', seed=0, {8 * 8 + 8 * 2} parameters)"
    assert_same(copy.evaluate(genotypes), before)


def test_repeats_are_a_mean_over_resets_that_the_genotype_decides():
    domain = cart_pole(repeats=3, seed=5)
    genotypes = policies(domain)
    evaluation = domain.evaluate(genotypes)
    seeds = evaluation_seeds(5, genotypes, 3)
    assert len(np.unique(seeds)) == seeds.size
    each = np.stack([domain.evaluate(genotypes, seeds=seeds[:, [r]]).behavior for r in range(3)])
    np.testing.assert_allclose(evaluation.behavior, each.mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(evaluation.spread, each.std(axis=0, ddof=1), rtol=1e-9)
    one = cart_pole(seed=int(seeds[0, 0] % 2**31)).evaluate(genotypes[:1])
    np.testing.assert_array_equal(one.behavior[0], each[0, 0])
    np.testing.assert_array_equal(domain.evaluate(genotypes[2:3]).behavior[0], evaluation.behavior[2])


def test_noise_of_observations_actions_and_the_start():
    domain = swimmer()
    genotypes = policies(domain, 3)
    plain = domain.evaluate(genotypes).behavior
    behaviors = [
        Noisy(domain, noise, repeats=1).evaluate(genotypes).behavior
        for noise in (Noise(), Noise(observation=0.1), Noise(action=0.1), Noise(initial=1.0))
    ]
    np.testing.assert_array_equal(behaviors[0], plain)
    for behavior in behaviors[1:]:
        assert (behavior != plain).all()
    with pytest.raises(NichechainError, match="1 for another reset each time"):
        domain.evaluate_noisy(genotypes, Noise(initial=0.1), [0, 1, 2])


def test_unstable_physics_is_a_failure():
    domain = swimmer()
    env = domain._idle[0].unwrapped
    step = env.do_simulation

    def upset(*arguments):
        env.data.qvel[:] = np.inf
        step(*arguments)

    env.do_simulation = upset
    assert domain.evaluate(policies(domain, 1)).reasons[0].startswith("unstable physics (BADQVEL")


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("gym:NoSuch-v0", {}, "environment NoSuch-v0 cannot be made"),
        ("gym:Swimmer-v5", {}, "has no finite bounds of behavior of its own"),
        ("gym:Swimmer-v5", {"bounds": "0,1"}, "bounds of 1 axes of behavior, but 2 axes: x, y"),
        ("gym:Swimmer-v5", {"bounds": "0,1", "descriptor": "final-observation:8"}, "but the last is 7"),
        ("gym:Swimmer-v5", {"bounds": "0,1", "descriptor": "final-observation:a"}, "descriptor is"),
        ("gym:Swimmer-v5", {"bounds": "0,1,0,1", "steps": 0}, "steps is 0"),
        ("gym:Swimmer-v5", {"bounds": "0,1,0,1", "repeats": 0}, "repeats is 0"),
        ("gym:Swimmer-v5", {"bounds": "0,1,0,1", "steps": "many"}, "do not fit gym:Swimmer-v5"),
        ("gym:Swimmer-v5", {"bounds": "0,1,0,1", "speed": 2}, "has no option 'speed'"),
        ("gym:Swimmer-v5", {"bounds": "0,1,0,1", "env.speed": 2}, "cannot be made"),
        ("gym:Swimmer-v5", {"bounds": "0,1,0,1", "observations": "x"}, "has no keys to choose from"),
        ("gym:PointMaze_UMaze-v3", {"bounds": "0,1,0,1", "observations": "x"}, "have no key 'x'"),
        ("gym:CartPole-v1", {"bounds": "0,1,0,1", "controller": "mlp"}, "but must be mlp:UNITS"),
    ],
)
def test_bad_input_is_one_sentence(name, options, message):
    with pytest.raises(NichechainError, match=message):
        make(name, **options)


def test_options_of_the_environment():
    assert make("gym:Swimmer-v5", bounds="0,1,0,1", **{"env.frame_skip": 2}).episode(
        np.zeros(8 * 64 + 64 * 64 + 64 * 2, np.float32)
    ).env.dt == pytest.approx(0.02)


def test_an_environment_with_nested_spaces_is_a_domain():
    domain = machine()
    assert domain.bounds == ((-9.0, 9.0), (-9.0, 9.0))
    genotypes = policies(domain)
    found = domain.evaluate(genotypes)
    assert not found.failed.any()
    assert found.behavior.dtype == np.float32
    episode = domain.episode(genotypes[0])
    assert episode.actions.shape == (4,)
    pushed = sum(action["push"][0] for action in episode.actions)
    assert found.behavior[0, 0] == pytest.approx(pushed, abs=1e-6)
