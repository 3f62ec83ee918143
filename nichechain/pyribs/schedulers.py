"""The recording of a scheduler."""

from __future__ import annotations

from typing import Any

from nichechain.core.errors import NichechainError
from nichechain.niches import Niches
from nichechain.pyribs.parents import StrategyConvention
from nichechain.pyribs.recording import Outside, Recording, recording_of


def record(
    scheduler: Any,
    *,
    niches: Niches | None = None,
    outside: Outside = "state",
    strategy_parent: StrategyConvention = "mean",
) -> Recording:
    """Record a scheduler of pyribs from now on.

    A scheduler that is being recorded already, such as one that was pickled with its recording, gives
    that recording back.

    Parameters
    ----------
    scheduler : ribs.schedulers.Scheduler or BanditScheduler
        Its archive or its result archive must be a GridArchive or CVTArchive, unless niches are given.
    niches, outside, strategy_parent
        See :class:`Recording`.

    Returns
    -------
    Recording

    Raises
    ------
    NichechainError
        If no archive has cells that last and no niches are given, an emitter draws no elites, or the
        scheduler is being recorded with other settings.
    """
    emitters = getattr(scheduler, "emitter_pool", None)
    if emitters is None:
        emitters = getattr(scheduler, "emitters", None)
    if emitters is None or not hasattr(scheduler, "archive"):
        raise NichechainError(
            f"scheduler is a {type(scheduler).__name__}, but must be a Scheduler or BanditScheduler of "
            "pyribs: an archive that a loop of your own fills is recorded by Recording(archive)"
        )
    before = recording_of(scheduler)
    if before is not None:
        before.check_settings(niches, outside, strategy_parent)
        return before
    result_archive = scheduler.result_archive
    return Recording(
        scheduler.archive,
        emitters,
        result_archive=None if result_archive is scheduler.archive else result_archive,
        niches=niches,
        outside=outside,
        strategy_parent=strategy_parent,
    )
