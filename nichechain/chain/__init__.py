"""The Markov chain over niches: counts → estimate → chain."""

from nichechain.chain.counts import TransitionCounts
from nichechain.chain.estimators import ESTIMATORS, UNVISITED, estimate
from nichechain.chain.model import NicheChain

__all__ = ["ESTIMATORS", "UNVISITED", "NicheChain", "TransitionCounts", "estimate"]
