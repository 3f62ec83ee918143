"""Run searches that are compared into a folder, from as many processes as one likes.

A search under way is an archive in ``searches``, which is as resumable as any; a finished one is a file in
``records``, and its archive goes, since ``nichechain build`` makes it again. A process takes the first search
that nobody else is making. So any process may be killed at any instant, and the same command goes on.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from nichechain.archive.archive import load
from nichechain.archive.building import build
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.core.files import write_atomically
from nichechain.core.machine import library_versions
from nichechain.core.parquet import read_parquet
from nichechain.domains.base import Domain
from nichechain.execution import Executor
from nichechain.search.making import make_domain
from nichechain.studies.searches.measuring import measure
from nichechain.studies.searches.study import OneSearch, SelectionStudy

_STUDY, _SEARCHES, _RECORDS = "study.json", "searches", "records"
_FORMAT = 1


def run_searches(
    study: SelectionStudy,
    folder: str | Path,
    executor: Executor,
    *,
    domain: Domain | None = None,
    on_progress: Callable[[int], None] | None = None,
) -> int:
    """Make all searches of a study that are still to be made, but those that another process makes.

    Parameters
    ----------
    study : SelectionStudy
        If the folder holds a study, that one; only ``runs`` may be larger.
    folder : path
    executor : Executor
    domain : Domain, optional
        By default the one that the configuration names.
    on_progress : callable, optional
        Told how many of ``study.evaluations`` are made so far.

    Returns
    -------
    int
        How many searches other processes are making.

    Raises
    ------
    ArchiveError
        If the folder holds another study, is damaged, or cannot be written to.
    NichechainError
        If a search cannot be made, see :func:`nichechain.build`.
    """
    from filelock import FileLock, Timeout

    folder = Path(folder)
    domain = domain or make_domain(study.config)
    _begin(study, folder)
    each = study.config.evaluations + study.elites * study.offspring
    done = elsewhere = 0

    def tell(more: int) -> None:
        if on_progress is not None:
            on_progress(done + more)

    for search in study.searches():
        record = _record(folder, search)
        lock = FileLock(folder / _SEARCHES / f"{search.name}.lock")
        try:
            with lock.acquire(blocking=False):
                # Another process may have finished it by now.
                if not record.exists():
                    _make(search, study, folder, executor, domain, tell)
        except Timeout:
            elsewhere += 1
            continue
        done += each
        tell(0)
    return elsewhere


def _make(
    search: OneSearch,
    study: SelectionStudy,
    folder: Path,
    executor: Executor,
    domain: Domain,
    tell: Callable[[int], None],
) -> None:
    path = folder / _SEARCHES / search.name
    build(search.config, path, executor, domain=domain, on_progress=lambda progress: tell(progress.births))
    checked = search.config.evaluations

    def on_done(more: int) -> None:
        nonlocal checked
        checked += more
        tell(checked)

    archive = load(path, domain=domain)
    rows = measure(archive, executor, elites=study.elites, offspring=study.offspring, on_done=on_done)
    content = pa.BufferOutputStream()
    pq.write_table(rows, content, compression="zstd", write_page_checksum=True)
    write_atomically(_record(folder, search), content.getvalue().to_pybytes())
    shutil.rmtree(path)


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
    folder = Path(folder)
    study = read_study(folder)
    tables = []
    for search in study.searches():
        path = _record(folder, search)
        if not path.exists():
            continue
        try:
            rows = read_parquet(path, checksums=True)
        except (OSError, pa.ArrowException) as error:
            raise ArchiveError(f"{path} is damaged: {error}") from error
        run = pa.array([search.run] * rows.num_rows, pa.int64())
        selection = pa.array([search.selection] * rows.num_rows, pa.string())
        tables.append(rows.add_column(0, "run", run).add_column(0, "selection", selection))
    if not tables:
        raise ArchiveError(f"{folder} has no finished search yet: go on with them first")
    return study, pa.concat_tables(tables)


def _begin(study: SelectionStudy, folder: Path) -> None:
    try:
        for name in (_SEARCHES, _RECORDS):
            (folder / name).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ArchiveError(f"{folder} cannot be written to: {error.strerror or error}") from error
    if (folder / _STUDY).exists():
        old = read_study(folder)
        if replace(old, runs=study.runs) != study:
            before, after = old.to_json(), study.to_json()
            before |= before.pop("config")
            after |= after.pop("config")
            names = [name for name in before if before[name] != after[name] and name != "runs"]
            raise ArchiveError(
                f"{folder} holds a study that differs in {', '.join(names)}: go on with that one, "
                "or give another folder"
            )
        if study.runs < old.runs:
            raise ArchiveError(
                f"{folder} holds a study of {old.runs} runs, more than the {study.runs} asked for"
            )
        if study == old:
            return
    values = {"format": _FORMAT, "study": study.to_json(), "versions": library_versions()}
    write_atomically(folder / _STUDY, json.dumps(values, indent=1).encode())


def read_study(folder: str | Path) -> SelectionStudy:
    """The study that a folder holds.

    Raises
    ------
    ArchiveError
        If there is none, it is damaged, or of another version.
    """
    folder = Path(folder)
    path = folder / _STUDY
    try:
        values = json.loads(path.read_text("utf-8"))
        if values["format"] != _FORMAT:
            raise ArchiveError(f"{path} has format {values['format']}, but this version reads {_FORMAT}")
        return SelectionStudy.from_json(values["study"])
    except FileNotFoundError:
        raise ArchiveError(f"{folder} holds no study: it has no {_STUDY}") from None
    except ArchiveError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, NichechainError) as error:
        raise ArchiveError(f"{path} is no study of selections, or damaged: {error}") from error


def _record(folder: Path, search: OneSearch) -> Path:
    return folder / _RECORDS / f"{search.name}.parquet"
