"""What a chain is made of: classes, passage times, wormholes, metastable sets, graphs."""

from nichechain.chain.structure.classes import (
    absorbing_niches,
    betweenness,
    communicating_classes,
    entropy_rate,
    recurrent_classes,
    stationary_distribution,
    to_deeptime,
)
from nichechain.chain.structure.graph import LONG_JUMP, reachability_graph
from nichechain.chain.structure.metastable import MetastableSets, metastable_sets
from nichechain.chain.structure.passage import (
    QuasiStationary,
    hitting_probabilities,
    mean_first_passage_times,
    quasi_stationary_distribution,
)
from nichechain.chain.structure.wormholes import wormholes

__all__ = [
    "LONG_JUMP",
    "MetastableSets",
    "QuasiStationary",
    "absorbing_niches",
    "betweenness",
    "communicating_classes",
    "entropy_rate",
    "hitting_probabilities",
    "mean_first_passage_times",
    "metastable_sets",
    "quasi_stationary_distribution",
    "reachability_graph",
    "recurrent_classes",
    "stationary_distribution",
    "to_deeptime",
    "wormholes",
]
