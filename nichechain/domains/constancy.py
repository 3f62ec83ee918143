"""Whether a domain gives one behavior for one genotype, which everything after takes for granted."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from nichechain.domains.base import Evaluation

_GENOTYPES = 3


def inconstancy(
    evaluate: Callable[[NDArray[np.float32]], Evaluation],
    evaluate_anew: Callable[[NDArray[np.float32]], Evaluation],
    genotypes: NDArray[np.float32],
) -> str | None:
    """What is wrong with a domain whose behaviors are not functions of the genotype.

    An environment whose reset leaves something of the last episode behind gives other behaviors in
    another order; one that draws without the seed of its reset gives others in another instance.

    Parameters
    ----------
    evaluate : callable
        Of one instance of the domain.
    evaluate_anew : callable
        Of another, which has evaluated nothing yet.
    genotypes : (N, P) float32 array
        Some are enough: each is evaluated three times.

    Returns
    -------
    str or None
        In which way it differs, and by how much; None where nothing does.
    """
    some = genotypes[:_GENOTYPES]
    first = evaluate(some)
    again = evaluate(some[::-1])
    for behavior, how in (
        (again.behavior[::-1], "in another order"),
        (evaluate_anew(some).behavior, "in another instance"),
    ):
        apart = np.abs(behavior.astype(np.float64) - first.behavior.astype(np.float64))
        failed = np.isnan(behavior).any(axis=1) != first.failed
        if failed.any():
            return f"a genotype that is evaluated again {how} fails, or does not, as it did before"
        if np.nanmax(apart, initial=0.0) > 0:
            return f"a genotype that is evaluated again {how} has a behavior {np.nanmax(apart):.3g} away"
    return None
