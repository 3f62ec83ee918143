"""Rows of the tables of bad input: a public function, arguments that it takes, values that it refuses."""

from __future__ import annotations

import importlib
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

from nichechain import NichechainError

World = SimpleNamespace
"""What the fixture ``world`` gives: small objects of every kind."""


@dataclass(frozen=True)
class Call:
    """A public function, or a method as ``Class.method`` with ``self`` among its arguments.

    Parameters
    ----------
    name : str
        As it is imported, without ``nichechain.``.
    good : callable
        Makes arguments that are accepted.
    bad : mapping
        For each parameter the values that must be refused: plain ones, or callables of the world.
    """

    name: str
    good: Callable[[World], dict[str, Any]]
    bad: Mapping[str, Sequence[Any]] = field(default_factory=dict)

    @property
    def function(self) -> Callable[..., Any]:
        return resolved(self.name)


class Made:
    """A bad value that is made of the world, with a name for the test."""

    def __init__(self, make: Callable[[World], Any], name: str) -> None:
        self.make, self.name = make, name

    def __repr__(self) -> str:
        return self.name


def resolved(name: str) -> Callable[..., Any]:
    """``chain.wormholes.wormholes`` as the function."""
    found: Any = importlib.import_module("nichechain")
    path = "nichechain"
    *places, last = name.split(".")
    for part in places:
        path += f".{part}"
        try:
            # A function may bear the name of its module, and classes are places too.
            found = importlib.import_module(path)
        except ImportError:
            found = getattr(found, part)
    return getattr(found, last)  # type: ignore[no-any-return]


# Values of the wrong kind, by what a parameter must be.
NOT_WHOLE = (1.5, "three", math.nan)
NOT_A_NUMBER = ("three", math.nan)
SEED = (-1, *NOT_WHOLE)
UNKNOWN = ("no-such-thing", 3)
RAGGED = ([[1.0, 2.0], [3.0]], "three")


def whole(below: int) -> tuple[Any, ...]:
    """What a whole number of at least ``below + 1`` must not be."""
    return (below, -7, *NOT_WHOLE)


POSITIVE = (0.0, -1.0, math.inf, *NOT_A_NUMBER)
SHARE = (-0.1, 1.1, *NOT_A_NUMBER)

# Parameters of several functions that mean the same everywhere.
LINEAGES: dict[str, Sequence[Any]] = {
    "l": whole(0),
    "lineages": whole(0),
    "seed": SEED,
}


def rows(*calls: Call) -> list[Any]:
    """One test for each bad value of each call."""
    return [
        pytest.param(call, parameter, value, id=f"{call.name}-{parameter}-{str(value)[:30]}")
        for call in calls
        for parameter, values in call.bad.items()
        for value in values
    ]


def check_refused(call: Call, parameter: str, value: Any, world: World) -> None:
    """The value is refused by a sentence that names it, and it is the value that is refused."""
    arguments = call.good(world)
    arguments[parameter] = value.make(world) if isinstance(value, Made) else value
    with pytest.raises(NichechainError) as raised:
        call.function(**arguments)
    check_sentence(str(raised.value))
    if not isinstance(value, Made):
        assert names(str(raised.value), parameter, value), str(raised.value)


def check_sentence(message: str) -> None:
    """One line that says something, with no trace of where it came from."""
    assert message.strip() == message
    assert 10 < len(message) < 500
    assert "\n" not in message
    assert "Traceback" not in message
    assert "object at 0x" not in message


_CALLED = {
    "after": "changes",
    "before": "changes",
    "columns": "column",
    "controller": "layer sizes",
    "folders": "archive",
    "groups": "values",
    "levels": "fraction",
    "values": "run",
    "child": "(state|children)",
    "bound": "bounded",
    "bounds": "(bounds|bound|axes|centroids)",
    "counts": "offspring",
    "hidden": "activation",
    "layers": "weights_of_a_layer",
    "names": "(measure|axes|bounds)",
    "niches": "state",
    "offspring": "(behaviors|sample_size)",
    "other": "niches",
    "parent": "(state|parents)",
    "parents": "parent",
    "population": "offspring",
    "states": "(niche|lineages)",
    "target": "niche",
    "scheme": "archive",
    "shape": "axes",
    "sizes": "(layer_size|grid)",
    "transition": "T",
}
"""What a parameter goes by in messages, where that is not its name."""


def names(message: str, parameter: str, value: Any) -> bool:
    """Whether the message speaks of the parameter or shows the value."""
    shown = {str(value), repr(value)}
    if isinstance(value, float) and math.isfinite(value):
        shown.add(f"{value:g}")
    one = parameter.removesuffix("s")
    said = {parameter, one, parameter.replace("_", " "), one.replace("_", " ")} | {
        _CALLED.get(parameter, parameter)
    }
    return any(text in message for text in shown) or any(
        re.search(rf"\b{word}s?\b", message) for word in said
    )


def check_accepted(call: Call, world: World) -> None:
    """What is refused is refused for the one value that was changed."""
    call.function(**call.good(world))
