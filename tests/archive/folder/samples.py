"""Archives to break, and ways of breaking them."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import nichechain
from nichechain.archive.archive import load
from nichechain.archive.building import build
from nichechain.execution import Threads
from nichechain.search.config import BuildConfig

CONFIG = BuildConfig(
    "arm", (9, 7), ((-0.7, 1.0), (-0.9, 0.8)), evaluations=450, initial=100, batch=64, scale=0.3, seed=5
)
ROOT = Path(nichechain.__file__).parents[1]


def content(folder: Path) -> dict[str, bytes]:
    """Every file of a folder but those of the lock."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in (".lock", ".owner")
    }


def built(folder: Path, config: BuildConfig = CONFIG) -> dict[str, bytes]:
    with Threads(1) as executor:
        build(config, folder, executor)
    return content(folder)


def written(folder: Path, files: dict[str, bytes]) -> Path:
    """A folder with these files."""
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    return folder


def read_all(folder: Path) -> None:
    archive = load(folder)
    archive.births()


def edited(files: dict[str, bytes], edit: Callable[[dict[str, Any]], None]) -> dict[str, bytes]:
    """The files with other metadata, as somebody who wants to be believed would write it."""
    meta = json.loads(files["meta.json"])
    own = meta.pop("sha256", None)
    edit(meta)
    if own is not None:
        meta["sha256"] = hashlib.sha256(json.dumps(meta, indent=2).encode()).hexdigest()
    return {**files, "meta.json": json.dumps(meta, indent=2).encode()}


def forged(files: dict[str, bytes], name: str, data: bytes) -> dict[str, bytes]:
    """The files with other content under one name, its checksum right."""

    def edit(meta: dict[str, Any]) -> None:
        for entry in (meta["elites"], *meta["parts"]):
            if entry["file"] == name:
                entry["sha256"] = hashlib.sha256(data).hexdigest()

    return edited({**files, name: data}, edit)


def elites_name(files: dict[str, bytes]) -> str:
    return next(name for name in files if name.startswith("elites-"))


def part_names(files: dict[str, bytes]) -> list[str]:
    return sorted(name for name in files if name.startswith("births/"))


def flipped(data: bytes, position: int) -> bytes:
    return data[:position] + bytes([data[position] ^ 1]) + data[position + 1 :]


def npz(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def npy(array: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()
