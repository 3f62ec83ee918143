"""Measures of a behavior landscape: sensitivity, evolvability, dissimila."""

from __future__ import annotations

from nichechain.landscape.archives import OFFSPRING, Correlation, Landscape, measure_archive
from nichechain.landscape.behaviors import (
    EPSILON,
    dissimila_ratio,
    evolvability,
    expected_evolvability,
    expected_global_sensitivity,
    expected_local_sensitivity,
    global_sensitivity,
    hull_volume,
    local_sensitivity,
    one_hot_evolvability,
    population_evolvability,
)
from nichechain.landscape.dissimila import QUANTILES, Dissimila, find_dissimila
from nichechain.landscape.genotypes import GenotypeMeasures, measure, measure_genotypes
from nichechain.landscape.measures import (
    MEASURES,
    LocalMeasures,
    Measure,
    find_measure,
    find_measures,
    measure_behaviors,
)
from nichechain.landscape.niche_table import FEWEST_CHILDREN, niche_table
from nichechain.landscape.populations import population_course

__all__ = [
    "EPSILON",
    "FEWEST_CHILDREN",
    "MEASURES",
    "OFFSPRING",
    "QUANTILES",
    "Correlation",
    "Dissimila",
    "GenotypeMeasures",
    "Landscape",
    "LocalMeasures",
    "Measure",
    "dissimila_ratio",
    "evolvability",
    "expected_evolvability",
    "expected_global_sensitivity",
    "expected_local_sensitivity",
    "find_dissimila",
    "find_measure",
    "find_measures",
    "global_sensitivity",
    "hull_volume",
    "local_sensitivity",
    "measure",
    "measure_archive",
    "measure_behaviors",
    "measure_genotypes",
    "niche_table",
    "one_hot_evolvability",
    "population_course",
    "population_evolvability",
]
