"""l-evolvability: the number of niches that descendants will reach.

A niche is more *l-evolvable* than another if U lineages of l generations from it visit more
niches in expectation. Two conventions give the paper's "walks of length l + 1" a meaning. Under
``definition`` the root is not its own descendant, so l = 1 is the coverage of the children, as
the paper demands. Under ``procedure`` the root's state counts, as its steps say literally.
"""

from nichechain.evolvability.coverage import expected_coverage, rarefied_coverage, sampled_coverage
from nichechain.evolvability.elites import elite_evolvability
from nichechain.evolvability.genotypes import FirstGeneration, genotype_evolvability
from nichechain.evolvability.meta import MetaEvolvability, meta_evolvability
from nichechain.evolvability.niches import l_evolvability, niche_evolvability
from nichechain.evolvability.question import DRAWS, Convention, Method, Question
from nichechain.evolvability.reach import Reach, reach, visit_probability
from nichechain.evolvability.results import Evolvability, NicheEvolvability
from nichechain.evolvability.uncertainty import NicheBand, bootstrap_elites, prior_sensitivity
from nichechain.evolvability.visits import VisitMetrics, uniformity, visit_entropy, visit_metrics
from nichechain.evolvability.where_to_sample import evolvability_derivative, where_to_sample

__all__ = [
    "DRAWS",
    "Convention",
    "Evolvability",
    "FirstGeneration",
    "MetaEvolvability",
    "Method",
    "NicheBand",
    "NicheEvolvability",
    "Question",
    "Reach",
    "VisitMetrics",
    "bootstrap_elites",
    "elite_evolvability",
    "evolvability_derivative",
    "expected_coverage",
    "genotype_evolvability",
    "l_evolvability",
    "meta_evolvability",
    "niche_evolvability",
    "prior_sensitivity",
    "rarefied_coverage",
    "reach",
    "sampled_coverage",
    "uniformity",
    "visit_entropy",
    "visit_metrics",
    "visit_probability",
    "where_to_sample",
]
