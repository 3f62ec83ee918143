"""An archive folder on disk: written by one build, read by all.

Layout
------
meta.json
    Format, configuration, library versions, how far the build is, and every other file with its
    checksum. It is replaced atomically, and that is the commit: files it does not name do not
    count. It holds nothing that differs between two builds of one configuration.
elites-<births>.npz
    Elites and pending children, plain arrays.
births/part-<number>-<rows>.parquet
    Births, ``PART_ROWS`` to a part. Full parts are final; the last is rewritten under a new name
    until it is full.

Nothing is pickled, so an untrusted archive cannot run code.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from nichechain import __version__, births
from nichechain.births import Offspring
from nichechain.config import BuildConfig
from nichechain.domains.base import Domain
from nichechain.errors import ArchiveError
from nichechain.illumination import Elites, SearchState

FORMAT = 1
PART_ROWS = 65_536
_META = "meta.json"
_BIRTHS = "births"


@dataclass(frozen=True)
class DomainFacts:
    """What figures need to know of a domain, kept so that they need not load it.

    Parameters
    ----------
    behavior_names : tuple of str
    unit : str
        Unit of behavior.
    objective_name : str
        What the objective is, with its unit.
    start : tuple of float, optional
        Behavior of doing nothing, where there is such a thing.
    """

    behavior_names: tuple[str, ...]
    unit: str
    objective_name: str
    start: tuple[float, ...] | None

    @classmethod
    def of(cls, domain: Domain) -> DomainFacts:
        """The facts of a domain."""
        start = domain.start
        return cls(
            domain.behavior_names,
            domain.unit,
            domain.objective_name,
            None if start is None else tuple(start.tolist()),
        )


@dataclass(frozen=True)
class Meta:
    """What ``meta.json`` says.

    Parameters
    ----------
    config : BuildConfig
    facts : DomainFacts
    versions : dict
        Version of every library that shapes the results.
    births, step : int
        How far the build is.
    elites : dict
        Name and SHA-256 of the elites file.
    parts : tuple of dict
        Name, SHA-256 and number of rows of every part, in order.
    origin : dict, optional
        Where the births come from, if not from a build: ``kind`` is ``merged`` or ``imported``, and
        the rest tells of what. No build goes on with such an archive.
    """

    config: BuildConfig
    facts: DomainFacts
    versions: dict[str, str]
    births: int
    step: int
    elites: dict[str, Any]
    parts: tuple[dict[str, Any], ...]
    origin: dict[str, Any] | None = None

    @property
    def imported(self) -> bool:
        """Whether the births come from another program's log."""
        return self.origin is not None and self.origin["kind"] == "imported"

    @property
    def complete(self) -> bool:
        """Whether the build reached its budget."""
        return self.births >= self.config.evaluations


def is_archive(folder: Path) -> bool:
    """Whether the folder holds a committed archive."""
    return (folder / _META).is_file()


def read_meta(folder: Path) -> Meta:
    """What is in an archive, without reading it all.

    Raises
    ------
    ArchiveError
        If the folder is no archive, or one of another format.
    """
    path = folder / _META
    if not folder.is_dir():
        raise ArchiveError(f"{folder} is no archive: there is no such folder")
    if not path.is_file():
        raise ArchiveError(f"{folder} is no archive: it has no {_META}")
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        if values["format"] != FORMAT:
            raise ArchiveError(
                f"{path} has format {values['format']}, but this version reads format {FORMAT}"
            )
        if values.pop("sha256") != _checksum(values):
            raise ArchiveError(f"{path} is damaged: its checksum is not the one that was committed")
        total = int(values["births"])
        elites = {name: str(values["elites"][name]) for name in ("file", "sha256")}
        parts: tuple[dict[str, Any], ...] = tuple(
            {"file": str(part["file"]), "sha256": str(part["sha256"]), "rows": int(part["rows"])}
            for part in values["parts"]
        )
        if sum(part["rows"] for part in parts) != total:
            raise ArchiveError(f"{path} is damaged: its parts do not add up to {total} births")
        origin = values.get("origin")
        if origin is not None and origin["kind"] not in ("merged", "imported"):
            raise ArchiveError(f"{path} is {origin['kind']!r}, which this version cannot read")
        facts = values["domain"]
        start = facts["start"]
        return Meta(
            BuildConfig.from_json(values["config"]),
            DomainFacts(
                tuple(facts["behavior_names"]),
                str(facts["unit"]),
                str(facts["objective_name"]),
                None if start is None else tuple(float(x) for x in start),
            ),
            values["versions"],
            total,
            int(values["step"]),
            elites,
            parts,
            origin,
        )
    except ArchiveError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ArchiveError(f"{path} is damaged: {error}") from error


