"""Births of unselected lineages, added to an archive that is there.

A chain is asked what lineages do, and learns it from births whose parents a search selected. The niches
that lineages mostly stand in, the popular ones and the state outside, are often those that few births of
lineages speak of. A calibration adds such births.

Where should they be spent? l-evolvability is an average over lineages, and to first order the error
of row i of T enters it in proportion to w_i, the share of their time that lineages stand in niche i.
With n_i births behind row i the variance is about the sum of w_i² σ_i² / n_i, which for a given number
of births is least for n_i in proportion to w_i σ_i (Neyman 1934, Journal of the Royal Statistical
Society 97:558-625). Lineages that begin at elites drawn uniformly, as the average over niches asks for,
spend births in proportion to w_i by themselves: popular sinks and the outside state get most. So
nothing is estimated to decide it, and what a calibration does depends on the archive and the number of
births asked for alone.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from nichechain.archive import read, write
from nichechain.archive.archive import Archive
from nichechain.archive.filling import BuildProgress, Filling
from nichechain.core.checks import check_at_least
from nichechain.core.errors import ArchiveError, NichechainError
from nichechain.core.files import as_path, writing
from nichechain.execution import Executor, Threads
from nichechain.search import savings
from nichechain.search.config import BROOD, MOST_FAILED
from nichechain.search.elites import SearchState
from nichechain.search.failures import Failures
from nichechain.search.lineages import Calibration
from nichechain.search.map_elites import MapElites


def calibrate(
    archive: Archive | str | Path,
    rollouts: int | None = None,
    executor: Executor | None = None,
    *,
    brood: int = BROOD,
    resume: bool = False,
    on_progress: Callable[[BuildProgress], None] | None = None,
    max_failed: float = MOST_FAILED,
) -> None:
    """Add births of unselected lineages to a finished archive.

    Lineages begin in broods, at elites drawn uniformly, and are as long as those of the build,
    ``config.lineage_length``. Their births count as all births do, and win niches by the same rule.
    The number of workers and interruptions change nothing. No build goes on with the archive
    afterwards. An archive that was opened before does not see the births: open it again.

    Parameters
    ----------
    archive : Archive or path
        Of a domain that nichechain does not know by name, give ``load(path, domain=...)``.
    rollouts : int, optional
        How many births to add, at least 1; not given where ``resume`` is.
    executor : Executor, optional
        Where to evaluate; by default on threads, one per processor.
    brood : int
        Lineages that begin at the same elite, at least 1. Fewer do where rollouts are too few, or where
        so many do not fit in a batch of the build.
    resume : bool
        Go on with a calibration that was interrupted, with its own rollouts and brood.
    on_progress : callable, optional
    max_failed : float
        Share of births that may fail, from 0 to 1, once there are a hundred.

    Raises
    ------
    NichechainError
        If ``rollouts`` or ``brood`` is out of range, if ``rollouts`` is given or missing where it must
        not be, or if too many births fail; what there is by then is committed.
    ArchiveError
        If the archive was imported or merged, is unfinished, damaged or being written, or if there
        is nothing to resume, or something to resume first.
    """
    _check_asked(rollouts, resume)
    check_at_least(1, brood=brood)
    failures = Failures(max_failed)
    opened = archive if isinstance(archive, Archive) else Archive(as_path("archive", archive))
    folder = opened.folder
    _check_can(opened.meta, folder)
    domain, mutate = opened.domain, opened.mutate
    with writing(folder):
        # What may have been written since it was opened.
        meta, state = read.read_commit(folder)
        calibrations = _begun(meta, folder, rollouts, brood)
        last = calibrations[-1]
        if meta.births == last.first_uid:
            # Children that the budget did not reach are never born, and lineages begin anew.
            state = SearchState.at_rest(state.elites, state.births, state.step)
        niches = read.read_niches(folder, meta)
        # Lineages begin at any elite alike, however the search drew its parents.
        config = replace(meta.config, selection="uniform")
        search = MapElites(domain, niches, mutate, config, state, stretch=last.stretch(config))
        search.savings = savings.read(folder)
        writer = write.Writer(folder, meta.config, meta.facts, niches=niches, calibrations=calibrations)
        filling = Filling(folder, search, writer, failures, 0, len(niches), on_progress, meta.births)
        with ExitStack() as stack:
            filling.go(last.end, executor or stack.enter_context(Threads()))


def _check_asked(rollouts: int | None, resume: bool) -> None:
    if rollouts is None:
        if not resume:
            raise NichechainError(
                "rollouts is not given, but must be a number of births, unless what was begun is resumed"
            )
        return
    if resume:
        raise NichechainError(
            f"rollouts {rollouts} and resume exclude each other: what is resumed has its number of births"
        )
    check_at_least(1, rollouts=rollouts)


def _check_can(meta: read.Meta, folder: Path) -> None:
    """Refuse archives that no search can go on in."""
    if meta.imported:
        raise ArchiveError(f"{folder} was imported, so nothing can be evaluated: its domain is not known")
    if meta.origin is not None:
        raise ArchiveError(
            f"{folder} was {meta.origin['kind']}: calibrate the archives of its runs, then merge them again"
        )
    if not meta.complete:
        raise ArchiveError(
            f"{folder} is unfinished, with {meta.births} of {meta.config.evaluations} births: "
            "go on with the build first, or with a smaller budget"
        )


def _begun(meta: read.Meta, folder: Path, rollouts: int | None, brood: int) -> tuple[Calibration, ...]:
    """All calibrations of the archive; the last is the one to go on with."""
    past = meta.calibrations
    missing = past[-1].end - meta.births if past else 0
    if rollouts is None:
        if not missing:
            raise ArchiveError(f"{folder} has no calibration to go on with: say how many births to add")
        return past
    if missing:
        raise ArchiveError(
            f"{folder} has a calibration that lacks {missing} of its {past[-1].births} births: resume it"
        )
    return (*past, Calibration(meta.step + 1, meta.births, int(rollouts), int(brood)))
