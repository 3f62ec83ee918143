"""nichechain measures how many niches the descendants of a genotype will reach.

A MAP-Elites loop records which niche each child came from; the births give a Markov chain over
niches; the chain scores niches and genotypes by l-evolvability.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain._version import __version__ as __version__
from nichechain.core.lazy import lazily

if TYPE_CHECKING:
    from nichechain import domains, landscape, studies, variation, walks
    from nichechain.archive import Archive, Elite, build, calibrate, load
    from nichechain.chain import NicheChain, TransitionCounts, estimate
    from nichechain.core import ArchiveError, NichechainError
    from nichechain.evolvability import (
        Evolvability,
        NicheBand,
        NicheEvolvability,
        bootstrap_elites,
        elite_evolvability,
        genotype_evolvability,
        l_evolvability,
        niche_evolvability,
        prior_sensitivity,
    )
    from nichechain.execution import Threads
    from nichechain.niches import CVTNiches, GridNiches, Niches, one_hot
    from nichechain.pyribs import from_ribs
    from nichechain.search import BuildConfig, curiosity
    from nichechain.verification import Verification, verify
    from nichechain.walks import walk

__all__ = [
    "Archive",
    "ArchiveError",
    "BuildConfig",
    "CVTNiches",
    "Elite",
    "Evolvability",
    "GridNiches",
    "NicheBand",
    "NicheChain",
    "NicheEvolvability",
    "NichechainError",
    "Niches",
    "Threads",
    "TransitionCounts",
    "Verification",
    "bootstrap_elites",
    "build",
    "calibrate",
    "curiosity",
    "domains",
    "elite_evolvability",
    "estimate",
    "from_ribs",
    "genotype_evolvability",
    "l_evolvability",
    "landscape",
    "load",
    "niche_evolvability",
    "one_hot",
    "prior_sensitivity",
    "studies",
    "variation",
    "verify",
    "walk",
    "walks",
]

# NumPy, SciPy and pandas take half a second.
__getattr__, __dir__ = lazily(
    __name__,
    archive="Archive Elite build calibrate load",
    chain="NicheChain TransitionCounts estimate",
    core="ArchiveError NichechainError",
    domains="domains",
    evolvability="Evolvability NicheBand NicheEvolvability bootstrap_elites elite_evolvability "
    "genotype_evolvability l_evolvability niche_evolvability prior_sensitivity",
    execution="Threads",
    landscape="landscape",
    niches="CVTNiches GridNiches Niches one_hot",
    pyribs="from_ribs",
    search="BuildConfig curiosity",
    studies="studies",
    variation="variation",
    verification="Verification verify",
    walks="walk walks",
)
