"""Parents of what evolution strategies emit, which is drawn from a distribution and not from elites."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nichechain.births.table import NONE
from nichechain.core.errors import NichechainError

Ints = NDArray[np.int64]


def is_strategy(emitter: Any) -> bool:
    """Whether an emitter draws solutions from a distribution that it adapts."""
    from ribs.emitters import EvolutionStrategyEmitter, GradientArborescenceEmitter

    return isinstance(emitter, (EvolutionStrategyEmitter, GradientArborescenceEmitter))


def check_draws(emitters: Iterable[Any], archives: Iterable[Any]) -> None:
    """Refuse emitters of which it is known beforehand that nobody could be the parent of what they emit.

    Raises
    ------
    NichechainError
        If an emitter takes solutions from a model, or draws elites from an archive that is none of these.
    """
    from ribs.emitters import BayesianOptimizationEmitter

    filled = [archive for archive in archives if archive is not None]
    for emitter in emitters:
        name = type(emitter).__name__
        if isinstance(emitter, BayesianOptimizationEmitter):
            raise NichechainError(
                f"a {name} takes its solutions from a model and draws no elites, so that nobody is their "
                "parent: record a search whose emitters draw elites"
            )
        if not any(archive is emitter.archive for archive in filled):
            raise NichechainError(
                f"a {name} draws elites from an archive that the search does not add to: it must be the "
                "archive or the result archive of the scheduler"
            )


def centre(emitter: Any) -> NDArray[Any]:
    """Where a strategy stands: the mean of its distribution, flat.

    Raises
    ------
    NichechainError
        If its optimizer does not tell.
    """
    # pyribs has no public name for it, and its optimizers do not agree on a private one.
    for path in ("_grad_opt.theta", "_opt.mean", "_opt.adam_opt.theta"):
        found = emitter
        for name in path.split("."):
            found = getattr(found, name, None)
        if found is not None:
            return np.asarray(found).reshape(-1)
    raise NichechainError(
        f"the optimizer of {type(emitter).__name__} does not tell its mean: "
        'record with strategy_parent="restart"'
    )


@dataclass
class StrategyParent:
    """Who can be the parent of the next batch of one strategy.

    Parameters
    ----------
    restart : int
        Birth of the elite that it restarted from last, ``NONE`` before a restart.
    """

    restart: int = NONE
    _solutions: list[NDArray[Any]] = field(default_factory=list)
    _uids: list[Ints] = field(default_factory=list)
    _step: int = NONE

    def born(self, solutions: NDArray[Any], uid: Ints, step: int) -> None:
        """Births of a batch, (n, P) and (n,), which may come in pieces."""
        if step != self._step:
            self._solutions, self._uids, self._step = [], [], step
        self._solutions.append(solutions)
        self._uids.append(uid)

    def restarted(self, uid: int) -> None:
        """It stands on an elite now, and its last batch no longer counts."""
        self.restart = uid
        self._solutions, self._uids = [], []

    def nearest(self, mean: NDArray[Any]) -> int:
        """The birth of the last batch nearest to a mean (P,); of a restart since, its elite."""
        if not self._uids:
            return self.restart
        distance = np.linalg.norm(np.concatenate(self._solutions) - mean, axis=1)
        return int(np.concatenate(self._uids)[np.argmin(distance)])
