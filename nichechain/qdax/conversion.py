"""A recorded search of QDax as an archive of nichechain."""

from __future__ import annotations

import warnings
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax
import numpy as np
from numpy.typing import NDArray

from nichechain.archive.imported import Axes, write_archive
from nichechain.births.orphans import orphan_note
from nichechain.core.checks import as_bounds, check_choice
from nichechain.core.errors import NichechainError
from nichechain.niches import CVTNiches, GridNiches, Niches
from nichechain.niches.base import Bounds, is_inside, precision_of
from nichechain.qdax.blocks import DeviceBlock
from nichechain.qdax.emitter import RecordingEmitter, RecordingState
from nichechain.search.elites import Elites, SearchState

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive

_CONVENTION = "the elite that was selected; of two that were crossed, the first"


def from_qdax(
    emitter: RecordingEmitter,
    repertoire: Any,
    emitter_state: RecordingState,
    folder: str | Path,
    *,
    bounds: Bounds,
    outside: str = "state",
    axes: Axes | None = None,
    objective_name: str = "objective",
    overwrite: bool = False,
) -> Archive:
    """Write a search of QDax as an archive folder.

    Parameters
    ----------
    emitter : RecordingEmitter
        That of the search.
    repertoire : qdax.core.containers.mapelites_repertoire.MapElitesRepertoire
    emitter_state : RecordingState
        As the search has returned it, beside its repertoire.
    folder : path
        Where the archive goes.
    bounds : tuple of (float, float)
        What the centroids were made for: lower and upper bound of each descriptor.
    outside : {"state", "clip"}
        Where descriptors out of bounds belong. QDax puts them in the cell of the nearest centroid
        without a word; ``state`` records them in a state of their own, ``clip`` in that cell.
    axes : Axes, optional
        What the descriptors are called, and their unit.
    objective_name : str
        What the fitness is, with its unit.
    overwrite : bool
        Whether an archive that the folder holds may go, if it was imported like this one.

    Returns
    -------
    Archive
        Its niches are a grid where the centroids are those of one over the bounds, or else a
        tessellation. Genotypes are flat: leaves of a pytree one after the other, as float32.

    Raises
    ------
    NichechainError
        If emitter, state and repertoire do not belong together, or the bounds do not fit.
    ArchiveError
        If the folder holds an archive that must stay.
    """
    from nichechain.archive.archive import load

    check_choice("outside", outside, ("state", "clip"))
    if not isinstance(emitter, RecordingEmitter):
        raise NichechainError(f"emitter is a {type(emitter).__name__}, but must be a RecordingEmitter")
    if not isinstance(emitter_state, RecordingState):
        raise NichechainError(
            f"emitter_state is a {type(emitter_state).__name__}, but must be what the search returned"
        )
    centroids = np.asarray(repertoire.centroids, np.float64)
    niches, number = niches_of(centroids, as_bounds(bounds), outside)

    def state_of(cell: NDArray[np.int64], descriptor: NDArray[Any]) -> NDArray[np.int64]:
        state = number[cell]
        if outside == "state":
            wide = descriptor.astype(np.float64)
            state[~is_inside(wide, niches.bounds, precision_of(descriptor))] = len(niches)
        return state

    # Blocks may still be on their way.
    jax.effects_barrier()
    run, steps = int(emitter_state.run), int(emitter_state.steps)
    if run >= len(emitter.runs):
        raise NichechainError(f"emitter_state is of run {run}, which must be of this emitter, and is not")
    block = DeviceBlock.copied(emitter_state.block)
    rows = emitter.runs[run].table(block[: steps % len(block.parent)], steps, state_of)
    elites = _elites(repertoire, np.asarray(emitter_state.uid), rows["depth"].to_numpy(), state_of)
    origin = {
        "kind": "imported",
        "program": f"QDax {version('qdax')}",
        "archive": type(repertoire).__name__,
        "emitters": [{"emitter": type(emitter.emitter).__name__, "parent": _CONVENTION}],
    }
    state = SearchState.at_rest(elites, len(rows), steps)
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
    note = orphan_note(rows)
    if note is not None:
        warnings.warn(note, stacklevel=2)
    return load(folder)


def niches_of(
    centroids: NDArray[np.float64], bounds: Bounds, outside: str
) -> tuple[Niches, NDArray[np.int64]]:
    """The niches that the cells of a repertoire are, and the number of each cell's niche, (C,).

    Raises
    ------
    NichechainError
        If centroids and bounds do not fit together.
    """
    places = [np.unique(np.round(axis, 6)) for axis in centroids.T]
    shape = tuple(len(each) for each in places)
    if len(bounds) == len(shape) and int(np.prod(shape)) == len(centroids):
        grid = GridNiches(shape, bounds, outside)
        number = grid.of(np.clip(centroids, grid.lower, grid.upper))
        close = 1e-3 * (grid.upper - grid.lower) / np.array(shape)
        # QDax numbers the cells of a grid in an order of its own.
        if (
            len(np.unique(number)) == len(centroids)
            and (np.abs(grid.centers[number] - centroids) <= close).all()
        ):
            return grid, number
    return CVTNiches(centroids, bounds, outside), np.arange(len(centroids))


def _elites(repertoire: Any, uid: NDArray[Any], depth: NDArray[Any], state_of: Any) -> Elites:
    """Elites of a repertoire, sorted by state; of several out of bounds the fittest."""
    fitness = np.asarray(repertoire.fitnesses, np.float64)[:, 0]
    cell = np.flatnonzero(np.isfinite(fitness))
    leaves = [np.asarray(leaf)[cell].reshape(len(cell), -1) for leaf in jax.tree.leaves(repertoire.genotypes)]
    descriptor = np.asarray(repertoire.descriptors)[cell]
    born = uid[cell].astype(np.int64)
    return Elites(
        state_of(cell, descriptor),
        np.concatenate(leaves, axis=1).astype(np.float32),
        descriptor.astype(np.float64),
        fitness[cell],
        fitness[cell],
        born,
        depth[born].astype(np.int64),
    ).winners()
