"""nichechain measures how many niches the descendants of a genotype will reach.

A MAP-Elites loop records which niche each child came from; the births give a Markov chain over
niches; the chain scores niches and genotypes by l-evolvability.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain._version import __version__ as __version__
from nichechain.core.lazy import lazy

if TYPE_CHECKING:
    from nichechain import domains, landscape, studies, variation, walks
    from nichechain.archive import Archive, Elite, load
    from nichechain.archive.building import build
    from nichechain.chain import NicheChain, TransitionCounts, estimate
    from nichechain.core import ArchiveError, NichechainError
    from nichechain.evolvability import (
        Evolvability,
        NicheBand,
        NicheEvolvability,
        bootstrap_elites,
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

_HOMES = {
    "Archive": "archive",
    "ArchiveError": "core",
    "BuildConfig": "search",
    "CVTNiches": "niches",
    "Elite": "archive",
    "Evolvability": "evolvability",
    "GridNiches": "niches",
    "NicheBand": "evolvability",
    "NicheChain": "chain",
    "NicheEvolvability": "evolvability",
    "NichechainError": "core",
    "Niches": "niches",
    "Threads": "execution",
    "TransitionCounts": "chain",
    "Verification": "verification",
    "bootstrap_elites": "evolvability",
    "build": "archive",
    "curiosity": "search",
    "domains": "domains",
    "estimate": "chain",
    "from_ribs": "pyribs",
    "genotype_evolvability": "evolvability",
    "l_evolvability": "evolvability",
    "landscape": "landscape",
    "load": "archive",
    "niche_evolvability": "evolvability",
    "one_hot": "niches",
    "prior_sensitivity": "evolvability",
    "studies": "studies",
    "variation": "variation",
    "verify": "verification",
    "walk": "walks",
    "walks": "walks",
}

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
    "curiosity",
    "domains",
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

__getattr__, __dir__ = lazy(__name__, _HOMES)
