"""l-evolvability of every elite of an archive, from the children that it has had already."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain
from nichechain.core.checks import check_positive
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.averaging import ENDLESS, SATURATED, spread_of, summary
from nichechain.evolvability.coverage import LinearOperator, expected_coverage
from nichechain.evolvability.niches import URNS, figures_of
from nichechain.evolvability.question import DRAWS, Convention, Question, dense
from nichechain.evolvability.record import own_strength, recorded_children
from nichechain.evolvability.urns import Record, simulated_coverage
from nichechain.execution.side_by_side import side_by_side

if TYPE_CHECKING:
    import pandas as pd

    from nichechain.archive.archive import Archive

Floats = NDArray[np.float64]


def elite_evolvability(
    archive: Archive,
    *,
    l: int = 5,
    lineages: int = 100,
    strength: float | None = None,
    chain: NicheChain | None = None,
    convention: Convention = "definition",
    draws: int = DRAWS,
    seed: int = 0,
    on_done: Callable[[int], None] | None = None,
) -> pd.DataFrame:
    """Rank all elites by l-evolvability without a single rollout: their recorded children begin the lineages.

    Parameters
    ----------
    archive : Archive
    l, lineages, convention, draws, seed
        As in :func:`nichechain.l_evolvability`.
    strength : float, optional
        As in :func:`nichechain.genotype_evolvability`.
    chain : NicheChain, optional
        By default ``archive.chain()``.
    on_done : callable, optional
        Told how many more draws of T are done.

    Returns
    -------
    pandas.DataFrame
        One row per elite, the largest value first: ``niche`` and its label ``index``, ``uid``,
        ``depth``, ``value``, ``low``, ``high``, ``standard_error``; ``births`` behind the row of its niche
        (-1 where T is given), and ``recorded``, its own children. An elite without any has the value
        of its niche. ``saturated`` and ``method`` are as in :class:`nichechain.Evolvability`.

    Raises
    ------
    NichechainError
        If an argument is out of range, or the archive has no elites.

    Notes
    -----
    What :func:`nichechain.genotype_evolvability` says of each with ``offspring=0``, from
    the same draws of T but other draws of D. Probabilities of visits are computed once for all elites.
    """
    import pandas as pd

    question = Question(l, lineages, convention, draws=draws, seed=seed)
    if strength is not None:
        check_positive(strength=strength)
    n = len(archive.niches)
    elites = archive.elites[np.flatnonzero(archive.elites.niche < n)]
    if not len(elites):
        raise NichechainError("no niche has an elite, so there is none to rank")
    chain = archive.chain() if chain is None else chain
    if chain.states != archive.niches.states:
        raise NichechainError(
            f"chain has {chain.states} states and the archive {archive.niches.states}: "
            "estimate it from the archive's births"
        )
    strength = own_strength(chain) if strength is None else strength
    record = Record(recorded_children(archive, elites.uid), strength)
    question.warn_if_long(chain, len(elites), question.number_of_samples(chain, redraw=True))
    if question.by_urns(chain):
        assert chain.posterior is not None
        found = simulated_coverage(
            chain.posterior,
            question,
            [lineages],
            roots=elites.niche,
            record=record,
            on_done=on_done,
        )
        value, error, low, high = figures_of(chain, found)
        saturated = bool(np.median(value) > SATURATED * n)
    else:
        figures, saturated = _in_closed_form(chain, question, elites.niche, record, on_done)
        value, error, low, high = figures
    births = np.full(n, -1) if chain.births is None else chain.births
    frame = pd.DataFrame(
        {
            "niche": elites.niche,
            "index": [archive.niches.label(int(state)) for state in elites.niche],
            "uid": elites.uid,
            "depth": elites.depth,
            "value": value,
            "low": low,
            "high": high,
            "standard_error": error,
            "births": births[elites.niche],
            "recorded": np.asarray(record.children.sum(axis=1)).ravel(),
            "saturated": saturated,
            "method": URNS if question.by_urns(chain) else "exact",
        }
    )
    return frame.sort_values("value", ascending=False, kind="stable").reset_index(drop=True)


def _in_closed_form(
    chain: NicheChain,
    question: Question,
    niches: NDArray[np.int64],
    record: Record,
    on_done: Callable[[int], None] | None,
) -> tuple[tuple[Floats, Floats, Floats, Floats], bool]:
    """Mean, error and bounds of genotypes in these niches, (K,) each, and whether most are saturated."""
    sizes, n = [question.lineages, ENDLESS], chain.n_niches

    def covered(number: int) -> Floats:
        drawn = question.sample(chain, number)
        known, shares = record.draw(keyed(question.seed, Purpose.FIRST_GENERATION, number))
        first: LinearOperator = _FirstRows(shares, 1.0 - known, drawn.rows, niches)
        if drawn.concentration is not None:
            first = shares.toarray() + (1.0 - known)[:, None] * dense(drawn.children(niches))
        return expected_coverage(drawn.onward, first, question.steps, sizes, counted=n)

    numbers = range(question.number_of_samples(chain, redraw=True))
    found = np.array(side_by_side(covered, numbers, on_done))
    share = found[..., 0] / np.maximum(found[..., 1], 1e-300)
    saturated = bool((np.median(share, axis=1) > SATURATED).any())
    return summary(found[..., 0], np.zeros(found.shape[:2]), spread_of(chain), n), saturated


@dataclass(frozen=True)
class _FirstRows:
    """D of every elite, (K, S): shares of its own children, and the rest from its niche's row of T."""

    shares: sparse.csr_array
    rest: Floats
    transition: LinearOperator
    states: NDArray[np.int64]

    @property
    def shape(self) -> tuple[int, ...]:
        """Elites and states."""
        return len(self.states), self.transition.shape[1]

    def __matmul__(self, other: Floats, /) -> Floats:
        onward: Floats = self.shares @ other
        onward += self.rest[:, None] * (self.transition @ other)[self.states]
        return onward
