"""The search: what it is asked to do, its elites, the choice of parents, and the MAP-Elites loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain.core.lazy import lazily
from nichechain.search.config import MOST_FAILED, BuildConfig

if TYPE_CHECKING:
    from nichechain.search.making import check_niches, make_domain, make_mutation, make_niches
    from nichechain.search.parents import curiosity

__all__ = [
    "MOST_FAILED",
    "BuildConfig",
    "check_niches",
    "curiosity",
    "make_domain",
    "make_mutation",
    "make_niches",
]

# The command line reads BuildConfig, and its help waits for no NumPy.
__getattr__, __dir__ = lazily(
    __name__, making="check_niches make_domain make_mutation make_niches", parents="curiosity"
)
