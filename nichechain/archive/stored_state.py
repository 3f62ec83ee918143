"""The state of a search as the file of elites holds it: plain arrays, made a state again and checked."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any

import numpy as np

from nichechain.archive import untrusted
from nichechain.births.table import Offspring
from nichechain.search.config import BuildConfig
from nichechain.search.elites import Elites, SearchState
from nichechain.search.lineages import Stretch, UnderWay

_INTS, _FLOATS, _GENOTYPES = (np.int64, 1), (np.float64, 1), (np.float32, 2)
_ARRAYS: dict[str, tuple[Any, int]] = {
    "niche": _INTS,
    "genotype": _GENOTYPES,
    "behavior": (np.float64, 2),
    "objective": _FLOATS,
    "key": _FLOATS,
    "uid": _INTS,
    "depth": _INTS,
    "pending_genotype": _GENOTYPES,
    "pending_uid": _INTS,
    "pending_parent_uid": _INTS,
    "pending_parent_niche": _INTS,
    "pending_depth": _INTS,
}
# Files without any lineage lack these.
_LINEAGE_ARRAYS: dict[str, tuple[Any, int]] = {
    "pending_lineage": (np.bool_, 1),
    "lineage_slot": _INTS,
    "lineage_genotype": _GENOTYPES,
    "lineage_uid": _INTS,
    "lineage_niche": _INTS,
    "lineage_depth": _INTS,
}
# And without a contest that goes on, these.
_CONTENDER_ARRAYS: dict[str, tuple[Any, int]] = {
    f"contender_{field.name}": _ARRAYS[field.name] for field in fields(Elites)
}


def parse_state(
    content: bytes, config: BuildConfig, births: int, step: int, *, of_build: bool
) -> SearchState:
    """The state that the bytes of such a file hold.

    Parameters
    ----------
    content : bytes
    config : BuildConfig
        Of the archive, as are the numbers of its births and of its last step.
    births, step : int
    of_build : bool
        Whether a build alone made it, so that births end where one of its steps may end.

    Raises
    ------
    ValueError
        If it is none that a search could have been in.
    """
    arrays = untrusted.read_arrays(content, _ARRAYS, _LINEAGE_ARRAYS, _CONTENDER_ARRAYS)
    elites = Elites(*(arrays[field.name] for field in fields(Elites)))
    arrays.setdefault("pending_lineage", np.zeros(len(arrays["pending_uid"]), bool))
    pending = Offspring(*(arrays[f"pending_{field.name}"] for field in fields(Offspring)))
    lineages = UnderWay.none(elites.genotype.shape[1])
    if "lineage_slot" in arrays:
        lineages = UnderWay(*(arrays[f"lineage_{field.name}"] for field in fields(UnderWay)))
    contenders = Elites.none(elites.genotype.shape[1], elites.behavior.shape[1])
    if "contender_uid" in arrays:
        contenders = Elites(*(arrays[f"contender_{field.name}"] for field in fields(Elites)))
    state = SearchState(elites, pending, births, step, lineages, contenders)
    _check_state(state, config)
    if of_build:
        _check_step(state, config)
    return state


def _check_state(state: SearchState, config: BuildConfig) -> None:
    # The largest state that there can be.
    outside = math.prod(config.shape)
    elites, pending, lineages, contenders = state.elites, state.pending, state.lineages, state.contenders
    for rows in (elites, pending, lineages, contenders):
        if len({len(column) for column in rows.columns().values()}) != 1:
            raise ValueError("its arrays differ in length")
    if elites.behavior.shape[1] != len(config.bounds):
        raise ValueError(f"its behaviors have {elites.behavior.shape[1]} axes")
    if len(pending) and pending.grown().shape[1] != elites.genotype.shape[1]:
        raise ValueError("its genotypes differ in length")
    if len(lineages) and lineages.genotype.shape[1] != elites.genotype.shape[1]:
        raise ValueError("its genotypes differ in length")
    if contenders.genotype.shape[1] != elites.genotype.shape[1]:
        raise ValueError("its genotypes differ in length")
    if contenders.behavior.shape[1] != elites.behavior.shape[1]:
        raise ValueError("its behaviors differ in their axes")
    if not np.isin(contenders.niche, elites.niche).all():
        raise ValueError("its contenders are in niches that nobody holds")
    if (np.diff(lineages.slot, prepend=-1) <= 0).any():
        raise ValueError("its lineages are in no order")
    if (np.diff(elites.niche, prepend=-1) <= 0).any() or (elites.niche > outside).any():
        raise ValueError("its elites are in no order, or in niches that do not exist")
    if ((lineages.niche < 0) | (lineages.niche > outside)).any():
        raise ValueError("its lineages are in niches that do not exist")


def _check_step(state: SearchState, config: BuildConfig) -> None:
    """Refuse births that do not end in the step that a build of that configuration was in."""
    births, step, pending = state.births, state.step, state.pending
    begins, ends = (-1, 0) if step < 0 else Stretch.of_build(config).uids(step)
    if not begins < births <= ends:
        raise ValueError(
            f"it has {births} births, but step {step} of its build "
            f"has those from {max(0, begins)} to {ends - 1}"
        )
    # Compared by their number first: anybody may have written how many there should be.
    if len(pending) != ends - births or (np.diff(pending.uid, prepend=births - 1) != 1).any():
        raise ValueError(f"its children that are not born yet are not those from {births} to {ends - 1}")
