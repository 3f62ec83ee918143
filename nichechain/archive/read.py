"""What an archive folder holds: its last commit, read and checked.

Any of it may be damaged, or written by somebody who means harm: nothing is believed before it is
checked, and every error names the file.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from nichechain import births
from nichechain.archive import untrusted
from nichechain.archive.stored_state import parse_state
from nichechain.archive.trust import check_origin
from nichechain.births.table import LINEAGE
from nichechain.core.errors import ArchiveError
from nichechain.core.files import ARCHIVE_MARK
from nichechain.core.text import printable_values
from nichechain.domains.base import Domain
from nichechain.niches import Niches
from nichechain.search.config import BuildConfig
from nichechain.search.elites import SearchState
from nichechain.search.lineages import Calibration
from nichechain.search.making import make_niches

FORMAT = 1
META = ARCHIVE_MARK
BIRTHS = "births"
CENTROIDS = "centroids.npy"
_ELITES_NAME = r"elites-[0-9]{9,18}\.npz"

# What no archive exceeds, so that an untrusted one cannot either. These metadata name 100,000
# parts, which are billions of births.
_LARGEST_META = 1 << 24
_MOST_ROWS = 1 << 20
_MOST_NICHES = 1 << 31
_SMALLEST_LIMIT = 1 << 20
_NOT_COMMITTED = "its checksum is not the one that was committed"


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
    centroids : dict, optional
        Name and SHA-256 of the file of centroids, for a tessellation.
    machine : dict
        What kind of machine made it, see :func:`nichechain.core.machine.machine`; empty in archives
        of before it was recorded.
    calibrations : tuple of Calibration
        Births of lineages that were added after the build, in order; only the last may be unfinished.
    """

    config: BuildConfig
    facts: DomainFacts
    versions: dict[str, str]
    births: int
    step: int
    elites: dict[str, Any]
    parts: tuple[dict[str, Any], ...]
    origin: dict[str, Any] | None = None
    centroids: dict[str, Any] | None = None
    machine: dict[str, str] = field(default_factory=dict)
    calibrations: tuple[Calibration, ...] = ()

    @property
    def built(self) -> int:
        """Births of the build, without those that a calibration added."""
        return self.calibrations[0].first_uid if self.calibrations else self.births

    @property
    def imported(self) -> bool:
        """Whether the births come from another program's log."""
        return self.origin is not None and self.origin["kind"] == "imported"

    @property
    def complete(self) -> bool:
        """Whether the build reached its budget."""
        return self.built >= self.config.evaluations


def is_archive(folder: Path) -> bool:
    """Whether the folder holds a committed archive."""
    return (folder / META).is_file()


def read_meta(folder: Path) -> Meta:
    """What is in an archive, without reading it all.

    Raises
    ------
    ArchiveError
        If the folder is no archive, or one of another format.
    """
    path = folder / META
    if not folder.is_dir():
        raise ArchiveError(f"{folder} is no archive: there is no such folder")
    if not path.is_file():
        raise ArchiveError(f"{folder} is no archive: it has no {META}")
    with _reading(path):
        values = untrusted.read_object(untrusted.read_file(path, folder, _LARGEST_META))
        if values["format"] != FORMAT:
            raise ArchiveError(
                f"{path} has format {values['format']}, but this version reads format {FORMAT}"
            )
        if values.pop("sha256") != checksum(values):
            raise ValueError(_NOT_COMMITTED)
        return _meta(printable_values(values))


