"""What a domain is: a behavior function φ over genotypes, pure and batched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.errors import NichechainError
from nichechain.domains.shown import ShownDomain

if TYPE_CHECKING:
    from torch import nn

Floats = NDArray[np.float64]
Float32s = NDArray[np.float32]


@dataclass(frozen=True)
class Evaluation:
    """What became of N genotypes.

    Parameters
    ----------
    behavior : (N, B) float64 or float32 array
        NaN in the rows that failed. Bounds of niches are compared in the precision that it has.
    objective : (N,) float64 array
        Larger is better; NaN in the rows that failed.
    failed : (N,) bool array
    reasons : tuple of str
        Why each row failed; empty where it did not.
    spread : (N, B) float64 array, optional
        Standard deviation of behavior over the repeats of an evaluation, where a domain repeats
        them; NaN in the rows that failed.
    steps, known : int
        Steps of the episodes behind it, and how many of them were known from earlier episodes, where
        a domain keeps count. What was known depends on what was evaluated before; the rows do not.
    """

    behavior: Floats
    objective: Floats
    failed: NDArray[np.bool_]
    reasons: tuple[str, ...]
    spread: Floats | None = None
    steps: int = 0
    known: int = 0

    def __len__(self) -> int:
        return len(self.objective)

    def take(self, rows: NDArray[np.int64]) -> Evaluation:
        """The rows in another order."""
        return replace(
            self,
            behavior=self.behavior[rows],
            objective=self.objective[rows],
            failed=self.failed[rows],
            reasons=tuple(self.reasons[row] for row in rows.tolist()),
            spread=None if self.spread is None else self.spread[rows],
        )

    @staticmethod
    def concatenate(parts: Sequence[Evaluation]) -> Evaluation:
        """The rows of several evaluations, in order."""
        spread = None
        if any(part.spread is not None for part in parts):
            # A row that was given up without an evaluation has none.
            spread = np.concatenate(
                [np.full_like(p.behavior, np.nan) if p.spread is None else p.spread for p in parts]
            )
        behavior = np.concatenate([part.behavior for part in parts])
        if len({part.behavior.dtype for part in parts}) > 1:
            # Rows that failed have no precision of their own.
            told = {part.behavior.dtype for part in parts if not part.failed.all()}
            if len(told) == 1:
                behavior = behavior.astype(told.pop())
        return Evaluation(
            behavior,
            np.concatenate([part.objective for part in parts]),
            np.concatenate([part.failed for part in parts]),
            tuple(reason for part in parts for reason in part.reasons),
            spread,
            sum(part.steps for part in parts),
            sum(part.known for part in parts),
        )


@runtime_checkable
class Domain(Protocol):
    """A behavior function with what a search needs to know of it.

    ``evaluate`` is pure: the same genotype gives the same bits, whatever else is in the batch and
    however many threads call it at once.
    """

    @property
    def name(self) -> str:
        """Name on the command line."""
        ...

    @property
    def seed(self) -> int:
        """Seed of what the domain holds fixed."""
        ...

    @property
    def genotype_length(self) -> int:
        """Number of evolved parameters."""
        ...

    @property
    def behavior_names(self) -> tuple[str, ...]:
        """One name per axis of behavior."""
        ...

    @property
    def unit(self) -> str:
        """Unit of behavior, such as m."""
        ...

    @property
    def objective_name(self) -> str:
        """What the objective is, with its unit."""
        ...

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]:
        """Default bounds of a grid over behavior."""
        ...

    @property
    def chunk(self) -> int:
        """Genotypes worth handing to a worker at once."""
        ...

    @property
    def start(self) -> Floats | None:
        """Behavior of doing nothing (B,), where there is such a thing: marked in figures."""
        ...

    def sample(self, n: int, *, seed: int | np.random.Generator) -> Float32s:
        """Initial genotypes, (n, genotype_length); the first k of n are ``sample(k, seed=seed)``."""
        ...

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        """Behavior of each of N genotypes (N, genotype_length)."""
        ...

    def controller(self, genotype: ArrayLike) -> nn.Module:
        """The genotype as something to use outside nichechain."""
        ...


def check_genotypes(genotypes: ArrayLike, length: int) -> Float32s:
    """Genotypes as a float32 array (N, length).

    Raises
    ------
    NichechainError
        If the shape does not fit.
    """
    try:
        array = np.ascontiguousarray(genotypes, np.float32)
    except (TypeError, ValueError):
        raise NichechainError(
            "genotypes have values that are no numbers, or rows of unequal length"
        ) from None
    if array.ndim != 2 or array.shape[1] != length:
        raise NichechainError(f"genotypes have shape {array.shape}, but must be (N, {length})")
    return array


class Wrapper(ShownDomain):
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
