"""Archives of pyribs as archives of nichechain, and back."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from nichechain.archive.imported import Axes, write_archive
from nichechain.births.orphans import orphan_note
from nichechain.births.table import NONE, Offspring, make_table
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Evaluation
from nichechain.niches.ribs import empty_archive, niches_of
from nichechain.pyribs.recording import Recording, recording_of
from nichechain.search.config import WHO_IS_ELITE
from nichechain.search.elites import Elites, SearchState

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive

_OF_ELITES = (
    "a finished archive of pyribs has its elites and not whom they came from, so T cannot be estimated from "
    "it: record the next search with nichechain.pyribs.record(scheduler)"
)


def from_ribs(
    source: Any,
    folder: str | Path,
    *,
    axes: Axes | None = None,
    objective_name: str = "objective",
    overwrite: bool = False,
) -> Archive:
    """Write a search of pyribs as an archive folder.

    It warns if most births after the first batch have no known parent.

    Parameters
    ----------
    source : Recording, or what is being recorded, or ribs.archives.GridArchive or CVTArchive
        A recording has births, and with them counts and a chain; its scheduler or archive stands for
        it. A finished archive has no more than its elites: each becomes an initial birth, and nothing
        is known of who came from where.
    folder : path
        Where the archive goes.
    axes : Axes, optional
        What the measures are called, and their unit.
    objective_name : str
        What the objective is, with its unit.
    overwrite : bool
        Whether an archive that the folder holds may go, if it was imported like this one.

    Returns
    -------
    Archive

    Raises
    ------
    NichechainError
        If the source is of another kind or empty, or the axes do not fit.
    ArchiveError
        If the folder holds an archive that must stay.

    Notes
    -----
    Genotypes become float32. Of elites of edge cells whose measures are out of range, which a
    recording keeps apart, the one of the largest objective stands for the outside state.
    """
    import ribs

    from nichechain.archive.archive import load

    source = recording_of(source) or source
    if isinstance(source, Recording):
        archive, niches, rows = source.home, source.niches, source.births()
        cells, uid, depth = source.elites()
        step = source.step
        emitters = source.conventions()
    else:
        if hasattr(source, "ask") and hasattr(source, "archive"):
            raise NichechainError(
                f"source is a {type(source).__name__} that is not being recorded, so nothing is known of its "
                "births: it must be recorded before its loop, as in recording = record(scheduler)"
            )
        archive, niches = source, niches_of(source, "clip")
        cells = source.data("index").astype(np.int64)
        uid, depth = np.arange(cells.size), np.zeros(cells.size, np.int64)
        rows = _as_births(source, cells)
        step = 0
        emitters = []
    if not len(rows):
        raise NichechainError("there are no births yet: run the search first")
    elites = _elites(archive, niches, cells, uid, depth)
    origin = {
        "kind": "imported",
        "program": f"pyribs {ribs.__version__}",
        "archive": type(source.archive if isinstance(source, Recording) else source).__name__,
        "emitters": emitters,
    }
    state = SearchState.at_rest(elites, len(rows), step)
    write_archive(
        folder,
        niches,
        rows,
        origin,
        axes or Axes(),
        state=state,
        objective_name=objective_name,
        overwrite=overwrite,
    )
    note = orphan_note(rows) if isinstance(source, Recording) else _OF_ELITES
    if note is not None:
        warnings.warn(note, stacklevel=2)
    return load(folder)


def to_ribs(archive: Archive) -> Any:
    """The elites of an archive as an archive of pyribs, with the fields ``uid`` and ``depth``.

    Parameters
    ----------
    archive : Archive

    Returns
    -------
    ribs.archives.GridArchive or CVTArchive
        Its objective is the domain's, not what decided about replacement here: where that is another,
        it warns which births the elites are. The elite of the outside state is left out: pyribs would
        put it in a cell that it is not in.

    Raises
    ------
    NichechainError
        If the archive has births but no elites.
    """
    elites = archive.elites[archive.elites.niche < len(archive.niches)]
    if not len(elites):
        raise NichechainError(f"{archive.folder} has no elites in its niches, and pyribs keeps nothing else")
    rule = archive.config.replacement
    if rule != "objective":
        warnings.warn(
            f"the elites are {WHO_IS_ELITE[rule]} of each niche and not the best (replacement: {rule}), "
            "and so is what pyribs says of their objectives",
            stacklevel=2,
        )
    made = empty_archive(
        archive.niches,
        solution_dim=elites.genotype.shape[1],
        solution_dtype=np.float32,
        objective_dtype=np.float64,
        measures_dtype=np.float64,
        extra_fields={"uid": ((), np.int64), "depth": ((), np.int64)},
    )
    made.add(elites.genotype, elites.objective, elites.behavior, uid=elites.uid, depth=elites.depth)
    return made


def _elites(archive: Any, niches: Any, cells: Any, uid: Any, depth: Any) -> Elites:
    """Elites of pyribs, sorted by state."""
    data = archive.data(["solution", "objective", "measures"])
    behavior = data["measures"].astype(np.float64)
    objective = data["objective"].astype(np.float64)
    state = cells.copy()
    if niches.outside != "clip":
        inside = ((behavior >= niches.lower) & (behavior <= niches.upper)).all(axis=1)
        state[~inside] = len(niches)
    genotype = data["solution"].reshape(len(state), -1).astype(np.float32)
    return Elites(state, genotype, behavior, objective, objective, uid, depth).winners()


def _as_births(archive: Any, cells: Any) -> pa.Table:
    """The elites of a finished archive, each an initial birth in its cell."""
    data = archive.data(["objective", "measures"])
    size = cells.size
    none = np.full(size, NONE, np.int64)
    offspring = Offspring(
        np.empty((size, 0), np.float32),
        np.arange(size),
        none,
        none,
        np.zeros(size, np.int64),
        np.zeros(size, bool),
    )
    evaluation = Evaluation(
        data["measures"].astype(np.float64),
        data["objective"].astype(np.float64),
        np.zeros(size, bool),
        ("",) * size,
    )
    return make_table(offspring, evaluation, child_niche=cells, accepted=np.ones(size, bool), step=0)
