"""What a chain is made of: classes, passage times, wormholes, metastable sets, graphs."""

from nichechain.chain.structure.classes import (
    absorbing_niches,
    communicating_classes,
    period,
    recurrent_classes,
)
from nichechain.chain.structure.committors import ReactiveFlux, committor, reactive_flux
from nichechain.chain.structure.deeptime import to_deeptime
from nichechain.chain.structure.graph import LONG_JUMP, betweenness, reachability_graph
from nichechain.chain.structure.intervals import PosteriorInterval, posterior_interval
from nichechain.chain.structure.metastable import MetastableSets, metastable_sets
from nichechain.chain.structure.passage import hitting_probabilities, mean_first_passage_times
from nichechain.chain.structure.quasi_stationary import QuasiStationary, quasi_stationary_distribution
from nichechain.chain.structure.stationary import entropy_rate, long_run_distribution, stationary_distribution
from nichechain.chain.structure.timescales import implied_timescales, kemeny_constant
from nichechain.chain.structure.wormholes import wormhole_exposure, wormholes

__all__ = [
    "LONG_JUMP",
    "MetastableSets",
    "PosteriorInterval",
    "QuasiStationary",
    "ReactiveFlux",
    "absorbing_niches",
    "betweenness",
    "committor",
    "communicating_classes",
    "entropy_rate",
    "hitting_probabilities",
    "implied_timescales",
    "kemeny_constant",
    "long_run_distribution",
    "mean_first_passage_times",
    "metastable_sets",
    "period",
    "posterior_interval",
    "quasi_stationary_distribution",
    "reachability_graph",
    "reactive_flux",
    "recurrent_classes",
    "stationary_distribution",
    "to_deeptime",
    "wormhole_exposure",
    "wormholes",
]
