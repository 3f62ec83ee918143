"""The folder of a study of walks: which study it is, which blocks are walked, their records and births.

Walks advance in blocks of runs of one condition. A finished block is a pair of Parquet files, whose name says
which runs it has.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from nichechain.core.errors import ArchiveError
from nichechain.core.files import STUDY_MARK, as_path, write_atomically
from nichechain.core.parquet import parquet_bytes
from nichechain.studies.conditions import Condition
from nichechain.studies.stored import read_rows, read_stored, write_stored
from nichechain.studies.study import Study

_BIRTHS, _RECORDS = "births", "records"
CHECKPOINT = "running.npz"


@dataclass(frozen=True)
class Block:
    """Runs of one condition that advance together.

    Parameters
    ----------
    condition : Condition
    first, last : int
        Numbers of the runs, both among them.
    """

    condition: Condition
    first: int
    last: int

    @property
    def name(self) -> str:
        """Name of its files."""
        return f"{self.condition.slug}-{self.first:04d}-{self.last:04d}"

    @property
    def runs(self) -> range:
        """Numbers of the runs."""
        return range(self.first, self.last + 1)

    def evaluations(self, steps: int) -> int:
        """Rollouts, the starts among them."""
        return len(self.runs) * self.condition.evaluations(steps)


def blocks_named(names: Iterable[str], condition: Condition) -> list[Block]:
    """Blocks of a condition among some names, by the numbers of their runs."""
    pattern = re.compile(re.escape(condition.slug) + r"-(\d+)-(\d+)")
    found = (pattern.fullmatch(name) for name in names)
    runs = sorted((int(match[1]), int(match[2])) for match in found if match)
    return [Block(condition, first, last) for first, last in runs]


def write_study(folder: Path, study: Study, unit: str) -> None:
    """Write which study the folder holds, the unit of behavior with it, and make room for its blocks."""
    for name in (_BIRTHS, _RECORDS):
        (folder / name).mkdir(exist_ok=True)
    write_stored(folder, study, unit=unit)


def read_study(folder: str | Path) -> Study:
    """The study that a folder holds.

    Raises
    ------
    ArchiveError
        If there is none, it is damaged, or of another kind or version.
    """
    return _read(folder)[0]


def read_unit(folder: str | Path) -> str:
    """Unit of behavior of the study that a folder holds, without making its domain.

    Raises
    ------
    ArchiveError
        As :func:`read_study`.
    """
    return _read(folder)[1]


def _read(folder: str | Path) -> tuple[Study, str]:
    def read(values: dict[str, Any]) -> tuple[Study, str]:
        return Study.from_json(values["study"]), str(values["unit"])

    return read_stored(as_path("folder", folder), read, "walks")


def finished_blocks(folder: str | Path, study: Study) -> list[Block]:
    """Blocks that are walked to their end, condition by condition, by the numbers of their runs."""
    names = [path.stem for path in (as_path("folder", folder) / _RECORDS).glob("*.parquet")]
    return [
        block
        for condition in study.conditions
        for block in blocks_named(names, condition)
        if block.last < study.runs
    ]


def write_block(folder: Path, block: Block, *, births: pa.Table, records: pa.Table) -> None:
    """Write what a block that was walked to its end has."""
    # Records last: a block that has them is finished.
    for name, table in ((_BIRTHS, births), (_RECORDS, records)):
        write_atomically(folder / name / f"{block.name}.parquet", parquet_bytes(table))


def remove_leftovers(folder: Path) -> None:
    """Remove what a crash left half-written, and nothing of anybody else's."""
    rows = (f"{name}/*.parquet.tmp" for name in (_BIRTHS, _RECORDS))
    for pattern in (f"{STUDY_MARK}.tmp", f"{CHECKPOINT}.tmp", *rows):
        for path in folder.glob(pattern):
            path.unlink(missing_ok=True)


def read_records(folder: str | Path, study: Study | None = None) -> pa.Table:
    """Measures of all finished runs, one row for each condition, run and step.

    Parameters
    ----------
    folder : path
        Of :func:`run`.
    study : Study, optional
        By default the folder's.

    Returns
    -------
    pyarrow.Table
        ``condition`` and the columns of :meth:`nichechain.walks.StepRecord.table`.

    Raises
    ------
    ArchiveError
        If the folder holds no study or a file is damaged.
    """
    return _read_blocks(as_path("folder", folder), _RECORDS, study)


def read_births(folder: str | Path, study: Study | None = None) -> pa.Table:
    """Every evaluated genotype of all finished runs: ``condition`` and the columns of births.

    Raises
    ------
    ArchiveError
        If the folder holds no study or a file is damaged.
    """
    return _read_blocks(as_path("folder", folder), _BIRTHS, study)


def _read_blocks(folder: Path, name: str, study: Study | None) -> pa.Table:
    study = study or read_study(folder)
    tables = []
    for block in finished_blocks(folder, study):
        rows = read_rows(folder / name / f"{block.name}.parquet")
        label = pa.array([block.condition.label] * rows.num_rows, pa.string())
        tables.append(rows.add_column(0, "condition", label))
    if not tables:
        raise ArchiveError(f"{folder} has no finished walks yet: go on with them first")
    order = [(key, "ascending") for key in ("run", "step", "uid")]
    rows = pa.concat_tables(tables)
    rows = rows.take(pc.sort_indices(rows, order))
    return pa.concat_tables(
        rows.filter(pc.equal(rows["condition"], condition.label)) for condition in study.conditions
    )
