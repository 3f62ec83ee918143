"""Gymnasium environments as domains: against a loop as a user of Gymnasium would write it."""

from __future__ import annotations

import importlib
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import nichechain as nc
from nichechain import execution
from nichechain.cli import main
from nichechain.core.errors import NichechainError
from nichechain.domains import Domain, Evaluation, GymDomain, Noise, Noisy, Perturbable, make
from nichechain.domains.constancy import inconstancy
from nichechain.domains.policies.spaces import BoxActions, DiscreteActions, Observations, actions_of

SQUARE = ((-2.0, 2.0), (-2.0, 2.0))


def maze(**options):
    return GymDomain("PointMaze_UMaze-v3", bounds=SQUARE, steps=40, controller="mlp:8", **options)


def swimmer(**options):
    return GymDomain("Swimmer-v5", bounds=SQUARE, steps=40, controller="mlp:8", **options)


def cart_pole(**options):
    options = {"bounds": SQUARE, "controller": "mlp:8"} | options
    return GymDomain("CartPole-v1", "final-observation:0,2", **options)


def lander(**options):
    pytest.importorskip("Box2D")
    return GymDomain("LunarLander-v3", "final-observation:0,1", controller="mlp:8", steps=120, **options)


DOMAINS = {"maze": maze, "swimmer": swimmer, "cart-pole": cart_pole, "lander": lander}


def policies(domain, n=5, seed=1):
    rng = np.random.default_rng(seed)
    genotypes = domain.sample(n, seed=seed)
    return (genotypes + 0.3 * rng.standard_normal(genotypes.shape)).astype(np.float32)


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
    from nichechain.domains.noise import evaluation_seeds

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


def test_episode_tells_a_descriptor_what_happened():
    domain = maze()
    genotype = policies(domain, 1)[0]
    episode = domain.episode(genotype)
    assert episode.observations.shape == (41, 4)
    assert episode.actions.shape == (40, 2)
    assert episode.rewards.shape == (40,)
    assert len(episode.infos) == 41
    assert not episode.terminated
    assert set(episode.last) == {"observation", "achieved_goal", "desired_goal"}
    np.testing.assert_array_equal(episode.env.data.qpos, episode.observations[-1, :2])
    np.testing.assert_array_equal(domain.evaluate(genotype[None]).behavior[0], episode.observations[-1, :2])


@pytest.mark.parametrize(
    ("descriptor", "expected", "names"),
    [
        ("final-observation:1,0", lambda e: e.observations[-1, [1, 0]], ("observation_1", "observation_0")),
        ("mean-observation:2", lambda e: e.observations[1:, [2]].mean(axis=0), ("observation_2",)),
        ("final-info:reward_forward", lambda e: [e.infos[-1]["reward_forward"]], ("reward_forward",)),
        (lambda e: [len(e.actions), e.rewards.sum()], lambda e: [40, e.rewards.sum()], ("0", "1")),
    ],
)
def test_descriptors(descriptor, expected, names):
    axes = [(-1.0, 1.0)] * len(names)
    domain = GymDomain("Swimmer-v5", descriptor, bounds=axes, steps=40, controller="mlp:")
    genotype = policies(domain, 1)
    assert domain.behavior_names == names
    np.testing.assert_allclose(
        domain.evaluate(genotype).behavior[0], expected(domain.episode(genotype[0])), rtol=1e-12
    )


def test_feet_of_an_ant(monkeypatch):
    """Four axes of behavior from a function named by module and function."""
    monkeypatch.syspath_prepend("tests/domains")
    domain = make(
        "gym:Ant-v5",
        descriptor="behaviors:feet_contacts",
        bounds="0,1,0,1,0,1,0,1",
        names="front left,front right,back left,back right",
        steps=60,
        controller="mlp:8",
    )
    assert domain.behavior_names[0] == "front left"
    episode = domain.episode(policies(domain, 1)[0])
    model = episode.env.model
    # Bodies 4, 7, 10 and 13 of the model, world being 0, are those that carry the feet.
    for body in (4, 7, 10, 13):
        (geom,) = np.flatnonzero(model.geom_bodyid == body)
        assert "ankle" in model.geom(geom).name
    behavior = domain.evaluate(policies(domain, 4)).behavior
    assert ((behavior >= 0) & (behavior <= 1)).all()
    assert behavior.max() > 0


