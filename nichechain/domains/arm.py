"""A planar arm, the small standard task of the quality-diversity community."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import check_at_least, check_sample, check_seed, rng_of
from nichechain.domains.base import Evaluation, check_genotypes
from nichechain.domains.noise import Noise, check_seeds
from nichechain.domains.shown import ShownDomain
from nichechain.domains.watching import Motion

if TYPE_CHECKING:
    from torch import nn

# A posture has no time of its own: it is reached within two seconds.
_MOMENTS, _RATE = 40, 20.0


class PlanarArm(ShownDomain):
    """An arm of equal links that sum to 1, in closed form; behavior is where its hand is.

    Parameters
    ----------
    joints : int
        Number of joints, at least 1.
    seed : int
        Of noise, where there is some; the arm itself has nothing random.

    Raises
    ------
    NichechainError
        If there is no joint.

    Notes
    -----
    A genotype holds the angle of each joint to the link before it, in radians. The objective is
    minus the variance of the angles, as in the arm repertoire of Cully et al. (2015): of two
    postures with the same hand, the smoother is better.
    """

    name = "arm"
    behavior_names = ("x", "y")
    unit = "arm lengths"
    objective_name = "minus the variance of the joint angles (rad²)"
    bounds = ((-1.0, 1.0), (-1.0, 1.0))
    chunk = 4096

    def __init__(self, joints: int = 10, *, seed: int = 0) -> None:
        check_at_least(1, joints=joints)
        check_seed(seed)
        self.genotype_length = int(joints)
        self.seed = int(seed)

    def __repr__(self) -> str:
        return f"PlanarArm(joints={self.genotype_length}, seed={self.seed})"

    @property
    def start(self) -> NDArray[np.float64]:
        """The hand of the stretched arm, (2,)."""
        return np.array([1.0, 0.0])

    def sample(self, n: int, *, seed: int | np.random.Generator) -> NDArray[np.float32]:
        """Angles uniform in [-0.1, 0.1] radians, (n, joints): a nearly stretched arm."""
        n = check_sample(n, self.genotype_length)
        rng = rng_of(seed)
        return rng.uniform(-0.1, 0.1, (n, self.genotype_length)).astype(np.float32)

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        """Position of the hand for each genotype (N, joints)."""
        return self._evaluate(check_genotypes(genotypes, self.genotype_length).astype(np.float64))

    def evaluate_noisy(self, genotypes: ArrayLike, noise: Noise, seeds: ArrayLike) -> Evaluation:
        """Position of the hand, the angle of every joint disturbed by ``noise.action`` (rad).

        Raises
        ------
        NichechainError
            If a shape does not fit, or there is noise of another kind.
        """
        noise.only("action", domain=self.name)
        rows = check_genotypes(genotypes, self.genotype_length)
        size = self.genotype_length
        drawn = [np.random.default_rng(int(s)).standard_normal(size) for s in check_seeds(seeds, rows)]
        return self._evaluate(rows + noise.action * np.reshape(drawn, (-1, size)))

    def _evaluate(self, angles: NDArray[np.float64]) -> Evaluation:
        failed: NDArray[np.bool_] = np.logical_not(np.isfinite(angles).all(axis=1))
        directions = np.cumsum(np.where(failed[:, None], 0.0, angles), axis=1)
        hand = np.stack([np.cos(directions).mean(axis=1), np.sin(directions).mean(axis=1)], axis=1)
        objective = -np.where(failed[:, None], 0.0, angles).var(axis=1)
        hand[failed] = np.nan
        objective[failed] = np.nan
        reasons = tuple("genotype is not finite" if bad else "" for bad in failed)
        return Evaluation(hand, objective, failed, reasons)

    def watch(self, genotype: ArrayLike, *, drawn: bool = True) -> Motion:  # noqa: ARG002
        """The arm from stretched to the posture of a genotype (joints,), all joints turning at once."""
        (angles,) = check_genotypes(np.asarray(genotype)[None], self.genotype_length).astype(np.float64)
        turned = np.linspace(0.0, 1.0, _MOMENTS)[:, None] * angles
        directions = np.cumsum(turned, axis=1)
        links = np.stack([np.cos(directions), np.sin(directions)], axis=2) / self.genotype_length
        joints = np.concatenate([np.zeros((_MOMENTS, 1, 2)), np.cumsum(links, axis=1)], axis=1)
        return Motion({"hand": joints[:, -1]}, joints, _RATE)

    def controller(self, genotype: ArrayLike) -> nn.Module:  # noqa: ARG002
        """An arm has no controller.

        Raises
        ------
        TypeError
            Always.
        """
        raise TypeError("a planar arm has joint angles, not a controller")
