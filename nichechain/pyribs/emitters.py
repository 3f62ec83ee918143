"""The mutation operators of nichechain as an emitter of pyribs."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from ribs.emitters import EmitterBase

from nichechain.core.checks import as_floats, check_at_least, check_seed
from nichechain.core.errors import NichechainError
from nichechain.variation import Mutation


class MutationEmitter(EmitterBase):
    """Emits children of elites drawn uniformly, made by a mutation operator.

    Parameters
    ----------
    archive : ribs.archives.ArchiveBase
        Of solutions with one axis.
    mutate : Mutation
        Such as of :func:`nichechain.variation.make`.
    initial_solutions : (n, solution_dim) array
        Emitted once, while the archive is empty.
    batch_size : int
        Children of an iteration, at least 1.
    seed : int, optional
        Of the mutations; elites are drawn with the archive's own generator.

    Raises
    ------
    NichechainError
        If the batch is empty, or the initial solutions do not fit the archive.
    """

    def __init__(
        self,
        archive: Any,
        mutate: Mutation,
        *,
        initial_solutions: ArrayLike,
        batch_size: int = 64,
        seed: int | None = None,
    ) -> None:
        super().__init__(
            archive, solution_dim=archive.solution_dim, bounds=None, lower_bounds=None, upper_bounds=None
        )
        initial = as_floats("initial_solutions", initial_solutions).astype(archive.dtypes["solution"])
        if initial.ndim != 2 or not len(initial) or initial.shape[1] != archive.solution_dim:
            raise NichechainError(
                f"initial solutions have shape {initial.shape}, but must be (n, {archive.solution_dim})"
            )
        check_at_least(1, batch_size=batch_size)
        if seed is not None:
            check_seed(seed)
        self.batch_size = batch_size
        self._initial = initial
        self._mutate = mutate
        self._rng = np.random.default_rng(seed)

    def ask(self) -> NDArray[Any]:
        """Children of elites, (batch_size, solution_dim); the initial ones of an empty archive."""
        if self.archive.empty:
            return self._initial.copy()
        parents = self.archive.sample_elites(self.batch_size)["solution"]
        return np.stack([self._mutate(parent, self._rng) for parent in parents])