def read_state(folder: Path, meta: Meta) -> SearchState:
    """Elites and pending children of the last commit.

    Raises
    ------
    ArchiveError
        If the file is missing or damaged.
    """
    content = _read(folder, meta.elites)
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            elites = Elites(*(arrays[name] for name in Elites.__dataclass_fields__))
            pending = Offspring(*(arrays[f"pending_{name}"] for name in Offspring.__dataclass_fields__))
    except (ValueError, KeyError, TypeError, EOFError, OSError, zipfile.BadZipFile) as error:
        raise ArchiveError(f"{folder / meta.elites['file']} is damaged: {error}") from error
    return SearchState(elites, pending, meta.births, meta.step)


def read_births(folder: Path, meta: Meta) -> pa.Table:
    """All committed births, in order.

    Raises
    ------
    ArchiveError
        If a part is missing or damaged.
    """
    tables = [_read_part(folder, part) for part in meta.parts]
    return pa.concat_tables(tables) if tables else births.schema(len(meta.config.shape)).empty_table()


class Writer:
    """Commits a build to its folder.

    Parameters
    ----------
    folder : Path
        Its archive, if it holds one, is continued.
    config : BuildConfig
    facts : DomainFacts
    origin : dict, optional
        As in :class:`Meta`, for births that no build made.
    """

    def __init__(
        self, folder: Path, config: BuildConfig, facts: DomainFacts, origin: dict[str, Any] | None = None
    ) -> None:
        self._folder = folder
        self._config = config
        self._facts = facts
        self._origin = origin
        self._full: list[dict[str, Any]] = []
        self._tail = births.schema(len(config.shape)).empty_table()
        if is_archive(folder):
            meta = read_meta(folder)
            self._full = [part for part in meta.parts if part["rows"] == PART_ROWS]
            for part in meta.parts[len(self._full) :]:
                self._tail = _read_part(folder, part)

    @property
    def births(self) -> int:
        """Rows committed or appended."""
        return PART_ROWS * len(self._full) + len(self._tail)

    def append(self, rows: pa.Table) -> None:
        """Births for the next commit."""
        self._tail = pa.concat_tables([self._tail, rows])

    def commit(self, state: SearchState) -> None:
        """Make the state and the births so far durable; before it returns, the last commit holds."""
        (self._folder / _BIRTHS).mkdir(parents=True, exist_ok=True)
        while len(self._tail) >= PART_ROWS:
            self._full.append(self._write_part(self._tail[:PART_ROWS]))
            self._tail = self._tail[PART_ROWS:].combine_chunks()
        parts = [*self._full, self._write_part(self._tail)] if len(self._tail) else self._full
        arrays = {name: getattr(state.elites, name) for name in Elites.__dataclass_fields__}
        arrays |= {f"pending_{name}": getattr(state.pending, name) for name in Offspring.__dataclass_fields__}
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, **arrays)
        elites = self._write(f"elites-{state.births:09d}.npz", buffer.getvalue())
        meta = {
            "format": FORMAT,
            "config": self._config.to_json(),
            "domain": asdict(self._facts),
            "versions": library_versions(),
            "births": state.births,
            "step": state.step,
            "elites": elites,
            "parts": parts,
        }
        if self._origin is not None:
            meta["origin"] = self._origin
        meta["sha256"] = _checksum(meta)
        self._write(_META, json.dumps(meta, indent=2).encode())
        self._sweep({_META, elites["file"], *(part["file"] for part in parts)})

    def _write_part(self, rows: pa.Table) -> dict[str, Any]:
        buffer = pa.BufferOutputStream()
        pq.write_table(rows.combine_chunks(), buffer, compression="zstd")
        name = f"{_BIRTHS}/part-{len(self._full):06d}-{len(rows):05d}.parquet"
        return {**self._write(name, buffer.getvalue().to_pybytes()), "rows": len(rows)}

    def _write(self, name: str, content: bytes) -> dict[str, Any]:
        path = self._folder / name
        part = path.with_name(path.name + ".tmp")
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
        _sync_folder(path.parent)
        return {"file": name, "sha256": hashlib.sha256(content).hexdigest()}

    def _sweep(self, named: set[str]) -> None:
        """Remove what earlier commits, or one that was cut short, left behind."""
        for pattern in ("elites-*.npz*", f"{_BIRTHS}/part-*.parquet*"):
            for path in self._folder.glob(pattern):
                if path.relative_to(self._folder).as_posix() not in named:
                    path.unlink()


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Hold the right to write to a folder; the system lets go of it if the process dies.

    Raises
    ------
    ArchiveError
        If another process holds it.
    """
    from filelock import FileLock, Timeout

    folder.mkdir(parents=True, exist_ok=True)
    lock = FileLock(folder / ".lock")
    try:
        with lock.acquire(blocking=False):
            yield
    except Timeout:
        raise ArchiveError(f"{folder} is being written by another build: wait for it, or stop it") from None


def clear(folder: Path) -> None:
    """Remove an archive's files from a folder, and nothing else."""
    (folder / _META).unlink(missing_ok=True)
    (folder / f"{_META}.tmp").unlink(missing_ok=True)
    for pattern in ("elites-*.npz*", f"{_BIRTHS}/part-*.parquet*"):
        for path in folder.glob(pattern):
            path.unlink()


