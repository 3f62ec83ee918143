"""What so many of some offspring would have shown, by all ways to choose them."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from itertools import combinations

import numpy as np


def mean_distinct(landed: Iterable[Hashable], size: int, *, nowhere: Iterable[Hashable]) -> float:
    """Mean number of distinct niches over all choices of so many, without those that are no niche."""
    return float(np.mean([len(set(some) - set(nowhere)) for some in combinations(landed, size)]))
