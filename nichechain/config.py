"""What a build is asked to do: one dataclass, which is its command line and stays with its result."""

from __future__ import annotations

import operator
from dataclasses import MISSING, asdict, dataclass, fields
from typing import Any, Literal, get_args

from nichechain.errors import NichechainError

Replacement = Literal["random", "first", "newest", "objective"]
Outside = Literal["state", "absorb", "clip"]
MutationName = Literal["cauchy", "gaussian", "student-t", "uniform-ball"]


@dataclass(frozen=True)
class BuildConfig:
    """A MAP-Elites build ("Variation operator"; step 3 of the estimation of l-evolvability).

    Parameters
    ----------
    domain : str
        Name of the domain.
    domain_seed : int
        Seed of what the domain holds fixed, such as the block's place.
    evaluations : int
        Births in total, the initial ones among them.
    shape : tuple of int
        Cells of the grid along each axis of behavior.
    bounds : tuple of (float, float)
        Bounds of the grid, in units of behavior.
    outside : {"state", "absorb", "clip"}
        What a behavior out of bounds belongs to, see :class:`nichechain.niches.GridNiches`.
    initial : int
        Births without a parent.
    batch : int
        Children of a step; their parents are drawn from the elites before it.
    mutation : {"cauchy", "gaussian", "student-t", "uniform-ball"}
        Mutation operator.
    scale : float
        Its scale.
    replacement : {"random", "first", "newest", "objective"}
        Which of the births of a niche is its elite: each alike, the first, the last, or the one
        with the largest objective.
    seed : int
        Seed of the run.

    Raises
    ------
    NichechainError
        If a value is out of range.
    """

    domain: str
    shape: tuple[int, ...]
    bounds: tuple[tuple[float, float], ...]
    domain_seed: int = 0
    evaluations: int = 8000
    outside: Outside = "state"
    initial: int = 100
    batch: int = 64
    mutation: MutationName = "cauchy"
    scale: float = 1.0
    replacement: Replacement = "random"
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("evaluations", "initial", "batch", "seed", "domain_seed"):
            try:
                # Numbers of NumPy become plain ones, which JSON can hold.
                object.__setattr__(self, name, operator.index(getattr(self, name)))
            except TypeError:
                raise NichechainError(
                    f"{name} is {getattr(self, name)!r}, but must be a whole number"
                ) from None
        object.__setattr__(self, "shape", tuple(int(cells) for cells in self.shape))
        object.__setattr__(self, "bounds", tuple((float(low), float(high)) for low, high in self.bounds))
        object.__setattr__(self, "scale", float(self.scale))
        for name in ("evaluations", "initial", "batch"):
            if getattr(self, name) < 1:
                raise NichechainError(f"{name} is {getattr(self, name)}, but must be at least 1")
        for name in ("seed", "domain_seed"):
            if getattr(self, name) < 0:
                raise NichechainError(f"{name} is {getattr(self, name)}, but must not be negative")
        if self.replacement not in get_args(Replacement):
            raise NichechainError(
                f"replacement is {self.replacement!r}, but must be one of {', '.join(get_args(Replacement))}"
            )

    def to_json(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> BuildConfig:
        """The configuration that :meth:`to_json` wrote, now or in an earlier version.

        Raises
        ------
        NichechainError
            If a value is unknown, or one is missing that has no default.
        """
        names = {field.name for field in fields(cls)}
        needed = {field.name for field in fields(cls) if field.default is MISSING}
        odd = (set(values) - names) | (needed - set(values))
        if odd:
            raise NichechainError(
                f"the configuration has missing or unknown values: {', '.join(sorted(odd))}"
            )
        return cls(**values)
