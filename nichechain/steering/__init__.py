"""The chain steers the search: selections of parents that ask what their descendants would do.

The chain of the births so far is kept as they come, see :mod:`nichechain.steering.online`, and elites
become parents by what it foretells of them. All that a selection knows follows from births, so an archive
holds nothing more for it, a build that is resumed draws the parents of one that never stopped, and
``verify`` draws them again.

A selection that asks the chain begins uniformly: the first step has no births with a parent to learn from.
"""

from __future__ import annotations

from nichechain.niches import Niches
from nichechain.search.config import BuildConfig, SelectionName, parse_selection
from nichechain.search.contests import Contests
from nichechain.search.lineages import Stretch
from nichechain.search.parents import CuriousParents
from nichechain.search.selection import Mixture, ParentSelection, Tempered, UniformParents
from nichechain.steering.direct import OffspringCoverage, OffspringLineages
from nichechain.steering.evolvable import EvolvableParents
from nichechain.steering.information import InformedParents
from nichechain.steering.reach import ReachParents

__all__ = ["make_contests", "make_selection"]

_SHARPENED = 0.3
"""Temperature of selections that ask the chain. In trials of ``reach`` on arms and maps, 0.5, 0.3 and 0.2
were about as good as each other, and better than 1."""

_L, _LINEAGES = 5, 100


def make_selection(config: BuildConfig, niches: Niches) -> ParentSelection:
    """The selection of parents that a configuration asks for, before any birth.

    Parameters
    ----------
    config : BuildConfig
    niches : Niches
    """
    parts = parse_selection(config.selection)
    selections = [_make(name, config, niches) for name, _ in parts]
    return selections[0] if len(parts) == 1 else Mixture(selections, [share for _, share in parts])


def make_contests(config: BuildConfig, niches: Niches) -> Contests | None:
    """The contests of a direct search for evolvability, before any birth; None for any other search.

    Parameters
    ----------
    config : BuildConfig
    niches : Niches
    """
    if config.objective == "domain":
        return None
    l, lineages = config.objective_l, config.objective_lineages or config.offspring
    by = OffspringCoverage(niches, lineages) if l == 1 else OffspringLineages(niches, l, lineages)
    contested = len(niches) if niches.outside == "absorb" else niches.states
    return Contests(Stretch.of_build(config), contested, config.offspring, by)


def _make(name: SelectionName, config: BuildConfig, niches: Niches) -> ParentSelection:
    match name:
        case "uniform":
            return UniformParents()
        case "curiosity":
            return Tempered(CuriousParents(), config.temperature or 1.0)
        case "reach":
            l, lineages = config.selection_l or 1, config.selection_lineages or 1
            selection: ParentSelection = ReachParents(niches, config.batch, l, lineages)
        case "l-evolvability":
            selection = EvolvableParents(niches, *_asked(config))
        case "information":
            selection = InformedParents(niches, *_asked(config))
    return Tempered(selection, config.temperature or _SHARPENED)


def _asked(config: BuildConfig) -> tuple[int, int]:
    return config.selection_l or _L, config.selection_lineages or _LINEAGES
