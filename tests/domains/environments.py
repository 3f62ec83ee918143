"""Environments of Gymnasium as domains, small ones, and policies to walk about in them."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from nichechain.domains import GymDomain

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


def policies(domain, n=5, seed=1):
    rng = np.random.default_rng(seed)
    genotypes = domain.sample(n, seed=seed)
    return (genotypes + 0.3 * rng.standard_normal(genotypes.shape)).astype(np.float32)
