"""What the paper reports of its two experiments, to set beside our own numbers ("Results")."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

DOMAIN = "fetch"
"""The domain of both experiments."""

RUNS = 50
"""Walks of each condition."""

FIGURE_STEP = 50
"""Steps of the walks in both figures, and where the pressure experiment is tested."""

METRICS_STEP = 100
"""Step whose values the text tests in the metric experiment, though its figure ends at 50."""

PRESSURE_R = 0.7106
"""Spearman's rank correlation of pressure with evolvability at the last step."""

PRESSURE_P = 1e-46
"""Bound that its p-value stays below."""

METRICS = ("kde", "knn", "knn-no-archive", "ancestors")
"""Diversity metrics that are compared; the distance to the parent is not among them."""

METRICS_P = 0.01943
"""p-value of the Kruskal-Wallis test between them."""

METRICS_HOLM: Mapping[tuple[str, str], float] = MappingProxyType(
    {
        ("kde", "knn"): 0.053031,
        ("kde", "knn-no-archive"): 0.052218,
        ("kde", "ancestors"): 0.040418,
        ("knn", "knn-no-archive"): 1.0,
        ("knn", "ancestors"): 1.0,
        ("knn-no-archive", "ancestors"): 1.0,
    }
)
"""p-values of Conover's test with Holm's adjustment, pair by pair."""
