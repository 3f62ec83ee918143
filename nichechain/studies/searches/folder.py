"""The folder of searches that are compared: which study it is, and what was measured of finished searches.

A search under way is an archive in ``searches``, which is as resumable as any; a finished one is a file in
``records``, and its archive goes, since ``nichechain build`` makes it again.
"""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa

from nichechain.core.errors import ArchiveError
from nichechain.core.files import ARCHIVE_MARK, as_path, keep_apart, write_atomically
from nichechain.core.parquet import parquet_bytes
from nichechain.studies.searches.study import OneSearch, SelectionStudy
from nichechain.studies.stored import check_continues, is_study, read_rows, read_stored, write_stored

_SEARCHES, _RECORDS = "searches", "records"


def begin(study: SelectionStudy, folder: Path) -> None:
    """Make room for the searches of a study, and write which study it is.

    Raises
    ------
    ArchiveError
        If the folder holds another study or an archive, or cannot be written to.
    """
    keep_apart(folder, ARCHIVE_MARK)
    try:
        for name in (_SEARCHES, _RECORDS):
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArchiveError(f"{folder} cannot be written to: {error.strerror or error}") from error
    if is_study(folder):
        old = read_study(folder)
        check_continues(old, study, folder)
        if study == old:
            return
    write_stored(folder, study)


def read_study(folder: str | Path) -> SelectionStudy:
    """The study that a folder holds.

    Raises
    ------
    ArchiveError
        If there is none, it is damaged, or of another kind or version.
    """
    path = as_path("folder", folder)
    return read_stored(path, lambda values: SelectionStudy.from_json(values["study"]), "selections")


def archive_of(folder: Path, search: OneSearch) -> Path:
    """Where a search is made."""
    return folder / _SEARCHES / search.name


def lock_of(folder: Path, search: OneSearch) -> Path:
    """What the process holds that makes a search."""
    return folder / _SEARCHES / f"{search.name}.lock"


def is_finished(folder: Path, search: OneSearch) -> bool:
    """Whether a search was made and measured."""
    return _record(folder, search).exists()


def write_record(folder: Path, search: OneSearch, rows: pa.Table) -> None:
    """Write what was measured of a search, which is then finished."""
    write_atomically(_record(folder, search), parquet_bytes(rows))


def read_searches(folder: str | Path) -> tuple[SelectionStudy, pa.Table]:
    """The study of a folder, and what was measured of its finished searches.

    Parameters
    ----------
    folder : path

    Returns
    -------
    SelectionStudy
    pyarrow.Table
        Columns ``selection``, ``run`` and those of :func:`nichechain.studies.searches.measuring.measure`.

    Raises
    ------
    ArchiveError
        If there is no such study, a file is damaged, or no search is finished.
    """
    folder = as_path("folder", folder)
    study = read_study(folder)
    tables = []
    for search in study.searches():
        if not is_finished(folder, search):
            continue
        rows = read_rows(_record(folder, search))
        run = pa.array([search.run] * rows.num_rows, pa.int64())
        selection = pa.array([search.selection] * rows.num_rows, pa.string())
        tables.append(rows.add_column(0, "run", run).add_column(0, "selection", selection))
    if not tables:
        raise ArchiveError(f"{folder} has no finished search yet: go on with them first")
    return study, pa.concat_tables(tables)


def _record(folder: Path, search: OneSearch) -> Path:
    return folder / _RECORDS / f"{search.name}.parquet"
