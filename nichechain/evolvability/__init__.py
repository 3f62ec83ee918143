"""l-evolvability: the number of niches that descendants will reach.

A niche is more *l-evolvable* than another if U lineages of l generations from it visit more
niches in expectation. Two conventions give the paper's "walks of length l + 1" a meaning. Under
``definition`` the root is not its own descendant, so l = 1 is the coverage of the children, as
the paper demands. Under ``procedure`` the root's state counts, as its steps say literally.
"""

from nichechain.evolvability.genotypes import FirstGeneration, genotype_evolvability
from nichechain.evolvability.niches import l_evolvability, niche_evolvability
from nichechain.evolvability.question import DRAWS, Convention, Method, Question
from nichechain.evolvability.results import Evolvability, NicheEvolvability
from nichechain.evolvability.uncertainty import NicheBand, bootstrap_elites, prior_sensitivity

__all__ = [
    "DRAWS",
    "Convention",
    "Evolvability",
    "FirstGeneration",
    "Method",
    "NicheBand",
    "NicheEvolvability",
    "Question",
    "bootstrap_elites",
    "genotype_evolvability",
    "l_evolvability",
    "niche_evolvability",
    "prior_sensitivity",
]
