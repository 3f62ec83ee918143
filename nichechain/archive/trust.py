"""What an archive may have imported: nothing that it names itself, unless its user says so."""

from __future__ import annotations

import os
from pathlib import Path

from nichechain.core.errors import ArchiveError
from nichechain.search.config import BuildConfig

VARIABLE = "NICHECHAIN_TRUSTED_MODULES"
"""Environment variable: modules, with commas, that archives may have imported."""


def modules(config: BuildConfig) -> tuple[str, ...]:
    """Modules that making the domain of a configuration would import by a name in it."""
    found = []
    kind, _, rest = config.domain.partition(":")
    if kind == "gym" and ":" in rest:
        # Gymnasium imports what stands before the last colon of an environment's id.
        found.append(rest.rpartition(":")[0])
    descriptor = config.domain_options.get("descriptor")
    if isinstance(descriptor, str) and ":" in descriptor:
        from nichechain.domains.descriptors import Imported, named

        if isinstance(named(descriptor)[0], Imported):
            found.append(descriptor.partition(":")[0])
    return tuple(found)


def check_trusted(config: BuildConfig, folder: Path) -> None:
    """Refuse to import for an archive what its metadata name: anybody may have written them.

    Raises
    ------
    ArchiveError
        If making its domain would import a module that is not trusted.
    """
    trusted = {name.strip() for name in os.environ.get(VARIABLE, "").split(",")}
    for module in modules(config):
        if module not in trusted:
            raise ArchiveError(
                f"{folder} asks to import {module!r}: if you trust it, set {VARIABLE}={module} or give "
                "load() the domain"
            )
