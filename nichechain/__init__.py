"""nichechain measures how many niches the descendants of a genotype will reach.

A MAP-Elites loop records which niche each child came from; the births give a Markov chain over
niches; the chain scores niches and genotypes by l-evolvability.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from nichechain._version import __version__ as __version__

if TYPE_CHECKING:
    from nichechain import domains, landscape, studies, variation, walks
    from nichechain.archive.archive import Archive, Elite, load
    from nichechain.archive.build import build
    from nichechain.archive.calibrate import calibrate
    from nichechain.chain import NicheChain, TransitionCounts, estimate
    from nichechain.core.errors import ArchiveError, NichechainError
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
    from nichechain.search.config import BuildConfig
    from nichechain.search.parents import curiosity
    from nichechain.verification import Verification, verify
    from nichechain.walks import walk

# Names are imported when they are first used: NumPy, SciPy and pandas take half a second.
_HOMES = {
    "Archive": "archive.archive",
    "ArchiveError": "core.errors",
    "BuildConfig": "search.config",
    "CVTNiches": "niches",
    "Elite": "archive.archive",
    "Evolvability": "evolvability",
    "GridNiches": "niches",
    "NicheBand": "evolvability",
    "NicheChain": "chain",
    "NicheEvolvability": "evolvability",
    "NichechainError": "core.errors",
    "Niches": "niches",
    "Threads": "execution",
    "TransitionCounts": "chain",
    "Verification": "verification",
    "bootstrap_elites": "evolvability",
    "build": "archive.build",
    "calibrate": "archive.calibrate",
    "curiosity": "search.parents",
    "estimate": "chain",
    "from_ribs": "pyribs",
    "genotype_evolvability": "evolvability",
    "l_evolvability": "evolvability",
    "load": "archive.archive",
    "niche_evolvability": "evolvability",
    "one_hot": "niches",
    "prior_sensitivity": "evolvability",
    "verify": "verification",
    "walk": "walks",
}

_PACKAGES = ("domains", "landscape", "studies", "variation", "walks")

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


def __getattr__(name: str) -> Any:
    if name in _PACKAGES:
        return importlib.import_module(f"nichechain.{name}")
    if name in _HOMES:
        return getattr(importlib.import_module(f"nichechain.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'nichechain' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
