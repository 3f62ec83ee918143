"""A domain around another: what it does not change is the other's."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.domains.base import Domain, Evaluation

if TYPE_CHECKING:
    from torch import nn


class Wrapper:
    """Passes everything on to a domain.

    Parameters
    ----------
    domain : Domain
    """

    def __init__(self, domain: Domain) -> None:
        self.domain = domain

    @property
    def name(self) -> str:
        """Name on the command line."""
        return self.domain.name

    @property
    def seed(self) -> int:
        """Seed of what the domain holds fixed."""
        return self.domain.seed

    @property
    def genotype_length(self) -> int:
        """Number of evolved parameters."""
        return self.domain.genotype_length

    @property
    def network(self) -> Any:
        """The policy, where the domain has one."""
        return self.domain.network  # type: ignore[attr-defined]  # or else an AttributeError, as of the domain

    @property
    def behavior_names(self) -> tuple[str, ...]:
        """One name per axis of behavior."""
        return self.domain.behavior_names

    @property
    def unit(self) -> str:
        """Unit of behavior."""
        return self.domain.unit

    @property
    def objective_name(self) -> str:
        """What the objective is."""
        return self.domain.objective_name

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """Default bounds of a grid over behavior."""
        return self.domain.bounds

    @property
    def chunk(self) -> int:
        """Genotypes worth handing to a worker at once."""
        return self.domain.chunk

    @property
    def start(self) -> NDArray[np.float64] | None:
        """Behavior of doing nothing."""
        return self.domain.start

    def sample(self, n: int, *, seed: int | np.random.Generator) -> NDArray[np.float32]:
        """Initial genotypes."""
        return self.domain.sample(n, seed=seed)

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        """Behavior of each genotype."""
        return self.domain.evaluate(genotypes)

    def controller(self, genotype: ArrayLike) -> nn.Module:
        """The genotype as something to use outside nichechain."""
        return self.domain.controller(genotype)
