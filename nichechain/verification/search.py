"""The search again without an evaluation: what became of each birth is taken from the record.

Parents are drawn from the elites before their step, and elites follow from behaviors and keys. So
with behaviors taken from the record, the search must draw the parents and keep the elites that the
record has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.births.table import NONE, Offspring
from nichechain.domains.base import Domain, Evaluation
from nichechain.niches import Niches
from nichechain.search.config import BuildConfig
from nichechain.search.elites import Elites, SearchState
from nichechain.search.lineages import Stretch, UnderWay
from nichechain.search.map_elites import MapElites
from nichechain.steering import make_contests, make_selection
from nichechain.variation.unborn import Unborn
from nichechain.verification.record import Births, Bools, Run, differs, largest_difference
from nichechain.verification.result import SEARCH, Check

_GROUP = "search"


@dataclass(frozen=True)
class Again:
    """A run's search, made again; births are numbered as in the archive.

    Parameters
    ----------
    births : Births
    state : SearchState
        Where it ends. Genotypes are empty.
    """

    births: Births
    state: SearchState


def search_again(
    run: Run, births: Births, niches: Niches, on_done: Callable[[int], None] | None = None
) -> Again:
    """Run the search with the behaviors of its record, and without genotypes.

    Parameters
    ----------
    run : Run
    births : Births
        Those of the run.
    niches : Niches
    on_done : callable, optional
        Told how many more births have been made again.

    Raises
    ------
    NichechainError
        If no initial birth could have been a parent.
    """
    # MAP-Elites asks no more of a domain than this.
    domain = cast(Domain, _NoGenotypes())
    record = _Record(births.evaluation)
    rows: list[pa.Table] = []
    state = None
    for config, end, stretch in _stretches(run):
        if state is not None:
            state = SearchState.at_rest(state.elites, state.births, state.step)
        selection = make_selection(config, niches)
        # Births that were added to a build contest nothing.
        contests = make_contests(config, niches) if state is None else None
        search = MapElites(
            domain, niches, lambda parent, _: parent, config, state, selection, stretch, contests
        )
        while search.births < end:
            rows.append(search.advance(record, end - search.births, on_done))
        state = search.state
    assert state is not None
    made = Births.of(pa.concat_tables(rows))
    numbered = replace(
        made,
        run=made.run + run.number,
        uid=made.uid + run.first_uid,
        parent_uid=_moved(made.parent_uid, run.first_uid),
    )
    elites = replace(state.elites, uid=state.elites.uid + run.first_uid)
    pending = replace(
        state.pending,
        uid=state.pending.uid + run.first_uid,
        parent_uid=_moved(state.pending.parent_uid, run.first_uid),
    )
    lineages = replace(state.lineages, uid=state.lineages.uid + run.first_uid)
    contenders = replace(state.contenders, uid=state.contenders.uid + run.first_uid)
    ended = replace(state, elites=elites, pending=pending, lineages=lineages, contenders=contenders)
    return Again(numbered, ended)


def _stretches(run: Run) -> Iterator[tuple[BuildConfig, int, Stretch]]:
    """What each stretch of a run follows, and with how many births it ends: the build, then calibrations."""
    built = run.calibrations[0].first_uid if run.calibrations else run.births
    yield run.config, built, Stretch.of_build(run.config)
    uniform = replace(run.config, selection="uniform")
    for each in run.calibrations:
        yield uniform, min(each.end, run.births), each.stretch(uniform)


def check_search(births: Births, again: Births) -> list[Check]:
    """Checks of the choices of searches.

    Parameters
    ----------
    births : Births
        The record.
    again : Births
        The same births, made again.
    """
    parents = (births.parent_uid != again.parent_uid) | (births.parent_niche != again.parent_niche)
    lineage = births.lineage != again.lineage
    kept = births.accepted != again.accepted
    return [
        _check("parents are those that the seed draws", parents, births.uid),
        _check("births of lineages are flagged, and no others", lineage, births.uid),
        _check("births belong to the step of their uid", births.step != again.step, births.uid),
        _check("births are accepted that have the largest key so far", kept, births.uid),
    ]


def check_winners(elites: Elites, winners: Elites) -> list[Check]:
    """Whether elites are the births with the largest keys of their niches.

    Parameters
    ----------
    elites : Elites
        Those of the archive.
    winners : Elites
        Those that follow from the births, of all runs, sorted.
    """
    number = max(len(elites), len(winners))
    if len(elites) != len(winners):
        return [Check("elites have the largest key of their niche", _GROUP, number, number, (), None, SEARCH)]
    wrong = (elites.uid != winners.uid) | (elites.niche != winners.niche)
    keys = differs(elites.key, winners.key) & ~wrong
    return [
        _check("elites have the largest key of their niche", wrong, elites.uid),
        _check(
            "an elite's key is that of its birth",
            keys,
            elites.uid,
            largest_difference(elites.key, winners.key),
        ),
    ]


def check_pending_again(pending: Offspring, again: Offspring) -> list[Check]:
    """Whether children that wait are those that the seed draws."""
    if len(pending) != len(again):
        uids = tuple(again.uid[:1].tolist()) or tuple(pending.uid[:1].tolist())
        number = max(len(pending), len(again))
        return [
            Check(
                "pending children are the rest of the last step", _GROUP, number, number, uids, None, SEARCH
            )
        ]
    wrong = (pending.uid != again.uid) | (pending.parent_uid != again.parent_uid)
    wrong |= (pending.parent_niche != again.parent_niche) | (pending.depth != again.depth)
    wrong |= pending.lineage != again.lineage
    return [_check("pending children are the rest of the last step", wrong, pending.uid)]


def check_lineages_again(lineages: UnderWay, again: UnderWay) -> list[Check]:
    """Whether lineages under way are those that follow from the births."""
    name = "lineages under way are at their latest births"
    if len(lineages) != len(again):
        uids = tuple(again.uid[:1].tolist()) or tuple(lineages.uid[:1].tolist())
        number = max(len(lineages), len(again))
        return [Check(name, _GROUP, number, number, uids, None, SEARCH)]
    wrong = (lineages.slot != again.slot) | (lineages.uid != again.uid)
    wrong |= (lineages.niche != again.niche) | (lineages.depth != again.depth)
    return [_check(name, wrong, lineages.uid)]


def check_contenders_again(contenders: Elites, again: Elites) -> list[Check]:
    """Whether births that contest a niche are those that follow from the births; none where nobody does."""
    name = "contenders are the births that contest a niche"
    if not len(contenders) and not len(again):
        return []
    if len(contenders) != len(again):
        uids = tuple(again.uid[:1].tolist()) or tuple(contenders.uid[:1].tolist())
        number = max(len(contenders), len(again))
        return [Check(name, _GROUP, number, number, uids, None, SEARCH)]
    wrong = (contenders.uid != again.uid) | (contenders.niche != again.niche)
    wrong |= (contenders.depth != again.depth) | differs(contenders.behavior, again.behavior)
    wrong |= differs(contenders.objective, again.objective) | differs(contenders.key, again.key)
    return [_check(name, wrong, contenders.uid)]


def _check(name: str, wrong: Bools, uids: NDArray[np.int64], difference: float | None = None) -> Check:
    return Check.of(name, _GROUP, wrong, uids, difference=difference, depends_on=SEARCH)


def _moved(parent_uid: NDArray[np.int64], by: int) -> NDArray[np.int64]:
    moved: NDArray[np.int64] = np.where(parent_uid == NONE, NONE, parent_uid + by)
    return moved


class _NoGenotypes:
    """A domain whose genotypes have one parameter that nobody looks at."""

    genotype_length = 1

    def sample(self, n: int, *, seed: int | np.random.Generator) -> NDArray[np.float32]:  # noqa: ARG002
        """Zeros, (n, 1)."""
        return np.zeros((n, 1), np.float32)


class _Record:
    """An executor that tells what the record has of the births, which come in order."""

    def __init__(self, evaluation: Evaluation) -> None:
        self._evaluation = evaluation
        self._told = 0

    def evaluate(
        self,
        domain: Domain,  # noqa: ARG002
        genotypes: NDArray[np.float32] | Unborn,
        on_done: Callable[[int], None] | None = None,
    ) -> Evaluation:
        """What became of the next births."""
        rows = slice(self._told, self._told + len(genotypes))
        self._told = rows.stop
        if on_done is not None:
            on_done(len(genotypes))
        of = self._evaluation
        return Evaluation(of.behavior[rows], of.objective[rows], of.failed[rows], of.reasons[rows])
