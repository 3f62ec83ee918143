"""Self-adaptive mutation: step sizes that are genes, inherited and mutated with the weights.

A genotype is the weights followed by the logarithms of the step sizes. Only the weights are
evaluated, so a step size is selected by what became of the children it made.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import as_tuple, check_positive, check_whole
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Domain, Evaluation, Wrapper, check_genotypes
from nichechain.variation.additive import Bound, Genotype, add_noise, check_bound
from nichechain.variation.noise import MutationNoise

if TYPE_CHECKING:
    from torch import nn


@dataclass(frozen=True)
class SelfAdaptiveMutation:
    """Mutates the step sizes, then the weights with the new ones.

    Parameters
    ----------
    noise : MutationNoise
        What is added to the weights at step size 1.
    layers : tuple of int
        Weights that share a step size, in the order of the genotype; one entry for one step size.
    bound : Bound, optional
        On the step of the weights.

    Notes
    -----
    σ′ = σ·exp(τ·N(0, 1)) with τ = 1/√n for the n weights that share σ: the log-normal rule of
    evolution strategies with one step size (Beyer and Schwefel 2002, Natural Computing 1:3-52).
    Without selection ln σ has no drift, so σ keeps its median.
    """

    noise: MutationNoise
    layers: tuple[int, ...]
    bound: Bound | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "layers", as_tuple("layers", self.layers))
        for weights in self.layers:
            check_whole(weights_of_a_layer=weights)
        if not self.layers or min(self.layers) < 1:
            raise NichechainError(f"layers are {self.layers}, but each has at least 1 weight")
        check_bound(self.noise, self.bound)

    def __call__(self, parent: Genotype, rng: np.random.Generator) -> Genotype:
        """One child of a parent, (weights + step sizes,)."""
        weights = sum(self.layers)
        if parent.size != weights + len(self.layers):
            raise NichechainError(
                f"genotype has length {parent.size}, but {weights} weights and "
                f"{len(self.layers)} step sizes make {weights + len(self.layers)}"
            )
        rates = 1.0 / np.sqrt(self.layers)
        log_steps = parent[weights:] + rates * rng.standard_normal(len(self.layers))
        child = np.empty_like(parent)
        child[weights:] = log_steps
        scale = np.repeat(np.exp(log_steps), self.layers)
        child[:weights] = add_noise(parent[:weights], rng, self.noise, scale, self.bound)
        return child


class SelfAdaptiveDomain(Wrapper):
    """A domain whose genotypes carry step sizes behind the weights; it evaluates the weights.

    Parameters
    ----------
    domain : Domain
        What the weights are for.
    step_sizes : tuple of float
        Step sizes of the initial genotypes, positive.
    """

    def __init__(self, domain: Domain, step_sizes: tuple[float, ...]) -> None:
        step_sizes = as_tuple("step_sizes", step_sizes)
        if not step_sizes:
            raise NichechainError("step_sizes is empty, but there must be one for each layer, or one for all")
        for size in step_sizes:
            check_positive(step_size=size)
        super().__init__(domain)
        self.step_sizes = step_sizes

    def __repr__(self) -> str:
        return f"SelfAdaptiveDomain({self.domain!r}, {len(self.step_sizes)} step sizes)"

    @property
    def genotype_length(self) -> int:
        """Weights and step sizes."""
        return self.domain.genotype_length + len(self.step_sizes)

    def sample(self, n: int, *, seed: int | np.random.Generator) -> NDArray[np.float32]:
        """Initial genotypes, (n, genotype_length), all with the initial step sizes."""
        weights = self.domain.sample(n, seed=seed)
        steps = np.log(np.asarray(self.step_sizes)).astype(np.float32)
        return np.concatenate([weights, np.broadcast_to(steps, (n, steps.size))], axis=1)

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        """Behavior of the weights of each of N genotypes (N, genotype_length)."""
        rows = check_genotypes(genotypes, self.genotype_length)
        return self.domain.evaluate(rows[:, : self.domain.genotype_length])

    def controller(self, genotype: ArrayLike) -> nn.Module:
        """The weights of a genotype as something to use outside nichechain."""
        return self.domain.controller(np.asarray(genotype)[: self.domain.genotype_length])

    def step_sizes_of(self, genotypes: ArrayLike) -> NDArray[np.float64]:
        """Step sizes that each of N genotypes carries, (N, step sizes)."""
        rows = check_genotypes(genotypes, self.genotype_length)
        return np.exp(rows[:, self.domain.genotype_length :].astype(np.float64))
