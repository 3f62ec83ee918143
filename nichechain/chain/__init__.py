"""The Markov chain over niches: counts → estimate → chain."""

from nichechain.chain.counts import TransitionCounts
from nichechain.chain.estimators import ESTIMATORS, UNVISITED, estimate
from nichechain.chain.filters import counts_of
from nichechain.chain.model import NicheChain
from nichechain.chain.posterior import DirichletPosterior

__all__ = [
    "ESTIMATORS",
    "UNVISITED",
    "DirichletPosterior",
    "NicheChain",
    "TransitionCounts",
    "counts_of",
    "estimate",
]
