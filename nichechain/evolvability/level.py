"""Mean l-evolvability over niches on one draw of T: a figure of a whole chain, for comparisons of chains.

Cheaper than the values of all niches: beyond a thousand states a few niches stand for all, with no more
lineages than are asked for.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.estimators import with_posterior
from nichechain.chain.lineages import urns_of
from nichechain.chain.posterior import DirichletPosterior
from nichechain.core.randomness import Purpose, keyed
from nichechain.evolvability.coverage import expected_coverage
from nichechain.evolvability.question import Question
from nichechain.evolvability.urns import covered

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_ROOTS = 200
"""Niches that stand for all of a large chain."""


def level(posterior: DirichletPosterior, roots: Ints, question: Question, sizes: list[int]) -> Floats:
    """Mean over niches of the niches that U lineages of each visit, on one draw of T, (k,).

    Parameters
    ----------
    posterior : DirichletPosterior
    roots : (m,) int64 array
        The niches, in order.
    question : Question
        Generations, and the seed of the draw.
    sizes : list of int
        Numbers U of lineages.

    Notes
    -----
    In closed form up to a thousand states. Beyond, 200 niches spread evenly over those that are asked
    for stand for them, and their lineages are simulated as in :mod:`nichechain.evolvability.urns`.
    """
    chain = with_posterior(posterior.counts, posterior, "a draw")
    if question.by_urns(chain):
        few = np.unique(np.linspace(0, roots.size - 1, min(roots.size, MOST_ROOTS)).astype(np.int64))
        lineages = max(2, *sizes)
        urns = urns_of(posterior, keyed(question.seed, Purpose.POSTERIOR, 0))
        rng = keyed(question.seed, Purpose.WALKS, 0)
        first = np.repeat(roots[few], lineages).reshape(-1, lineages)
        states = urns.walks(first, question.l, rng, roots=True)
        found, _ = covered(states[:, lineages:], lineages, sizes, chain.n_niches)
    else:
        (drawn,) = replace(question, draws=1).samples(chain)
        first_rows = drawn.children(roots)
        found = expected_coverage(drawn.onward, first_rows, question.l, sizes, counted=chain.n_niches)
    mean: Floats = found.mean(axis=0)
    return mean
