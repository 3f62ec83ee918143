"""The p-value of a few runs, by all permutations of them or by many."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from nichechain.core.randomness import Purpose, keyed

Floats = NDArray[np.float64]

PERMUTATIONS = 9999
"""Permutations of a test of a few runs; all of them where there are no more."""


def permutation_p(
    samples: Sequence[Floats], test: Callable[..., Any], kind: Literal["independent", "samples"], seed: int
) -> float:
    """The share of permutations with at least this statistic: of all, where those are few enough.

    Of independent samples any value may belong to any; of paired ones values are exchanged within runs.
    """
    from scipy import stats

    found = stats.permutation_test(
        samples,
        lambda *permuted, axis: test(*permuted, axis=axis).statistic,
        permutation_type=kind,
        vectorized=True,
        n_resamples=PERMUTATIONS,
        alternative="greater",
        rng=keyed(seed, Purpose.PERMUTATION),
    )
    return float(found.pvalue)