def test_bounds_of_an_observation_are_bounds_of_behavior():
    domain = lander()
    space = gymnasium.make("LunarLander-v3").observation_space
    assert domain.bounds == ((space.low[0], space.high[0]), (space.low[1], space.high[1]))


def test_what_fails_says_why(monkeypatch):
    monkeypatch.syspath_prepend("tests/domains")
    domain = swimmer(descriptor="behaviors:not_a_number")
    genotypes = policies(domain, 2)
    genotypes[1, 3] = np.inf
    evaluation = domain.evaluate(genotypes)
    assert evaluation.reasons == ("behavior is not finite", "genotype is not finite")
    assert evaluation.failed.all()
    assert np.isnan(evaluation.behavior).all()
    assert np.isnan(evaluation.objective).all()


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
    ("options", "message"),
    [
        ({"descriptor": "behaviors:three_numbers"}, r"array of shape \(3,\), but there are bounds of 2 axes"),
        ({"descriptor": "behaviors:nothing"}, "descriptor behaviors:nothing cannot be imported"),
        ({"descriptor": "no_such_module:f"}, "is its folder in PYTHONPATH"),
        ({"descriptor": "behaviors:NUMBER"}, "is int, but must be a function"),
        ({"descriptor": "final-info:speed"}, "the last info has no 'speed'"),
    ],
)
def test_descriptors_that_do_not_fit_say_so_when_used(options, message, monkeypatch):
    monkeypatch.syspath_prepend("tests/domains")
    domain = swimmer(names=("a", "b"), **options)
    with pytest.raises(NichechainError, match=message):
        domain.evaluate(policies(domain, 1))


def test_an_attribute_of_a_class_is_a_function_too(monkeypatch):
    monkeypatch.syspath_prepend("tests/domains")
    domain = swimmer(descriptor="behaviors:Holder.first_two")
    assert domain.evaluate(policies(domain, 1)).behavior.shape == (1, 2)


def test_no_position_no_final_xy():
    domain = GymDomain("CartPole-v1", bounds=SQUARE)
    with pytest.raises(NichechainError, match="final-xy finds neither"):
        domain.evaluate(policies(domain, 1))


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


@pytest.mark.parametrize(
    "space",
    [
        spaces.Box(-np.inf, np.inf, (2,)),
        spaces.Box(0, 9, (2,), np.int64),
        spaces.Text(3),
        spaces.Tuple([]),
        spaces.Tuple([spaces.Discrete(2), spaces.Text(3)]),
    ],
)
def test_actions_that_are_not_supported(space):
    with pytest.raises(NichechainError, match="but must be"):
        actions_of(space)


@pytest.mark.parametrize(
    "space", [spaces.Text(3), spaces.Dict(a=spaces.Tuple([spaces.Text(3)])), spaces.Tuple([])]
)
def test_observations_that_are_not_supported(space):
    with pytest.raises(NichechainError, match="but must be Box, Discrete, MultiDiscrete or MultiBinary"):
        Observations.of(space)


def test_observations_are_read_in_the_order_of_their_keys():
    space = spaces.Dict(
        picture=spaces.Box(0, 255, (2, 2), np.uint8),
        kind=spaces.Discrete(3, start=1),
        on=spaces.MultiBinary(2),
    )
    value = {"picture": np.array([[1, 2], [3, 4]], np.uint8), "kind": 2, "on": np.array([1, 0])}
    read = Observations.of(space, ["kind", "picture"])
    assert read.inputs == 7
    assert read.flat(value).tolist() == [0, 1, 0, 1, 2, 3, 4]
    # Gymnasium's own flattening, of all keys.
    everything = Observations.of(space)
    np.testing.assert_array_equal(everything.flat(value), spaces.flatten(space, value))
    assert everything.high.tolist() == [255, 255, 255, 255, 1, 1, 1, 1, 1]


NESTED = spaces.Dict(
    {
        "observation": spaces.Tuple(
            [
                spaces.Box(-2, 2, (2,), np.float32),
                spaces.Dict({"gear": spaces.Discrete(3), "dials": spaces.MultiDiscrete([2, 3])}),
                spaces.MultiBinary(2),
            ]
        ),
        "goal": spaces.Tuple([spaces.Discrete(2, start=5), spaces.MultiDiscrete([[2, 2], [3, 2]])]),
    }
)


