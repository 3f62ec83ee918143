"""What a descriptor of a Gymnasium episode is told, and descriptors that need no code.

A descriptor is a function from an :class:`Episode` to a behavior: B numbers.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.niches.base import precision_of

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Episode:
    """One episode of T actions, as its descriptor sees it.

    Parameters
    ----------
    observations : (T + 1, inputs) float64 array
        What the environment observed, flat and without noise: the first is that of the reset, the
        last that after the last action.
    actions : (T, ...) array
        What the environment was given; of objects, where an action is a tuple or a dict.
    rewards : (T,) float64 array
    infos : tuple of T + 1 dict
        As ``reset`` and ``step`` returned them.
    terminated : bool
        Whether the environment ended the episode, rather than its number of steps.
    last : any
        The last observation as the environment returned it, such as a dict with ``achieved_goal``.
    env : gymnasium.Env
        The unwrapped environment in its final state, such as ``env.data`` of MuJoCo. It is the
        descriptor's for as long as it runs: read it, but keep no reference to it.
    """

    observations: Floats
    actions: NDArray[Any]
    rewards: Floats
    infos: tuple[Mapping[str, Any], ...]
    terminated: bool
    last: Any
    env: Any


Descriptor: TypeAlias = Callable[[Episode], ArrayLike]


def final_xy(episode: Episode) -> Floats:
    """Where the agent is in the end, (2,).

    The last info's ``x_position`` and ``y_position``, which MuJoCo's locomotors have, or else the
    first two numbers of ``achieved_goal``, which mazes have.

    Raises
    ------
    NichechainError
        If there is neither.
    """
    info = episode.infos[-1]
    if "x_position" in info and "y_position" in info:
        return np.array([info["x_position"], info["y_position"]], np.float64)
    if isinstance(episode.last, Mapping) and "achieved_goal" in episode.last:
        goal: Floats = np.asarray(episode.last["achieved_goal"])[:2]
        return goal
    raise NichechainError(
        "final-xy finds neither x_position and y_position in the info nor achieved_goal: "
        "take final-observation:I,J or a function of your own"
    )


@dataclass(frozen=True)
class FinalObservation:
    """Some numbers of the last observation.

    Parameters
    ----------
    columns : tuple of int
    """

    columns: tuple[int, ...]

    def __call__(self, episode: Episode) -> Floats:
        """Behavior (B,)."""
        return episode.observations[-1, list(self.columns)].astype(_precision(episode.last))


@dataclass(frozen=True)
class MeanObservation:
    """Some numbers of an observation, on average after every action.

    Parameters
    ----------
    columns : tuple of int
    """

    columns: tuple[int, ...]

    def __call__(self, episode: Episode) -> Floats:
        """Behavior (B,)."""
        mean: Floats = episode.observations[1:, list(self.columns)].mean(axis=0)
        return mean


@dataclass(frozen=True)
class FinalInfo:
    """Some values of the last info.

    Parameters
    ----------
    keys : tuple of str
    """

    keys: tuple[str, ...]

    def __call__(self, episode: Episode) -> Floats:
        """Behavior (B,)."""
        info = episode.infos[-1]
        for key in self.keys:
            if key not in info:
                raise NichechainError(f"the last info has no {key!r}: it has {', '.join(info) or 'nothing'}")
        values = np.array([info[key] for key in self.keys])
        return values if values.dtype.kind == "f" else values.astype(np.float64)


@dataclass(frozen=True)
class Imported:
    """A function by its name, imported when it is first called and not before.

    Parameters
    ----------
    text : str
        ``module:function``.
    """

    text: str

    def __call__(self, episode: Episode) -> ArrayLike:
        """Behavior (B,)."""
        return self.function()(episode)

    def function(self) -> Descriptor:
        """The function.

        Raises
        ------
        NichechainError
            If it cannot be imported.
        """
        module, _, name = self.text.partition(":")
        try:
            found: Any = importlib.import_module(module)
            for attribute in name.split("."):
                found = getattr(found, attribute)
        except (ImportError, AttributeError) as error:
            raise NichechainError(
                f"descriptor {self.text} cannot be imported: {error}; is its folder in PYTHONPATH?"
            ) from error
        if not callable(found):
            raise NichechainError(f"descriptor {self.text} is {type(found).__name__}, but must be a function")
        function: Descriptor = found
        return function


def named(text: str) -> tuple[Descriptor, tuple[str, ...] | None]:
    """The descriptor that a text stands for, and the names of its axes if they are known.

    Parameters
    ----------
    text : str
        ``final-xy``, ``final-observation:I,J``, ``mean-observation:I,J``, ``final-info:KEY,KEY``,
        or ``module:function``, of which nothing is imported yet.

    Raises
    ------
    NichechainError
        If it is of another form.
    """
    kind, _, rest = text.partition(":")
    words = tuple(word.strip() for word in rest.split(",")) if rest else ()
    if text == "final-xy":
        return final_xy, ("x", "y")
    if kind in ("final-observation", "mean-observation") and words and all(map(_is_number, words)):
        columns = tuple(map(int, words))
        names = tuple(f"observation_{column}" for column in columns)
        return (FinalObservation if kind == "final-observation" else MeanObservation)(columns), names
    if kind == "final-info" and words:
        return FinalInfo(words), words
    module, _, function = text.partition(":")
    if all(part.isidentifier() for part in (*module.split("."), *function.split("."))):
        return Imported(text), None
    raise NichechainError(
        f"descriptor is {shown(text)}, but must be final-xy, final-observation:I,J, mean-observation:I,J, "
        "final-info:KEY,KEY or MODULE:FUNCTION"
    )


def _precision(observation: Any) -> np.dtype[np.floating[Any]]:
    """The precision of an observation: of a dict or tuple, the longest of its arrays'."""
    if isinstance(observation, (Mapping, tuple)):
        parts = observation.values() if isinstance(observation, Mapping) else observation
        return max(map(_precision, parts), key=lambda kind: kind.itemsize)
    return precision_of(observation)


def _is_number(word: str) -> bool:
    return word.isdecimal() and word.isascii()
