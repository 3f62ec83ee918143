"""Gymnasium spaces and numbers: observations as flat arrays, a network's outputs as actions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class _Part:
    """One piece of an observation: an array, or the number of a class as one-hot."""

    size: int
    classes: bool
    first: int = 0

    def read(self, value: Any) -> Floats:
        if not self.classes:
            return np.asarray(value, np.float64).ravel()
        flat = np.zeros(self.size)
        flat[int(value) - self.first] = 1.0
        return flat


@dataclass(frozen=True)
class Observations:
    """How to read an observation.

    Parameters
    ----------
    keys : tuple of str
        Of a Dict space, in order; empty for any other.
    parts : tuple
        One for each key, or one.
    low, high : (inputs,) arrays
        Bounds of each number.
    """

    keys: tuple[str, ...]
    parts: tuple[_Part, ...]
    low: Floats
    high: Floats

    @classmethod
    def of(cls, space: Any, keys: Sequence[str] = ()) -> Observations:
        """How to read the observations of a space.

        Parameters
        ----------
        space : gymnasium.Space
            Box, Discrete or MultiBinary, or a Dict of them.
        keys : sequence of str
            Of a Dict space, which to read; by default ``observation`` if there is one (a task's
            goals, which never change here, are left out), or else all.

        Raises
        ------
        NichechainError
            If the space is of another kind, or has no such key.
        """
        from gymnasium import spaces

        if not isinstance(space, spaces.Dict):
            if keys:
                raise NichechainError(f"observations are {space}, which has no keys to choose from")
            part, low, high = _part(space, "observations are")
            return cls((), (part,), low, high)
        chosen = tuple(keys) or (("observation",) if "observation" in space.spaces else tuple(space.spaces))
        for key in chosen:
            if key not in space.spaces:
                raise NichechainError(
                    f"observations have no key {key!r}: they have {', '.join(space.spaces)}"
                )
        read = [_part(space.spaces[key], f"observation {key!r} is") for key in chosen]
        return cls(
            chosen,
            tuple(part for part, _, _ in read),
            np.concatenate([low for _, low, _ in read]),
            np.concatenate([high for _, _, high in read]),
        )

    @property
    def inputs(self) -> int:
        """Length of a flat observation."""
        return sum(part.size for part in self.parts)

    def flat(self, observation: Any) -> Floats:
        """An observation as (inputs,) float64, always a new array."""
        values = [observation[key] for key in self.keys] if self.keys else [observation]
        return np.concatenate([part.read(value) for part, value in zip(self.parts, values, strict=True)])


class Actions(Protocol):
    """How to act."""

    @property
    def outputs(self) -> int:
        """Numbers that a network gives."""
        ...

    @property
    def activation(self) -> str:
        """Activation of its last layer."""
        ...

    def action(self, output: NDArray[np.float32]) -> Any:
        """The action that a network's output (outputs,) stands for."""
        ...


@dataclass(frozen=True)
class BoxActions:
    """Continuous actions: -1 is the lower bound of each number, 1 the upper one.

    Parameters
    ----------
    low, high : arrays
        Bounds, finite.
    dtype : numpy.dtype
    """

    low: Floats
    high: Floats
    dtype: Any
    activation = "tanh"

    @property
    def outputs(self) -> int:
        """One for each number of an action."""
        return self.low.size

    def action(self, output: NDArray[np.float32]) -> NDArray[Any]:
        """The action, within its bounds."""
        share = np.clip(output.astype(np.float64), -1.0, 1.0).reshape(self.low.shape)
        # Written so that bounds of -1 and 1 leave an output as it is.
        value = 0.5 * (self.low + self.high) + share * (0.5 * (self.high - self.low))
        return np.clip(value, self.low, self.high).astype(self.dtype)


@dataclass(frozen=True)
class DiscreteActions:
    """One of several actions: that of the largest output, the first of equals.

    Parameters
    ----------
    n : int
    first : int
        Number of the first action.
    """

    n: int
    first: int = 0
    activation = "identity"

    @property
    def outputs(self) -> int:
        """One for each action."""
        return self.n

    def action(self, output: NDArray[np.float32]) -> int:
        """The number of the action."""
        return self.first + int(np.argmax(output))


def actions_of(space: Any) -> Actions:
    """How to act in a space.

    Parameters
    ----------
    space : gymnasium.Space
        A bounded Box of floating-point numbers, or Discrete.

    Raises
    ------
    NichechainError
        If it is of another kind.
    """
    from gymnasium import spaces

    if isinstance(space, spaces.Discrete):
        return DiscreteActions(int(space.n), int(space.start))
    if isinstance(space, spaces.Box) and np.issubdtype(space.dtype, np.floating):
        if not (np.isfinite(space.low).all() and np.isfinite(space.high).all()):
            raise NichechainError(f"actions are {space}, but must be bounded: wrap the environment")
        return BoxActions(space.low.astype(np.float64), space.high.astype(np.float64), space.dtype)
    raise NichechainError(f"actions are {space}, but must be a Box of floating-point numbers, or Discrete")


def _part(space: Any, what: str) -> tuple[_Part, Floats, Floats]:
    from gymnasium import spaces

    if isinstance(space, spaces.Box):
        return (
            _Part(int(np.prod(space.shape)), classes=False),
            space.low.astype(np.float64).ravel(),
            space.high.astype(np.float64).ravel(),
        )
    if isinstance(space, spaces.Discrete):
        n = int(space.n)
        return _Part(n, classes=True, first=int(space.start)), np.zeros(n), np.ones(n)
    if isinstance(space, spaces.MultiBinary):
        size = int(np.prod(space.shape))
        return _Part(size, classes=False), np.zeros(size), np.ones(size)
    raise NichechainError(f"{what} {space}, but must be Box, Discrete or MultiBinary, or a Dict of them")