@pytest.mark.parametrize("key", ["observation", "goal"])
def test_nested_observations_are_flattened_as_gymnasium_does(key):
    space = NESTED[key]
    space.seed(1)
    read = Observations.of(NESTED, [key])
    assert read.inputs == spaces.flatdim(space) == len(read.low) == len(read.high)
    for _ in range(20):
        value = space.sample()
        np.testing.assert_array_equal(read.flat({key: value}), spaces.flatten(space, value))
    assert Observations.of(space).inputs == read.inputs


def test_nested_actions_belong_to_their_space():
    rng = np.random.default_rng(0)
    for space in (NESTED, NESTED["observation"], NESTED["goal"], spaces.MultiDiscrete([2, 5], start=[1, -2])):
        actions = actions_of(space)
        assert actions.outputs == spaces.flatdim(space)
        for _ in range(20):
            assert space.contains(actions.action(rng.normal(size=actions.outputs).astype(np.float32)))


def test_of_many_choices_each_has_its_largest_output():
    actions = actions_of(spaces.MultiDiscrete([2, 3], start=[0, 4]))
    assert actions.action(np.float32([1, 2, 3, 1, 2])).tolist() == [1, 4]
    assert actions_of(spaces.MultiBinary(3)).action(np.float32([-1, 0, 2])).tolist() == [0, 0, 1]
    several = actions_of(spaces.Tuple([spaces.Discrete(2), spaces.Box(-1, 1, (1,))]))
    assert several.activation == "tanh"
    choice, size = several.action(np.float32([0.1, 0.2, 0.5]))
    assert (choice, size.tolist()) == (1, [0.5])


class Machine(gymnasium.Env):
    """Two numbers that a gear and a push move; both spaces are nested."""

    observation_space = spaces.Tuple([spaces.Box(-9, 9, (1,)), spaces.Dict(turned=spaces.Box(-9, 9, (1,)))])
    action_space = spaces.Dict(gear=spaces.MultiDiscrete([3, 2]), push=spaces.Box(-1, 1, (1,)))

    def __init__(self, leak=False):
        self.leak, self.at = leak, np.zeros(2)

    def reset(self, *, seed=None, options=None):  # noqa: ARG002  # as Gymnasium calls it
        super().reset(seed=seed)
        self.at = (0.5 if self.leak else 0.0) * self.at
        return self._seen(), {}

    def step(self, action):
        assert self.action_space.contains(action)
        self.at = self.at + np.array([action["push"][0], action["gear"][0] - 1])
        return self._seen(), 0.0, False, False, {}

    def _seen(self):
        return np.float32(self.at[:1]), {"turned": np.float32(self.at[1:])}


gymnasium.register("nichechain-test/Machine-v0", Machine, max_episode_steps=4)


def machine(**options):
    return GymDomain(
        "nichechain-test/Machine-v0", "final-observation:0,1", controller="mlp:4", env_options=options
    )


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


def test_actions_span_their_bounds():
    actions = actions_of(spaces.Box(np.array([-2.0, 0.0], np.float32), np.array([2.0, 10.0], np.float32)))
    assert isinstance(actions, BoxActions)
    np.testing.assert_array_equal(actions.action(np.float32([-1, -1])), [-2, 0])
    np.testing.assert_array_equal(actions.action(np.float32([0, 0.5])), [0, 7.5])
    np.testing.assert_array_equal(actions.action(np.float32([3, -9])), [2, 0])
    assert actions.action(np.float32([0, 0])).dtype == np.float32
    assert actions_of(spaces.Discrete(3, start=-1)) == DiscreteActions(3, -1)
    assert DiscreteActions(3, -1).action(np.float32([0.5, 2, 2])) == 0


