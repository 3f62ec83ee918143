"""Diversity metrics G of behaviors, and the archive of behaviors they remember.

A metric scores the behaviors of many walks at once; larger means more diverse. One of them,
``evolvability``, scores by offspring that it asks for.
"""

from __future__ import annotations

from collections.abc import Callable

from nichechain.core.checks import check_choice
from nichechain.walks.diversity.kernel import KernelDensity, kernel_density
from nichechain.walks.diversity.metrics import (
    AncestorDistance,
    KNearest,
    Metric,
    OfBehaviors,
    ParentDistance,
    Surroundings,
    ancestor_distance,
    knn_distance,
    parent_distance,
)
from nichechain.walks.diversity.novelty import ArchiveRule, NoveltyArchive
from nichechain.walks.diversity.offspring import OffspringNiches

__all__ = [
    "AncestorDistance",
    "ArchiveRule",
    "KNearest",
    "KernelDensity",
    "Metric",
    "NoveltyArchive",
    "OfBehaviors",
    "OffspringNiches",
    "ParentDistance",
    "Surroundings",
    "ancestor_distance",
    "kernel_density",
    "knn_distance",
    "make",
    "parent_distance",
]

_METRICS: dict[str, Callable[[], Metric]] = {
    "knn": KNearest,
    "knn-no-archive": lambda: KNearest(archive=False),
    "parent": ParentDistance,
    "ancestors": AncestorDistance,
    "kde": KernelDensity,
    "evolvability": OffspringNiches,
}


def make(name: str) -> Metric:
    """The metric of that name with the paper's parameters.

    Parameters
    ----------
    name : {"knn", "knn-no-archive", "parent", "ancestors", "kde", "evolvability"}

    Raises
    ------
    NichechainError
        If there is none.
    """
    check_choice("metric", name, _METRICS)
    return _METRICS[name]()
