"""Gymnasium spaces and numbers: observations as flat arrays, a network's outputs as actions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from nichechain.core.checks import as_tuple, check_text, shown
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class _Part:
    """One piece of an observation: an array, or the numbers of classes, each as one-hot.

    Parameters
    ----------
    path : tuple of str or int
        Keys and places that lead to it.
    low, high : (size,) arrays
    classes : (M,) array or None
        How many classes each of its numbers may be of.
    first : (M,) array or None
        The number of the first class of each.
    """

    path: tuple[str | int, ...]
    low: Floats
    high: Floats
    classes: Ints | None = None
    first: Ints | None = None

    def read(self, observation: Any) -> Floats:
        for step in self.path:
            observation = observation[step]
        if self.classes is None or self.first is None:
            return np.asarray(observation, np.float64).ravel()
        flat = np.zeros(self.low.size)
        begins = np.cumsum(self.classes) - self.classes
        flat[begins + np.asarray(observation, np.int64).ravel() - self.first] = 1.0
        return flat


@dataclass(frozen=True)
class Observations:
    """How to read an observation.

    Parameters
    ----------
    parts : tuple
        One for each array in it.
    """

    parts: tuple[_Part, ...]

    @classmethod
    def of(cls, space: Any, keys: Sequence[str] = ()) -> Observations:
        """How to read the observations of a space.

        Parameters
        ----------
        space : gymnasium.Space
            Box, Discrete, MultiDiscrete or MultiBinary, or a Dict or Tuple of such, however deep.
        keys : sequence of str
            Of a Dict space, which to read; by default ``observation`` if there is one (a task's
            goals, which never change here, are left out), or else all.

        Raises
        ------
        NichechainError
            If the space is of another kind, or has no such key.
        """
        from gymnasium import spaces

        keys = as_tuple("observations", keys)
        if not isinstance(space, spaces.Dict):
            if keys:
                raise NichechainError(f"observations are {space}, which has no keys to choose from")
            return cls(tuple(_parts(space, ())))
        chosen = keys or (("observation",) if "observation" in space.spaces else tuple(space.spaces))
        for key in chosen:
            check_text(**{"key of observations": key})
            if key not in space.spaces:
                raise NichechainError(
                    f"observations have no key {shown(key)}: they have {', '.join(space.spaces)}"
                )
        return cls(tuple(part for key in chosen for part in _parts(space.spaces[key], (key,))))

    @property
    def low(self) -> Floats:
        """Lower bound of each number, (inputs,)."""
        return np.concatenate([part.low for part in self.parts])

    @property
    def high(self) -> Floats:
        """Upper bound of each number, (inputs,)."""
        return np.concatenate([part.high for part in self.parts])

    @property
    def inputs(self) -> int:
        """Length of a flat observation."""
        return sum(part.low.size for part in self.parts)

    def flat(self, observation: Any) -> Floats:
        """An observation as (inputs,) float64, always a new array."""
        return np.concatenate([part.read(observation) for part in self.parts])


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


@dataclass(frozen=True)
class MultiDiscreteActions:
    """Several choices at once, each that of the largest of its outputs, the first of equals.

    Parameters
    ----------
    choices : array of int
        How many there are to choose from, in the shape of an action.
    first : array of int
        Number of the first of each.
    dtype : numpy.dtype
    """

    choices: Ints
    first: Ints
    dtype: Any
    activation = "identity"

    @property
    def outputs(self) -> int:
        """One for each that can be chosen."""
        return int(self.choices.sum())

    def action(self, output: NDArray[np.float32]) -> NDArray[Any]:
        """What is chosen."""
        each = np.split(output, np.cumsum(self.choices.ravel())[:-1])
        chosen = np.array([np.argmax(part) for part in each], np.int64).reshape(self.choices.shape)
        action: NDArray[Any] = (chosen + self.first).astype(self.dtype)
        return action


@dataclass(frozen=True)
class MultiBinaryActions:
    """Several switches: 1 where an output is above 0.

    Parameters
    ----------
    shape : tuple of int
    dtype : numpy.dtype
    """

    shape: tuple[int, ...]
    dtype: Any
    activation = "identity"

    @property
    def outputs(self) -> int:
        """One for each switch."""
        return math.prod(self.shape)

    def action(self, output: NDArray[np.float32]) -> NDArray[Any]:
        """Which are on."""
        return (output > 0).reshape(self.shape).astype(self.dtype)


@dataclass(frozen=True)
class SeveralActions:
    """Actions of several spaces at once, the outputs shared among them in order.

    Parameters
    ----------
    keys : tuple of str
        Of a Dict space; empty for a Tuple.
    parts : tuple of Actions
    """

    keys: tuple[str, ...]
    parts: tuple[Actions, ...]

    @property
    def outputs(self) -> int:
        """Those of all."""
        return sum(part.outputs for part in self.parts)

    @property
    def activation(self) -> str:
        """That of a Box if there is one: it leaves the order of the others' outputs as it is."""
        return "tanh" if any(part.activation == "tanh" for part in self.parts) else "identity"

    def action(self, output: NDArray[np.float32]) -> Any:
        """The actions, as a tuple or a dict."""
        ends = np.cumsum([part.outputs for part in self.parts])
        shares = np.split(output, ends[:-1])
        actions = [part.action(share) for part, share in zip(self.parts, shares, strict=True)]
        return dict(zip(self.keys, actions, strict=True)) if self.keys else tuple(actions)


