"""An archive folder on disk: written by one build, read by all.

Layout
------
meta.json
    Format, configuration, library versions, how far the build is, and every other file with its
    checksum. It is replaced atomically, and that is the commit: files it does not name do not
    count. It holds nothing that differs between two builds of one configuration.
elites-<births>.npz
    Elites, pending children, lineages under way and contenders, plain arrays.
centroids.npy
    Of a tessellation only: its centroids, a plain array, written once. Reading an archive never
    makes them again, so that no version of a library can move its niches.
births/part-<number>-<rows>.parquet
    Births, ``PART_ROWS`` to a part. Full parts are final; the last is rewritten under a new name
    until it is full. A part without a birth of a lineage lacks the column ``lineage``.

Nothing is pickled, so an untrusted archive cannot run code.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from nichechain import births
from nichechain.archive import untrusted
from nichechain.archive.read import (
    BIRTHS,
    CENTROIDS,
    FORMAT,
    META,
    DomainFacts,
    checksum,
    is_archive,
    part_name,
    read_meta,
    read_part,
)
from nichechain.births.table import LINEAGE
from nichechain.core.errors import ArchiveError
from nichechain.core.files import STUDY_MARK, keep_apart, write_atomically
from nichechain.core.machine import library_versions, machine
from nichechain.niches import CVTNiches, Niches
from nichechain.search import savings
from nichechain.search.config import BuildConfig
from nichechain.search.elites import SearchState
from nichechain.search.lineages import Calibration

PART_ROWS = 65_536


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
    niches : Niches, optional
        Those of the configuration; needed where they are a tessellation that no commit has kept.
    calibrations : sequence of Calibration
        Which births were added to those of the build.
    """

    def __init__(
        self,
        folder: Path,
        config: BuildConfig,
        facts: DomainFacts,
        origin: dict[str, Any] | None = None,
        *,
        niches: Niches | None = None,
        calibrations: Sequence[Calibration] = (),
    ) -> None:
        keep_apart(folder, STUDY_MARK)
        self._folder = folder
        self._config = config
        self._facts = facts
        self._origin = origin
        self._calibrations = calibrations
        self._tessellation = niches if isinstance(niches, CVTNiches) else None
        self._centroids: dict[str, Any] | None = None
        self._committed = 0
        self._full: list[dict[str, Any]] = []
        self._final = 0
        self._tail = births.schema(len(config.bounds)).empty_table()
        self._new: list[pa.Table] = []
        self._waiting = 0
        if is_archive(folder):
            meta = read_meta(folder)
            self._committed = meta.births
            self._centroids = meta.centroids
            # Parts before the last are final, whatever size they had when they were written.
            self._full = list(meta.parts)
            if self._full and self._full[-1]["rows"] < PART_ROWS:
                self._tail = read_part(folder, meta, self._full.pop())
            self._final = meta.births - len(self._tail)
        if config.niches == "cvt" and self._centroids is None and self._tessellation is None:
            raise ArchiveError(f"{folder} cannot be written: its tessellation is not given")

    @property
    def births(self) -> int:
        """Rows committed or appended."""
        return self._final + len(self._tail) + self._waiting

    def append(self, rows: pa.Table) -> None:
        """Births for the next commit.

        Raises
        ------
        ArchiveError
            As :meth:`commit`: so many of them are written at once that memory stays flat.
        """
        # One by one they would be copied again and again.
        self._new.append(rows)
        self._waiting += len(rows)
        if len(self._tail) + self._waiting >= PART_ROWS:
            with self._explained():
                self._write_full_parts()

    def commit(self, state: SearchState) -> None:
        """Make the state and the births so far durable; before it returns, the last commit holds.

        Raises
        ------
        ArchiveError
            If the folder cannot be written to. The last commit is then whole, and another attempt
            may be made.
        """
        with self._explained():
            self._commit(state)
        self._committed = state.births

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            kept = (
                f"the last commit, of {self._committed} births, is whole: another build goes on from there"
                if self._committed
                else "nothing was kept, since nothing had been committed"
            )
            raise ArchiveError(
                f"{error.filename or self._folder} cannot be written: {error.strerror or error}; {kept}"
            ) from error

    def _write_full_parts(self) -> None:
        """Write what no later birth can change; it counts once a commit names it."""
        (self._folder / BIRTHS).mkdir(parents=True, exist_ok=True)
        # In one statement each, so that an interrupt leaves every birth in one place.
        self._tail, self._new, self._waiting = pa.concat_tables([self._tail, *self._new]), [], 0
        while len(self._tail) >= PART_ROWS:
            part = self._write_part(self._tail[:PART_ROWS])
            rest = self._tail[PART_ROWS:].combine_chunks()
            self._full.append(part)
            self._tail, self._final = rest, self._final + PART_ROWS

    def _commit(self, state: SearchState) -> None:
        self._write_full_parts()
        parts = [*self._full, self._write_part(self._tail)] if len(self._tail) else self._full
        arrays = state.elites.columns()
        arrays |= {f"pending_{name}": column for name, column in state.pending.columns().items()}
        arrays |= {f"lineage_{name}": column for name, column in state.lineages.columns().items()}
        if not (state.pending.lineage.any() or len(state.lineages)):
            # As archives were before there were lineages.
            arrays = {name: array for name, array in arrays.items() if LINEAGE not in name}
        if len(state.contenders):
            arrays |= {f"contender_{name}": column for name, column in state.contenders.columns().items()}
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, **arrays)
        elites = self._write(f"elites-{state.births:09d}.npz", buffer.getvalue())
        meta = {
            "format": FORMAT,
            "config": self._config.to_json(),
            "domain": asdict(self._facts),
            "versions": library_versions(),
            "machine": machine(),
            "births": state.births,
            "step": state.step,
            "elites": elites,
            "parts": parts,
        }
        if self._origin is not None:
            meta["origin"] = self._origin
        if self._calibrations:
            meta["calibrations"] = [asdict(each) for each in self._calibrations]
        if self._centroids is None and self._tessellation is not None:
            self._centroids = self._write(CENTROIDS, _as_npy(self._tessellation.centroids))
        if self._centroids is not None:
            meta["centroids"] = self._centroids
        meta["sha256"] = checksum(meta)
        self._write(META, json.dumps(meta, indent=2).encode())
        kept = {META, elites["file"], *(part["file"] for part in parts)}
        self._sweep(kept if self._centroids is None else {*kept, self._centroids["file"]})

    def _write_part(self, rows: pa.Table) -> dict[str, Any]:
        buffer = pa.BufferOutputStream()
        if not pc.any(rows[LINEAGE]).as_py():
            rows = rows.drop_columns([LINEAGE])
        pq.write_table(rows.combine_chunks(), buffer, compression="zstd")
        name = part_name(len(self._full), len(rows))
        return {**self._write(name, buffer.getvalue().to_pybytes()), "rows": len(rows)}

    def _write(self, name: str, content: bytes) -> dict[str, Any]:
        write_atomically(self._folder / name, content)
        return {"file": name, "sha256": untrusted.sha256(content)}

    def _sweep(self, named: set[str]) -> None:
        """Remove what earlier commits, or one that was cut short, left behind."""
        for pattern in ("elites-*.npz*", f"{CENTROIDS}*", f"{BIRTHS}/part-*.parquet*"):
            for path in self._folder.glob(pattern):
                if path.relative_to(self._folder).as_posix() not in named:
                    # What cannot be removed now harms nobody, and is swept another time.
                    with suppress(OSError):
                        path.unlink()


def clear(folder: Path) -> None:
    """Remove an archive's files from a folder, and nothing else.

    Raises
    ------
    ArchiveError
        If it is the folder of a study.
    """
    keep_apart(folder, STUDY_MARK)
    (folder / META).unlink(missing_ok=True)
    (folder / f"{META}.tmp").unlink(missing_ok=True)
    (folder / savings.FILE).unlink(missing_ok=True)
    for pattern in ("elites-*.npz*", f"{CENTROIDS}*", f"{BIRTHS}/part-*.parquet*"):
        for path in folder.glob(pattern):
            path.unlink()


def _as_npy(array: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()
