"""Make the searches of a study into a folder, from as many processes as one likes.

A process takes the first search that nobody else is making. So any process may be killed at any instant, and
the same command goes on.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from nichechain.archive.archive import load
from nichechain.archive.building import build
from nichechain.core.files import as_path
from nichechain.domains.base import Domain
from nichechain.execution import Executor
from nichechain.search.making import make_domain
from nichechain.studies.searches.folder import archive_of, begin, is_finished, lock_of, write_record
from nichechain.studies.searches.measuring import measure
from nichechain.studies.searches.study import OneSearch, SelectionStudy


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

    folder = as_path("folder", folder)
    domain = domain or make_domain(study.config)
    begin(study, folder)
    each = study.config.evaluations + study.elites * study.offspring
    done = elsewhere = 0

    def tell(more: int) -> None:
        if on_progress is not None:
            on_progress(done + more)

    for search in study.searches():
        lock = FileLock(lock_of(folder, search))
        try:
            with lock.acquire(blocking=False):
                # Another process may have finished it by now.
                if not is_finished(folder, search):
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
    path = archive_of(folder, search)
    build(search.config, path, executor, domain=domain, on_progress=lambda progress: tell(progress.births))
    checked = search.config.evaluations

    def on_done(more: int) -> None:
        nonlocal checked
        checked += more
        tell(checked)

    archive = load(path, domain=domain)
    rows = measure(archive, executor, elites=study.elites, offspring=study.offspring, on_done=on_done)
    write_record(folder, search, rows)
    shutil.rmtree(path)