def actions_of(space: Any) -> Actions:
    """How to act in a space.

    Parameters
    ----------
    space : gymnasium.Space
        A bounded Box of floating-point numbers, Discrete, MultiDiscrete or MultiBinary, or a Tuple
        or Dict of such, however deep.

    Raises
    ------
    NichechainError
        If it is of another kind.
    """
    from gymnasium import spaces

    if isinstance(space, spaces.Discrete):
        return DiscreteActions(int(space.n), int(space.start))
    if isinstance(space, spaces.MultiDiscrete):
        return MultiDiscreteActions(space.nvec.astype(np.int64), space.start.astype(np.int64), space.dtype)
    if isinstance(space, spaces.MultiBinary):
        return MultiBinaryActions(tuple(space.shape), space.dtype)
    if isinstance(space, (spaces.Tuple, spaces.Dict)) and len(space.spaces):
        inner = dict(space.spaces) if isinstance(space, spaces.Dict) else dict(enumerate(space.spaces))
        keys = tuple(space.spaces) if isinstance(space, spaces.Dict) else ()
        return SeveralActions(keys, tuple(map(actions_of, inner.values())))
    if isinstance(space, spaces.Box) and np.issubdtype(space.dtype, np.floating):
        if not (np.isfinite(space.low).all() and np.isfinite(space.high).all()):
            raise NichechainError(f"actions are {space}, but must be bounded: wrap the environment")
        return BoxActions(space.low.astype(np.float64), space.high.astype(np.float64), space.dtype)
    raise NichechainError(
        f"actions are {space}, but must be a Box of floating-point numbers, Discrete, MultiDiscrete or "
        "MultiBinary, or a Tuple or Dict of them"
    )


def stacked(actions: list[Any]) -> NDArray[Any]:
    """Actions as one array, of objects where each is a tuple or a dict."""
    if not actions or not isinstance(actions[0], (tuple, dict)):
        return np.array(actions)
    array = np.empty(len(actions), object)
    for row, action in enumerate(actions):
        array[row] = action
    return array


def _parts(space: Any, path: tuple[str | int, ...]) -> Iterator[_Part]:
    from gymnasium import spaces

    if isinstance(space, spaces.Box):
        yield _Part(path, space.low.astype(np.float64).ravel(), space.high.astype(np.float64).ravel())
    elif isinstance(space, (spaces.Discrete, spaces.MultiDiscrete)):
        number = space.n if isinstance(space, spaces.Discrete) else space.nvec
        classes = np.ravel(number).astype(np.int64)
        size = int(classes.sum())
        first = np.ravel(space.start).astype(np.int64)
        yield _Part(path, np.zeros(size), np.ones(size), classes, first)
    elif isinstance(space, spaces.MultiBinary):
        size = int(np.prod(space.shape))
        yield _Part(path, np.zeros(size), np.ones(size))
    elif isinstance(space, spaces.Dict) and len(space.spaces):
        for key, inner in space.spaces.items():
            yield from _parts(inner, (*path, key))
    elif isinstance(space, spaces.Tuple) and len(space.spaces):
        for place, inner in enumerate(space.spaces):
            yield from _parts(inner, (*path, place))
    else:
        what = f"observation {'.'.join(map(str, path))} is" if path else "observations are"
        raise NichechainError(
            f"{what} {space}, but must be Box, Discrete, MultiDiscrete or MultiBinary, or a Dict or Tuple "
            "of them"
        )
