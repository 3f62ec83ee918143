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
    message = str(raised.value)
    check_sentence(message)
    if not isinstance(value, Made):
        assert names(message, parameter), f"{parameter} is not named: {message}"
        assert _ALLOWED.search(message), f"nothing is said of what is allowed: {message}"


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
    "batch": "batches",
    "count": "archive_count",
    "env_id": "environment",
    "env_options": "environment",
    "flat": "niche",
    "high": "genes",
    "level": "fraction",
    "levels": "fraction",
    "limit": "archive_limit",
    "low": "genes",
    "min_births": "births",
    "most": "max_failed",
    "name": "(mutation|metric|domain|measure|study)",
    "number": "niche",
    "output": "activation",
    "path": "(file|folder|archive)",
    "probability": "archive_probability",
    "size": "(step_bound|elites)",
    "state": "niche",
    "text": "(shape|noise|niche|bound|step_bound|layer_scale)",
    "values": "run",
    "child": "(state|children)",
    "bound": "bounded",
    "bounds": "(bounds|bound|axes|centroids)",
    "counts": "offspring",
    "hidden": "activation",
    "layers": "weights_of_a_layer",
    "names": "(measure|axes|bounds)",
    "niche": "state",
    "niches": "state",
    "offspring": "(behaviors|sample_size)",
    "other": "niches",
    "parent": "(state|parents)",
    "parents": "parent",
    "population": "offspring",
    "source": "(source|niche)",
    "states": "(niche|lineages)",
    "target": "niche",
    "root": "(root|niche)",
    "scheme": "(archive|initialisation)",
    "shape": "axes",
    "sizes": "(layer_size|grid|shape)",
    "trajectories": "(trajectories|state)",
    "transition": "T",
}
"""What a parameter goes by in messages, where that is not its name."""


_ALLOWED = re.compile(
    r"\b(must|at least|at most|between|only|needs?|needed|such as|there is no|cannot"
    # A range, or how many there are.
    r"|-?\d+ to -?\d+|runs? from|has \(?\d+|have \d+: one|its? \w+ is|numbered from"
    # Of what kind values are not, and to what else a parameter belongs.
    r"|that are (no|not|negative)|which|belongs? to|nothing|no spread|neither|are missing"
    r"|has no|it has|the last is|up to|one to \d+|but \d+ axes|one scale per"
    r"|not finite|either|differ|not negative|would be empty|have an elite)\b"
)
"""Words that say what would do instead."""


def names(message: str, parameter: str) -> bool:
    """Whether the message speaks of the parameter: by its name, or by what it goes by."""
    said = {parameter, parameter.removesuffix("s")}
    words = said | {word.replace("_", " ") for word in said} | {_CALLED.get(parameter, parameter)}
    return any(re.search(rf"\b{word}s?\b", message) for word in words)


def check_accepted(call: Call, world: World) -> None:
    """What is refused is refused for the one value that was changed."""
    call.function(**call.good(world))
