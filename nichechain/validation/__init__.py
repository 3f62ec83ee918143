"""Whether births are a chain's, and whether its predictions come true on lineages really run."""

from nichechain.validation.chapman_kolmogorov import births_test, lineages_test
from nichechain.validation.contrast import Contrast, ContrastRow, contrast
from nichechain.validation.direct import DirectCheck, Prediction, compare
from nichechain.validation.drift import LevelCourse, LevelDrift, level_course, level_drift
from nichechain.validation.grid_size import GridSize, Sweep, sweep
from nichechain.validation.held_out import Comparison, compare_estimators
from nichechain.validation.lineages import Triples
from nichechain.validation.markov import MarkovTest, homogeneity_test, lineage_test, sibling_test
from nichechain.validation.report import Validation, ValidationConfig, validate
from nichechain.validation.rollouts import Lineages, run_lineages, sample_roots
from nichechain.validation.simulate import simulate_births, simulate_lineages
from nichechain.validation.stability import RankStability, rank_stability

__all__ = [
    "Comparison",
    "Contrast",
    "ContrastRow",
    "DirectCheck",
    "GridSize",
    "LevelCourse",
    "LevelDrift",
    "Lineages",
    "MarkovTest",
    "Prediction",
    "RankStability",
    "Sweep",
    "Triples",
    "Validation",
    "ValidationConfig",
    "births_test",
    "compare",
    "compare_estimators",
    "contrast",
    "homogeneity_test",
    "level_course",
    "level_drift",
    "lineage_test",
    "lineages_test",
    "rank_stability",
    "run_lineages",
    "sample_roots",
    "sibling_test",
    "simulate_births",
    "simulate_lineages",
    "sweep",
    "validate",
]