def _meta(values: dict[str, Any]) -> Meta:
    config = BuildConfig.from_json(values["config"])
    # Births number niches with 32 bits.
    if math.prod(config.shape) >= _MOST_NICHES:
        raise ValueError(
            f"it has {math.prod(config.shape)} niches, but can have no more than {_MOST_NICHES - 1}"
        )
    total = int(values["births"])
    elites = _entry(values["elites"])
    if not re.fullmatch(_ELITES_NAME, elites["file"]):
        raise ValueError(f"it names {elites['file']!r}, which no elites are called")
    centroids = None
    if config.niches == "cvt":
        centroids = _entry(values["centroids"])
        if centroids["file"] != CENTROIDS:
            raise ValueError(f"it names {centroids['file']!r}, which no centroids are called")
    parts = []
    for number, part in enumerate(values["parts"]):
        entry = {**_entry(part), "rows": int(part["rows"])}
        # Each by its own name, or a small file could be named, and read, a million times.
        if entry["file"] != part_name(number, entry["rows"]) or not 0 < entry["rows"] <= _MOST_ROWS:
            raise ValueError(f"it names {entry['file']!r} as part {number}, of {entry['rows']} rows")
        parts.append(entry)
    if sum(part["rows"] for part in parts) != total:
        raise ValueError(f"its parts do not add up to {total} births")
    origin = values.get("origin")
    if origin is not None:
        check_origin(origin)
        for run in origin["runs"] if origin["kind"] == "merged" else ():
            calibrations_of(run, run["births"])
    facts = values["domain"]
    start = facts["start"]
    names = tuple(str(name) for name in facts["behavior_names"])
    if start is not None and (len(start) != len(names) or not all(map(math.isfinite, start))):
        raise ValueError(f"its start is {start}, but must be a finite number for each axis of behavior")
    if len(names) != len(config.bounds):
        raise ValueError(f"it names {len(names)} axes of behavior, but has bounds for {len(config.bounds)}")
    return Meta(
        config,
        DomainFacts(
            names,
            str(facts["unit"]),
            str(facts["objective_name"]),
            None if start is None else tuple(float(x) for x in start),
        ),
        {str(name): str(version) for name, version in values["versions"].items()},
        total,
        int(values["step"]),
        elites,
        tuple(parts),
        origin,
        centroids,
        {str(name): str(value) for name, value in values.get("machine", {}).items()},
        calibrations_of(values, total),
    )


def calibrations_of(values: dict[str, Any], births: int) -> tuple[Calibration, ...]:
    """The calibrations that metadata tell of, of an archive or of one of its runs.

    Parameters
    ----------
    values : dict
    births : int
        Births of the archive or run.

    Raises
    ------
    ValueError
        If they do not follow one another up to the last birth.
    """
    found = tuple(
        Calibration(
            int(each["first_step"]),
            int(each["first_uid"]),
            int(each["births"]),
            # Before there were broods, each lineage began alone.
            int(each.get("brood", 1)),
        )
        for each in values.get("calibrations", ())
    )
    for each, later in pairwise(found):
        if later.first_uid != each.end or later.first_step <= each.first_step:
            raise ValueError("its calibrations do not follow one another")
    for each in found:
        if not (0 < each.first_uid <= births and each.births > 0 and each.first_step > 0):
            raise ValueError(f"it has a calibration of {each.births} births from birth {each.first_uid} on")
        if each.brood < 1:
            raise ValueError(f"it has a calibration with broods of {each.brood} lineages")
    if found and births > found[-1].end:
        raise ValueError(f"its calibrations do not add up to {births} births")
    return found


def _entry(values: dict[str, Any]) -> dict[str, Any]:
    return {"file": str(values["file"]), "sha256": str(values["sha256"])}


def read_niches(folder: Path, meta: Meta) -> Niches:
    """The niches of an archive, a tessellation with the centroids that it was built with.

    Raises
    ------
    ArchiveError
        If the file of centroids is missing or damaged, or the configuration has no such niches.
    """
    if meta.centroids is None:
        with _reading(folder / META):
            return make_niches(meta.config)
    content = _read(folder, meta.centroids)
    with _reading(folder / meta.centroids["file"]):
        return make_niches(meta.config, untrusted.read_array(content, np.float64, 2))


def read_commit(folder: Path) -> tuple[Meta, SearchState]:
    """Metadata and state of one and the same commit, also while a build goes on.

    Raises
    ------
    ArchiveError
        If the folder is no archive or is damaged.
    """
    meta = read_meta(folder)
    while True:
        try:
            return meta, read_state(folder, meta)
        except ArchiveError:
            # A commit since then has swept the elites of the one before it.
            later = read_meta(folder)
            if later.elites == meta.elites:
                raise
            meta = later


