"""Descriptors: what of an episode is its behavior."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

from nichechain.core.errors import NichechainError
from nichechain.domains import GymDomain, make

from .environments import SQUARE, lander, maze, policies, swimmer


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
