"""Closed-form maps from two genes to one number, in which evolvability can be seen at a glance."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import check_sample, check_seed, rng_of
from nichechain.domains.base import Evaluation, check_genotypes
from nichechain.domains.noise import Noise, check_seeds
from nichechain.domains.shown import ShownDomain

if TYPE_CHECKING:
    from torch import nn

Floats = NDArray[np.float64]

LOW, HIGH = -5.0, 5.0


class ToyMap(ShownDomain):
    """A map from the genome (g0, g1) in [-5, 5]² to a behavior in [-5, 5].

    A genome outside of the square is read as the nearest in it, so that any mutation operator may
    be used; :class:`nichechain.variation.polynomial.PolynomialMutation`, that of the study, stays inside.

    Parameters
    ----------
    seed : int
        Of noise, where there is some; the map itself has nothing random.

    Notes
    -----
    Source: S. Doncieux, G. Paolo, A. Laflaquière and A. Coninx, Novelty search makes evolvability
    inevitable, GECCO 2020. The objective is theirs: minus the distance of behavior to -4.
    """

    name: ClassVar[str]
    behavior_names = ("b",)
    unit = "units"
    objective_name = "minus the distance of behavior to -4 (units)"
    bounds = ((LOW, HIGH),)
    chunk = 65_536
    genotype_length = 2
    start: Floats | None = None

    def __init__(self, *, seed: int = 0) -> None:
        check_seed(seed)
        self.seed = int(seed)

    def __repr__(self) -> str:
        return f"{type(self).__name__}(seed={self.seed})"

    def behavior(self, genome: Floats) -> Floats:
        """Behavior (N,) of genomes (N, 2) within the square."""
        raise NotImplementedError

    def sample(self, n: int, *, seed: int | np.random.Generator) -> NDArray[np.float32]:
        """Genomes uniform in [-0.5, 0.5]², as in the study, (n, 2)."""
        n = check_sample(n, 2)
        return rng_of(seed).uniform(-0.5, 0.5, (n, 2)).astype(np.float32)

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        """Behavior of each genome (N, 2)."""
        return self._evaluate(check_genotypes(genotypes, 2).astype(np.float64))

    def evaluate_noisy(self, genotypes: ArrayLike, noise: Noise, seeds: ArrayLike) -> Evaluation:
        """Behavior of each genome (N, 2), its genes disturbed by ``noise.action``.

        Raises
        ------
        NichechainError
            If a shape does not fit, or there is noise of another kind.
        """
        noise.only("action", domain=self.name)
        rows = check_genotypes(genotypes, 2)
        drawn = [np.random.default_rng(int(s)).standard_normal(2) for s in check_seeds(seeds, rows)]
        return self._evaluate(rows + noise.action * np.reshape(drawn, (-1, 2)))

    def controller(self, genotype: ArrayLike) -> nn.Module:  # noqa: ARG002
        """A map has no controller.

        Raises
        ------
        TypeError
            Always.
        """
        raise TypeError(f"{self.name} has two genes, not a controller")

    def _evaluate(self, genome: Floats) -> Evaluation:
        failed: NDArray[np.bool_] = np.logical_not(np.isfinite(genome).all(axis=1))
        behavior = self.behavior(np.clip(np.where(failed[:, None], 0.0, genome), LOW, HIGH))
        behavior[failed] = np.nan
        reasons = ("",) * len(failed)
        if failed.any():
            reasons = tuple("genotype is not finite" if bad else "" for bad in failed)
        return Evaluation(behavior[:, None], -np.abs(behavior + 4.0), failed, reasons)


class LinearMap(ToyMap):
    """b = g0: every genome is as evolvable as any other, but for the border."""

    name = "linear"

    def behavior(self, genome: Floats) -> Floats:
        """Behavior (N,) of genomes (N, 2) within the square."""
        return genome[:, 0].copy()


class CosinusMap(ToyMap):
    """b = 5·cos(π/2 + 2π·g0/(11 − 1.8·g1)): the larger g1, the more a step in g0 does."""

    name = "cosinus"

    def behavior(self, genome: Floats) -> Floats:
        """Behavior (N,) of genomes (N, 2) within the square."""
        period = 11.0 - 1.8 * genome[:, 1]
        b: Floats = 5.0 * np.cos(math.pi / 2 + 2.0 * math.pi * genome[:, 0] / period)
        return b
