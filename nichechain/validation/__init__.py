"""Whether births are a chain's, and whether its predictions come true on lineages really run."""

from nichechain.validation.chapman_kolmogorov import births_test, lineages_test
from nichechain.validation.direct import DirectCheck, Prediction, compare
from nichechain.validation.lineages import Triples
from nichechain.validation.markov import MarkovTest, homogeneity_test, lineage_test, sibling_test
from nichechain.validation.report import Validation, ValidationConfig, validate
from nichechain.validation.rollouts import Lineages, run_lineages, sample_roots
from nichechain.validation.simulate import simulate_births, simulate_lineages

__all__ = [
    "DirectCheck",
    "Lineages",
    "MarkovTest",
    "Prediction",
    "Triples",
    "Validation",
    "ValidationConfig",
    "births_test",
    "compare",
    "homogeneity_test",
    "lineage_test",
    "lineages_test",
    "run_lineages",
    "sample_roots",
    "sibling_test",
    "simulate_births",
    "simulate_lineages",
    "validate",
]
