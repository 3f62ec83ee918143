"""Spaces of Gymnasium as inputs and outputs of a network: as Gymnasium flattens them."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium import spaces

from nichechain.core.errors import NichechainError
from nichechain.domains.policies.spaces import BoxActions, DiscreteActions, Observations, actions_of


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


def test_actions_span_their_bounds():
    actions = actions_of(spaces.Box(np.array([-2.0, 0.0], np.float32), np.array([2.0, 10.0], np.float32)))
    assert isinstance(actions, BoxActions)
    np.testing.assert_array_equal(actions.action(np.float32([-1, -1])), [-2, 0])
    np.testing.assert_array_equal(actions.action(np.float32([0, 0.5])), [0, 7.5])
    np.testing.assert_array_equal(actions.action(np.float32([3, -9])), [2, 0])
    assert actions.action(np.float32([0, 0])).dtype == np.float32
    assert actions_of(spaces.Discrete(3, start=-1)) == DiscreteActions(3, -1)
    assert DiscreteActions(3, -1).action(np.float32([0.5, 2, 2])) == 0