def library_versions() -> dict[str, str]:
    """Versions of the libraries whose numbers end up in an archive."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    found = {"nichechain": __version__, "python": platform.python_version()}
    for name in ("numpy", "numba", "torch", "mujoco", "gymnasium-robotics", "ribs"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "none"
    return found


def _checksum(meta: dict[str, Any]) -> str:
    """SHA-256 of the metadata as they are written, without their own checksum."""
    return hashlib.sha256(json.dumps(meta, indent=2).encode()).hexdigest()


def _read_part(folder: Path, part: dict[str, Any]) -> pa.Table:
    try:
        rows = pq.read_table(pa.BufferReader(_read(folder, part)))
    except pa.ArrowException as error:
        raise ArchiveError(f"{folder / part['file']} is damaged: {error}") from error
    if len(rows) != part["rows"]:
        raise ArchiveError(f"{folder / part['file']} has {len(rows)} rows, but {part['rows']} were written")
    return rows


def _read(folder: Path, entry: dict[str, Any]) -> bytes:
    """Content of a file that the metadata names, checked against its checksum."""
    root = folder.resolve()
    path = (root / str(entry["file"])).resolve()
    if not path.is_relative_to(root):
        raise ArchiveError(f"{folder / _META} names {entry['file']}, which lies outside the folder")
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ArchiveError(
            f"{path} cannot be read: {error.strerror}; if a build goes on there, load the archive again"
        ) from error
    if hashlib.sha256(content).hexdigest() != entry["sha256"]:
        raise ArchiveError(f"{path} is damaged: its checksum is not the one that was committed")
    return content


def _sync_folder(folder: Path) -> None:
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
