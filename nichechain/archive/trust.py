"""What an archive may have imported: nothing that it names itself, unless its user says so."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from nichechain.core.checks import shown
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


def check_origin(origin: dict[str, Any]) -> None:
    """Refuse an account of where births come from that nobody here wrote.

    Raises
    ------
    ValueError
        If something is missing, or of another kind.
    """
    if origin["kind"] not in ("merged", "imported"):
        raise ValueError(f"it is {shown(origin['kind'])}, which this version cannot read")
    if origin["kind"] == "merged":
        for run in origin["runs"]:
            BuildConfig.from_json(run["config"])
            if not (isinstance(run["births"], int) and isinstance(run["first_uid"], int)):
                raise ValueError("it has a run whose births are not numbered")
    for name, kind in (("columns", dict), ("emitters", list)):
        if not isinstance(origin.get(name, kind()), kind):
            raise ValueError(f"its {name} are no {kind.__name__}")
    for emitter in origin.get("emitters", []):
        if not {"emitter", "parent"} <= set(emitter):
            raise ValueError("it has an emitter without a name or a parent")
