"""Archives of pyribs as archives of nichechain, and back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from nichechain.archive.imported import Axes, write_archive
from nichechain.births.table import NONE, Offspring, make_table
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Evaluation
from nichechain.niches.ribs import empty_archive, niches_of
from nichechain.pyribs.recording import Recording
from nichechain.search.elites import Elites, SearchState

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive


def from_ribs(
    source: Any, folder: str | Path, *, axes: Axes | None = None, objective_name: str = "objective"
) -> Archive:
    """Write a search of pyribs as an archive folder.

    Parameters
    ----------
    source : Recording or ribs.archives.GridArchive or CVTArchive
        A recording has births, and with them counts and a chain. A finished archive has no more
        than its elites: each becomes an initial birth, and nothing is known of who came from where.
    folder : path
        Where the archive goes; it must not hold one.
    axes : Axes, optional
        What the measures are called, and their unit.
    objective_name : str
        What the objective is, with its unit.

    Returns
    -------
    Archive

    Raises
    ------
    NichechainError
        If the source is of another kind or empty, or the axes do not fit.
    ArchiveError
        If the folder holds an archive.

    Notes
    -----
    Genotypes become float32. Of elites of edge cells whose measures are out of range, which a
    recording keeps apart, the one of the largest objective stands for the outside state.
    """
    import ribs

    from nichechain.archive.archive import load

    if isinstance(source, Recording):
        archive, niches, rows = source.archive, source.niches, source.births()
        cells, uid, depth = source.elites()
        step = source.step
        emitters = source.conventions()
    else:
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
        "archive": type(archive).__name__,
        "emitters": emitters,
    }
    state = SearchState.at_rest(elites, len(rows), step)
    write_archive(folder, niches, rows, origin, axes or Axes(), state=state, objective_name=objective_name)
    return load(folder)


def to_ribs(archive: Archive) -> Any:
    """The elites of an archive as an archive of pyribs, with the fields ``uid`` and ``depth``.

    Parameters
    ----------
    archive : Archive

    Returns
    -------
    ribs.archives.GridArchive or CVTArchive
        Its objective is the domain's, not what decided about replacement here. The elite of the
        outside state is left out: pyribs would put it in a cell that it is not in.

    Raises
    ------
    NichechainError
        If the archive has births but no elites.
    """
    elites = archive.elites[archive.elites.niche < len(archive.niches)]
    if not len(elites):
        raise NichechainError(f"{archive.folder} has no elites in its niches, and pyribs keeps nothing else")
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
