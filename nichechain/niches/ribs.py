"""Niches as the cells of a pyribs archive, and back."""

from __future__ import annotations

from typing import Any

import numpy as np

from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.niches.base import Niches
from nichechain.niches.cvt import CVTNiches
from nichechain.niches.grid import GridNiches


def niches_of(archive: Any, outside: str) -> Niches:
    """The niches that the cells of a pyribs archive are; both number them alike.

    Parameters
    ----------
    archive : ribs.archives.GridArchive or CVTArchive
    outside : {"state", "absorb", "clip"}

    Raises
    ------
    NichechainError
        If it is another kind of archive.
    """
    from ribs.archives import CVTArchive, GridArchive

    if not isinstance(archive, (CVTArchive, GridArchive)):
        raise NichechainError(
            f"the archive is a {type(archive).__name__}, but must be a GridArchive or a CVTArchive of pyribs"
        )
    bounds = tuple(zip(archive.lower_bounds.tolist(), archive.upper_bounds.tolist(), strict=True))
    if isinstance(archive, GridArchive):
        # By its digits: 1e-6 in float32 is another number, and the same epsilon.
        return GridNiches(tuple(archive.dims.tolist()), bounds, outside, float(str(archive.epsilon)))
    return CVTNiches(archive.centroids.astype(np.float64), bounds, outside)


def empty_archive(niches: Niches, **options: Any) -> Any:
    """A pyribs archive without elites, whose cells are the niches.

    Parameters
    ----------
    niches : GridNiches or CVTNiches
    **options
        Of the archive, such as ``solution_dim``.

    Raises
    ------
    NichechainError
        If the niches are of a kind that pyribs does not have.
    """
    # Importing pyribs takes seconds, which only a search should spend.
    from ribs.archives import CVTArchive, GridArchive

    match niches:
        case GridNiches():
            return GridArchive(dims=niches.shape, ranges=niches.bounds, epsilon=niches.epsilon, **options)
        case CVTNiches():
            return CVTArchive(centroids=niches.centroids, ranges=niches.bounds, **options)
        case _:
            raise NichechainError(
                f"niches are {shown(niches)}, but pyribs has an archive for grid and cvt only"
            )
