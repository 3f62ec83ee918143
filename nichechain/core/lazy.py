"""Names of a package that are imported when they are first used."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any


def lazily(package: str, **homes: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """What a package's ``__getattr__`` and ``__dir__`` are, so that importing it costs nothing.

    Parameters
    ----------
    package : str
    **homes
        Names, with spaces between them, by the module of the package that they are in. A module is in itself.

    Returns
    -------
    two callables
    """
    modules = {
        name: f"{package}.{home.replace('__', '.')}"
        for home, names in homes.items()
        for name in names.split()
    }

    def getattribute(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = importlib.import_module(modules[name])
        return home if modules[name] == f"{package}.{name}" else getattr(home, name)

    return getattribute, lambda: list(modules)