def test_loading_an_archive_imports_no_descriptor(tmp_path):
    """What meta.json names runs only where it is trusted, and when something is evaluated."""
    (tmp_path / "side_effect.py").write_text(
        "from pathlib import Path\n"
        "Path('imported').touch()\n"
        "def first_two(episode):\n    return episode.observations[-1, :2]\n"
    )
    script = """
import os, sys, numpy as np, nichechain as nc
from pathlib import Path
sys.path.insert(0, '.')
from nichechain import cli
words = ["build", "gym:Swimmer-v5", "--descriptor", "side_effect:first_two", "--bounds=-2,2,-2,2", "--steps",
         "5", "--controller", "mlp:4", "--evaluations", "40", "--initial", "20", "--grid", "4x4"]
words += ["--out", "a"]
if sys.argv[1] == "build":
    assert cli.main(words) == 0
else:
    archive = nc.load("a")
    archive.chain(), archive.births(), archive.elites
    elite = archive.elites
    niche = archive.niches.index(elite.niche[0])
    for untrusted in (lambda: archive.domain, lambda: archive.controller(niche)):
        try:
            untrusted()
        except nc.ArchiveError as error:
            assert "asks to import 'side_effect'" in str(error)
        else:
            raise AssertionError("a module is imported because an archive names it")
    assert cli.main(["build", "gym:Swimmer-v5", "--out", "a", "--resume", "--evaluations", "50"]) == 2
    assert not Path("imported").exists()
    os.environ["NICHECHAIN_TRUSTED_MODULES"] = "side_effect"
    module = archive.domain.controller(elite.genotype[0])
    assert [tuple(p.shape) for p in module.parameters()] == [(4, 8), (4,), (2, 4), (2,)]
    # Not even then, before an episode is evaluated.
    assert not Path("imported").exists()
    again = archive.domain.evaluate(elite.genotype)
    assert (again.behavior == elite.behavior).all()
    assert Path("imported").exists()
"""
    run = [sys.executable, "-c", script]
    subprocess.run([*run, "build"], cwd=tmp_path, check=True, capture_output=True)
    (tmp_path / "imported").unlink()
    subprocess.run([*run, "load"], cwd=tmp_path, check=True)


def test_a_build_goes_on_from_its_folder_alone(tmp_path):
    """The command names the environment and the folder; the rest is in the folder."""
    from nichechain.cli import main

    words = ["build", "gym:CartPole-v1", "--initial", "20", "--grid", "5x5"]
    asked = ["--descriptor", "final-observation:0,2", "--bounds=-2.4,2.4,-0.4,0.4", "--controller", "mlp:4"]
    asked += ["--repeats", "2", "--options", "unit=m and rad", "env.sutton_barto_reward=true"]
    assert main([*words, *asked, "--evaluations", "60", "--out", str(tmp_path / "short")]) == 0
    assert (
        main(
            ["build", "gym:CartPole-v1", "--resume", "--evaluations", "90", "--out", str(tmp_path / "short")]
        )
        == 0
    )
    assert main([*words, *asked, "--evaluations", "90", "--out", str(tmp_path / "long")]) == 0
    short, long = nc.load(tmp_path / "short"), nc.load(tmp_path / "long")
    assert short.config == long.config
    assert short.births().equals(long.births())
    assert short.config.domain_options == {
        "bounds": "-2.4,2.4,-0.4,0.4",
        "controller": "mlp:4",
        "descriptor": "final-observation:0,2",
        "env.sutton_barto_reward": True,
        "repeats": 2,
        "unit": "m and rad",
    }
    assert short.config.bounds == ((-2.4, 2.4), (-0.4, 0.4))
    again = short.domain.evaluate(short.elites.genotype)
    np.testing.assert_array_equal(again.behavior, short.elites.behavior)


def test_no_simulator_is_imported_before_it_is_asked_for():
    importlib.import_module("nichechain.domains")
    code = (
        "import sys, nichechain.domains; print({'torch', 'gymnasium', 'mujoco', 'numba'} & set(sys.modules))"
    )
    shown = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert shown.stdout.strip() == "set()"


def test_a_reset_that_leaks_is_noticed():
    def found(**options):
        domain = machine(**options)
        return inconstancy(domain.evaluate, machine(**options).evaluate, policies(domain))

    assert found() is None
    assert "again in another order has a behavior" in found(leak=True)


def test_a_build_says_that_its_environment_leaks(tmp_path, capsys):
    arguments = ["build", "gym:nichechain-test/Machine-v0", "--descriptor", "final-observation:0,1"]
    arguments += ["--controller", "mlp:4", "--evaluations", "40", "--initial", "20", "--bounds=-9,9,-9,9"]
    assert main([*arguments, "--grid", "4x4", "--out", str(tmp_path / "pure")]) == 0
    assert "something random" not in capsys.readouterr().err
    leaking = [*arguments, "--grid", "4x4", "--options", "env.leak=true", "--out", str(tmp_path / "leaking")]
    assert main(leaking) == 0
    assert "has something random that its seed does not fix: a genotype" in capsys.readouterr().err
