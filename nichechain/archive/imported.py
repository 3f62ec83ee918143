"""Births of another program's search, from a table of parents and children."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from nichechain.archive import read, write
from nichechain.archive.log_columns import Columns, LogReader
from nichechain.archive.logs import read_log
from nichechain.core.checks import shown
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.core.files import as_path, writing
from nichechain.niches import Niches
from nichechain.search.config import BuildConfig
from nichechain.search.elites import Elites, SearchState

if TYPE_CHECKING:
    import pandas as pd

DOMAIN = "imported"


@dataclass(frozen=True)
class Axes:
    """What the axes of behavior are called, for figures.

    Parameters
    ----------
    names : tuple of str
        By default the names of the columns of a child's behavior, or axis_0, axis_1, ….
    unit : str
    """

    names: tuple[str, ...] = ()
    unit: str = "units"


def import_births(
    log: str | Path | pd.DataFrame | pa.Table,
    folder: str | Path,
    niches: Niches,
    *,
    columns: Columns | None = None,
    axes: Axes | None = None,
    overwrite: bool = False,
) -> None:
    """Make an archive of the births that a log of another search tells of.

    The archive has births, and with them counts and a chain, but no elites: genotypes, domain and
    mutation are not known, so nothing can be evaluated.

    Parameters
    ----------
    log : path, pandas.DataFrame or pyarrow.Table
        One row per evaluated child: a CSV file with a header, plain or gzipped; Parquet, or a folder of
        such files, read in the order of their names; or a table.
    folder : path
        Where the archive goes.
    niches : Niches
    columns : Columns, optional
    axes : Axes, optional
    overwrite : bool
        Whether an archive that the folder holds may go, if its births were imported as well.

    Raises
    ------
    NichechainError
        If the log cannot be read, a column is missing or holds what it must not.
    ArchiveError
        If the folder holds an archive that must stay.
    """
    if columns is not None and not isinstance(columns, Columns):
        raise NichechainError(f"columns is {shown(columns)}, but must be Columns(...)")
    columns, axes = columns or Columns(), axes or Axes()
    table, source = read_log(log)
    name = source["file"] if hasattr(log, "columns") else log
    missing = [each for each in columns.names if each not in table.column_names]
    if missing:
        raise NichechainError(f"{name} has no column {missing[0]!r}: it has {', '.join(table.column_names)}")
    twice = [each for each in columns.names if table.column_names.count(each) > 1]
    if twice:
        raise NichechainError(f"{name} has column {twice[0]!r} more than once: rename all but one")
    if not len(table):
        raise NichechainError(f"{name} has no rows, but every birth is one")
    if not (axes.names or isinstance(columns.child, str)) and len(columns.child) == len(niches.bounds):
        axes = replace(axes, names=columns.child)
    rows = LogReader(table, niches).births(columns)
    origin = {
        "kind": "imported",
        **source,
        "columns": {name: value for name, value in vars(columns).items() if value is not None},
    }
    write_archive(
        folder,
        niches,
        rows,
        origin,
        axes,
        objective_name=columns.objective or "objective",
        overwrite=overwrite,
    )


def write_archive(
    folder: str | Path,
    niches: Niches,
    rows: pa.Table,
    origin: dict[str, Any],
    axes: Axes,
    *,
    state: SearchState | None = None,
    objective_name: str = "objective",
    overwrite: bool = False,
) -> None:
    """Make an archive of births that no build made.

    Parameters
    ----------
    folder : path
        Where the archive goes; it must not hold one.
    niches : Niches
    rows : pyarrow.Table
        Births.
    origin : dict
        Where they come from: ``kind`` is ``imported``, and the rest tells of what.
    axes : Axes
    state : SearchState, optional
        Elites, by default none.
    objective_name : str
    overwrite : bool
        Whether an archive that the folder holds may go, if its births were imported as well.

    Raises
    ------
    NichechainError
        If there are more or fewer names than axes.
    ArchiveError
        If the folder holds an archive.
    """
    folder = as_path("folder", folder)
    dimensions = len(niches.bounds)
    facts = read.DomainFacts(_axis_names(axes, dimensions), axes.unit, objective_name, None)
    config = BuildConfig(
        DOMAIN,
        evaluations=len(rows),
        replacement="random" if state is None else "objective",
        **niches.settings(),
    )
    with writing(folder):
        if read.is_archive(folder):
            _clear(folder, overwrite)
        writer = write.Writer(folder, config, facts, origin, niches=niches)
        writer.append(rows)
        writer.commit(state or _nothing_to_go_on_with(len(rows), dimensions))


def _clear(folder: Path, overwrite: bool) -> None:
    """Make room where that is wanted; nobody's build goes for somebody's log."""
    if not overwrite:
        raise ArchiveError(
            f"{folder} already holds an archive: import into another folder, or overwrite this one"
        )
    if not read.read_meta(folder).imported:
        raise ArchiveError(
            f"{folder} holds an archive that was not imported, which is not overwritten: "
            "import into another folder"
        )
    write.clear(folder)


def _axis_names(axes: Axes, dimensions: int) -> tuple[str, ...]:
    if axes.names:
        if len(axes.names) != dimensions:
            raise NichechainError(f"axes are {', '.join(axes.names)}, but the grid has {dimensions}")
        return axes.names
    return tuple(f"axis_{axis}" for axis in range(dimensions))


def _nothing_to_go_on_with(number: int, dimensions: int) -> SearchState:
    whole, real = np.empty(0, np.int64), np.empty(0)
    none = np.empty((0, 0), np.float32)
    elites = Elites(whole, none, np.empty((0, dimensions)), real, real, whole, whole)
    return SearchState.at_rest(elites, number, 0)
