"""Which niches lineages of one root visit, by lineages that draw rows of T as they enter them.

See :mod:`nichechain.evolvability.urns`: of many states, cost follows descendants, not niches.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.lineages import urns_of
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.urns import Simulated, hit_probabilities
from nichechain.execution.side_by_side import side_by_side

if TYPE_CHECKING:
    from nichechain.chain.posterior import DirichletPosterior
    from nichechain.evolvability.question import Question

Floats = NDArray[np.float64]

# Descendants of a draw: niches that few lineages visit need many of them.
_DESCENDANTS = 200_000


def simulated_reach(
    posterior: DirichletPosterior,
    question: Question,
    root: int | None,
    offspring: Floats,
    on_done: Callable[[int], None] | None = None,
) -> tuple[Floats, Floats, Simulated]:
    """How sure lineages of a root are to visit each niche, on draws of T that are made as they are needed.

    Parameters
    ----------
    posterior : DirichletPosterior
    question : Question
    root : int, optional
        The state that the root stands in.
    offspring : (S,) float64 array
        Where its children are, if it stands nowhere.
    on_done : callable, optional
        Told how many more draws are done.

    Returns
    -------
    (n,) float64 array
        Estimates of h, the probability that one lineage visits a niche.
    (n,) float64 array
        How often one lineage does in expectation.
    Simulated
        Whether at least one of U lineages visits each of the n niches, in place of the coverage of n roots.
    """
    counts_first = root is None or question.root_counts
    moves = question.steps - counts_first
    lineages = max(2 * question.lineages, _DESCENDANTS // (moves + 1))
    half = lineages // 2
    sizes = (lineages, half, lineages - half)
    tables = [hit_probabilities(size, question.lineages) for size in sizes]

    def on_draw(number: int) -> tuple[Floats, Floats, Floats, Floats]:
        rng = keyed(question.seed, Purpose.WALKS, number)
        urns = urns_of(posterior, keyed(question.seed, Purpose.POSTERIOR, number))
        if root is None:
            first = rng.choice(offspring.size, (1, lineages), p=offspring / offspring.sum())
        else:
            first = np.full((1, lineages), root)
        states = urns.walks(first.astype(np.int64), moves, rng, roots=root is not None)
        # (generations that count, lineages)
        seen = states.reshape(moves + 1, lineages)[0 if counts_first else 1 :]
        n = urns.niches
        passes = np.bincount(seen.ravel(), minlength=n + 1)[:n] / lineages
        # Each state once for each lineage.
        lineage, state = np.divmod(np.unique(np.arange(lineages) * (n + 1) + seen), n + 1)
        visitors = np.bincount(state, minlength=n + 1)[:n]
        early = np.bincount(state[lineage < half], minlength=n + 1)[:n]
        some, one, other = (
            table[count] for table, count in zip(tables, (visitors, early, visitors - early), strict=True)
        )
        return visitors / lineages, passes, some, (one - other) ** 2 / 4.0

    found = side_by_side(on_draw, range(question.draws), on_done)
    visit, passes, some, noise = (np.array(each) for each in zip(*found, strict=True))
    return visit.mean(axis=0), passes.mean(axis=0), Simulated(some[:, :, None], noise[:, :, None])
