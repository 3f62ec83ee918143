"""Names that a package imports when they are first used: NumPy, SciPy and pandas take half a second."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any


def lazy(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """``__getattr__`` and ``__dir__`` of a package.

    Parameters
    ----------
    package : str
        Its full name.
    homes : mapping
        For each public name the module of the package that has it; a module itself goes by its name.
    """

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = importlib.import_module(f"{package}.{homes[name]}")
        return home if name == homes[name] else getattr(home, name)

    def names() -> list[str]:
        return sorted(homes)

    return get, names
