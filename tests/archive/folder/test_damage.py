"""Whatever is damaged is named, and nothing else is believed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from nichechain.archive import read
from nichechain.archive import read as committed
from nichechain.archive.building import build
from nichechain.core.errors import ArchiveError
from nichechain.execution import Threads

from .samples import (
    CONFIG,
    content,
    edited,
    elites_name,
    flipped,
    part_names,
    read_all,
    written,
)

DAMAGES: dict[str, Callable[[bytes], bytes | None]] = {
    "first byte": lambda data: flipped(data, 0),
    "middle byte": lambda data: flipped(data, len(data) // 2),
    "last byte": lambda data: flipped(data, len(data) - 1),
    "truncated": lambda data: data[: len(data) // 2],
    "one byte short": lambda data: data[:-1],
    "one byte long": lambda data: data + b"\0",
    "empty": lambda _: b"",
    "missing": lambda _: None,
}


@pytest.mark.parametrize("kind", ["elites", "full part", "last part", "meta"])
@pytest.mark.parametrize("damage", DAMAGES)
def test_damage_is_named(kind: str, damage: str, pristine: dict[str, bytes], tmp_path: Path) -> None:
    parts = part_names(pristine)
    name = {
        "elites": elites_name(pristine),
        "full part": parts[0],
        "last part": parts[-1],
        "meta": "meta.json",
    }[kind]
    damaged = DAMAGES[damage](pristine[name])
    folder = written(tmp_path, pristine)
    if damaged is None:
        (folder / name).unlink()
    else:
        (folder / name).write_bytes(damaged)
    before = content(folder)
    with pytest.raises(ArchiveError) as caught:
        read_all(folder)
    assert Path(name).name in str(caught.value)
    assert "\n" not in str(caught.value)
    # Without metadata there is no archive to go on from, so a build would rightly begin anew.
    if (kind, damage) != ("meta", "missing"):
        with pytest.raises(ArchiveError), Threads(1) as executor:
            build(replace(CONFIG, evaluations=500), folder, executor)
        assert content(folder) == before


def test_every_byte_of_the_metadata_counts(pristine: dict[str, bytes], tmp_path: Path) -> None:
    """No flipped bit may pass for another seed, another count or a program error."""
    folder = written(tmp_path, pristine)
    data = pristine["meta.json"]
    silent = []
    for position in range(len(data)):
        (folder / "meta.json").write_bytes(flipped(data, position))
        try:
            read_all(folder)
        except ArchiveError:
            continue
        silent.append(data[max(0, position - 20) : position + 1].decode())
    assert silent == []


@pytest.mark.parametrize(
    "text",
    ["", "[]", "null", "{}", '{"format": 1}', "{", '{"format": 1, "config": 3}', "\xff", '"meta"'],
)
def test_metadata_that_is_none(text: str, pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, {**pristine, "meta.json": text.encode("latin-1")})
    with pytest.raises(ArchiveError, match=r"meta\.json is damaged"):
        read_all(folder)


@pytest.mark.parametrize(
    "edit",
    [
        lambda meta: meta.update(elites=3),
        lambda meta: meta.update(elites={"file": "elites-000000450.npz"}),
        lambda meta: meta["elites"].pop("file"),
        lambda meta: meta.update(parts=3),
        lambda meta: meta.update(parts=["births"]),
        lambda meta: meta["parts"][0].pop("sha256"),
        lambda meta: meta["parts"][0].pop("rows"),
        lambda meta: meta["parts"][0].update(rows=199),
        lambda meta: meta["config"].pop("shape"),
        lambda meta: meta["config"].update(bounds=[1, 2]),
        lambda meta: meta.pop("versions"),
        lambda meta: meta.update(births="many"),
    ],
)
def test_metadata_with_a_wrong_value(
    edit: Callable[[dict[str, Any]], None], pristine: dict[str, bytes], tmp_path: Path
) -> None:
    folder = written(tmp_path, edited(pristine, edit))
    with pytest.raises(ArchiveError):
        read_all(folder)


def test_births_that_are_not_all_there(pristine: dict[str, bytes], tmp_path: Path) -> None:
    """Metadata whose parts do not add up to its births was not written by a build."""
    folder = written(tmp_path, edited(pristine, lambda meta: meta["parts"].pop()))
    with pytest.raises(ArchiveError):
        read_all(folder)


def test_another_format_is_refused(pristine: dict[str, bytes], tmp_path: Path) -> None:
    folder = written(tmp_path, edited(pristine, lambda meta: meta.update(format=committed.FORMAT + 1)))
    with pytest.raises(ArchiveError, match="has format 2, but this version reads format 1"):
        read_all(folder)


def test_folders_that_are_no_archives(tmp_path: Path) -> None:
    with pytest.raises(ArchiveError, match="there is no such folder"):
        read.read_meta(tmp_path / "nowhere")
    with pytest.raises(ArchiveError, match=r"it has no meta\.json"):
        read.read_meta(tmp_path)
    assert not read.is_archive(tmp_path)
