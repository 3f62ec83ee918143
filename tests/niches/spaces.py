"""Planar arms whose behavior has one, two or three axes, and archives of them."""

import numpy as np

import nichechain as nc
from nichechain.domains import Evaluation, PlanarArm


class ArmOfAxes(PlanarArm):
    """The hand's x, its x and y, or also where the elbow in the middle is."""

    def __init__(self, axes, *, seed=0):
        super().__init__(6, seed=seed)
        self.behavior_names = ("x", "y", "elbow")[:axes]
        self.bounds = ((-1.0, 1.0), (-1.0, 1.0), (-0.5, 0.5))[:axes]

    @property
    def start(self):
        return np.array([1.0, 0.0, 0.0])[: len(self.bounds)]

    def evaluate(self, genotypes):
        angles = np.asarray(genotypes, float)
        plain = super().evaluate(angles)
        elbow = np.sin(np.cumsum(angles[:, :3], axis=1)).sum(axis=1, keepdims=True) / 6.0
        behavior = np.hstack([plain.behavior, elbow])[:, : len(self.bounds)]
        return Evaluation(behavior, plain.objective, plain.failed, plain.reasons)


def config(axes, **values):
    """A quick build over some axes."""
    narrow = ((-0.6, 1.1), (-0.8, 0.8), (-0.4, 0.4))[:axes]
    quick = {"evaluations": 900, "scale": 0.3, "batch": 50}
    return nc.BuildConfig("arm", bounds=narrow, **(quick | values))


def build(folder, asked):
    """The archive of a configuration."""
    domain = ArmOfAxes(len(asked.bounds))
    with nc.Threads(1) as threads:
        nc.build(asked, folder, threads, domain=domain)
    return nc.load(folder, domain=domain)