def read_state(folder: Path, meta: Meta) -> SearchState:
    """Elites and pending children of the last commit.

    Raises
    ------
    ArchiveError
        If the file is missing or damaged.
    """
    content = _read(folder, meta.elites)
    with _reading(folder / meta.elites["file"]):
        of_build = meta.origin is None and not meta.calibrations
        return parse_state(content, meta.config, meta.births, meta.step, of_build=of_build)


def read_births(folder: Path, meta: Meta, columns: list[str] | None = None) -> pa.Table:
    """All births of a commit, in order.

    While a build goes on, later commits replace the last part by a longer one; births are only
    ever appended, so it begins with the same rows.

    Parameters
    ----------
    folder : Path
    meta : Meta
    columns : list of str, optional
        By default all.

    Raises
    ------
    ArchiveError
        If a part is missing or damaged.
    """
    current = meta
    while True:
        try:
            tables = [read_part(folder, current, part, columns) for part in current.parts]
        except ArchiveError:
            later = read_meta(folder)
            if later.parts == current.parts or not _continues(later, meta):
                raise
            current = later
            continue
        axes = len(meta.config.bounds)
        empty = births.schema(axes).empty_table()
        empty = empty if columns is None else empty.select(columns)
        # What decoding took would stay with pyarrow, a tenth of what a million births need afterwards.
        pa.default_memory_pool().release_unused()
        return pa.concat_tables([empty, *tables])[: meta.births]


def _continues(later: Meta, meta: Meta) -> bool:
    """Whether a commit is a later one of the same build."""
    grown = replace(meta.config, evaluations=later.config.evaluations)
    return later.config == grown and later.births >= meta.births and later.origin == meta.origin


def checksum(meta: dict[str, Any]) -> str:
    """SHA-256 of the metadata as they are written, without their own checksum."""
    return untrusted.sha256(json.dumps(meta, indent=2).encode())


def part_name(number: int, rows: int) -> str:
    """What the file of a part is called."""
    return f"{BIRTHS}/part-{number:06d}-{rows:05d}.parquet"


def read_part(folder: Path, meta: Meta, part: dict[str, Any], columns: list[str] | None = None) -> pa.Table:
    """The births of one part that the metadata name.

    Raises
    ------
    ArchiveError
        If it is missing or damaged.
    """
    rows: int = part["rows"]
    # Twice the strings, for numbers and structure take less than those.
    content = _read(folder, part, _SMALLEST_LIMIT + 2 * untrusted.LONGEST_STRING * rows)
    with _reading(folder / part["file"]):
        schema = births.schema(len(meta.config.bounds))
        table = untrusted.read_table(content, schema, rows, columns, flag=LINEAGE)
        for name in ("parent_niche", "child_niche"):
            if name in table.column_names:
                bounds = pc.min_max(table[name]).as_py()
                if (bounds["min"] or 0) < 0 or (bounds["max"] or 0) > math.prod(meta.config.shape):
                    raise ValueError(f"it has a {name} that does not exist")
    return table


def _read(folder: Path, entry: dict[str, Any], limit: int | None = None) -> bytes:
    """Content of a file that the metadata names, checked against its checksum."""
    path = folder / entry["file"]
    with _reading(path):
        content = untrusted.read_file(path, folder, limit)
        if untrusted.sha256(content) != entry["sha256"]:
            raise ValueError(_NOT_COMMITTED)
    return content


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Say of which file an error is."""
    try:
        yield
    except ArchiveError:
        raise
    except MemoryError as error:
        raise ArchiveError(f"{path} is damaged, or too large for the memory of this machine") from error
    except Exception as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise ArchiveError(f"{path} cannot be read: {error.strerror}") from error
        # Parsers of several libraries, and whatever they make of bytes they were not meant to see.
        reason = (str(error).splitlines() or [""])[0][:200] or type(error).__name__
        shown = "".join(letter if letter.isprintable() else "?" for letter in reason)
        raise ArchiveError(f"{path} is damaged: {shown}") from error
