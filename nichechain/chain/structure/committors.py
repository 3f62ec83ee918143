"""From one set of niches to another: which is reached first, and which ways lineages take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain
from nichechain.chain.structure.classes import recurrent_classes
from nichechain.chain.structure.inside import Inside
from nichechain.chain.structure.passage import probabilities, reaching
from nichechain.chain.structure.stationary import stationary_of
from nichechain.chain.structure.targets import Target, states_of
from nichechain.chain.structure.transitions import graph_of, rows_of
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class ReactiveFlux:
    """Lineages on their way from a source to a target, in the long run.

    Parameters
    ----------
    forward : (S,) float64 array
        q⁺, the probability that a lineage in each state gets to the target before the source.
    backward : (S,) float64 array
        q⁻, the probability that a lineage found in each state came from the source after it was last in
        the target; NaN in states that no lineage is in for long.
    stationary : (S,) float64 array
        π, where lineages are in the long run.
    gross : (S, S) scipy.sparse.csr_array
        Probability that a lineage takes this transition in a generation and is on its way from source to
        target: π_i q⁻_i T_ij q⁺_j for i ≠ j.
    net : (S, S) scipy.sparse.csr_array
        What is left of it when ways to and fro between two states cancel.
    total : float
        Probability that a lineage leaves the source for the target in a generation.
    rate : float
        The same for a lineage that was last in the source: transitions to the target a generation.
    """

    forward: Floats
    backward: Floats
    stationary: Floats
    gross: sparse.csr_array
    net: sparse.csr_array
    total: float
    rate: float


def committor(chain: NicheChain, source: Target, target: Target) -> Floats:
    """Probability that a lineage gets to the target before it gets to the source.

    Parameters
    ----------
    chain : NicheChain
    source, target : niche, or sequence of niches
        Without a niche in common.

    Returns
    -------
    (S,) float64 array
        q⁺ for a root in each state: 1 on the target, 0 on the source. A lineage that gets to neither
        does not get to the target first.

    Raises
    ------
    NichechainError
        If there is no such niche, a set is empty, or the two have a niche in common.

    Notes
    -----
    The least solution of q = T q off both sets (E and Vanden-Eijnden 2006, "Towards a theory of
    transition paths"), without a subtraction as :func:`hitting_probabilities` is.
    """
    rows = rows_of(chain)
    start, end = _apart(chain, source, target)
    # What the source leads to does not matter: lineages that get there have lost.
    graph = graph_of(rows, chain)
    going = np.ones(graph.shape[0])
    going[start] = 0.0
    kept = (sparse.diags_array(going) @ graph).tocsr()
    kept.eliminate_zeros()
    possible, sure = reaching(kept, end, chain.states)
    # A lineage in the source is lost, and so is whatever may get there.
    found = sure.astype(np.float64)
    open_ = np.flatnonzero(possible & ~sure)
    if open_.size:
        found[open_] = probabilities(Inside.of(rows, open_).solve((rows @ found)[open_]))
    return found


def reactive_flux(chain: NicheChain, source: Target, target: Target) -> ReactiveFlux:
    """Which ways lineages take from one set of niches to another, in the long run.

    Parameters
    ----------
    chain : NicheChain
        With a single recurrent class, which has niches of both sets.
    source, target : niche, or sequence of niches
        Without a niche in common.

    Returns
    -------
    ReactiveFlux

    Raises
    ------
    NichechainError
        If there is no such niche, the sets have a niche in common, several recurrent classes divide
        the lineages, or these are in one of the sets only for a while.

    Notes
    -----
    Transition path theory for chains of discrete time that need not be reversible (Metzner, Schütte
    and Vanden-Eijnden 2009; Helfmann, Ribera Borrell, Schütte and Koltai 2020).
    """
    start, end = _apart(chain, source, target)
    classes = recurrent_classes(chain)
    if len(classes) > 1:
        raise NichechainError(
            f"this chain has {len(classes)} recurrent classes, but a flux from source to target needs a "
            "single one, in which lineages come back to the source"
        )
    inside = classes[0]
    for name, states in (("source", start), ("target", end)):
        if not np.isin(states, inside).any():
            raise NichechainError(f"the {name} has only niches that lineages leave for good")
    entries = sparse.csr_array(chain.T, copy=True)
    entries.eliminate_zeros()
    stationary = np.zeros(chain.states)
    stationary[inside] = stationary_of(entries, inside)
    forward = committor(chain, start, end)
    # π q⁻: what flows out of the source and on, as long as it meets neither set.
    flowing = np.where(np.isin(np.arange(chain.states), start), stationary, 0.0)
    between = np.setdiff1d(inside, np.concatenate([start, end]))
    if between.size:
        arriving = (flowing @ entries)[between]
        flowing[between] = Inside.of(entries, between).solve_transposed(arriving)
    with np.errstate(invalid="ignore", divide="ignore"):
        backward = np.where(stationary > 0.0, np.minimum(flowing / stationary, 1.0), np.nan)
    flux = (sparse.diags_array(flowing) @ entries @ sparse.diags_array(forward)).tocsr()
    flux.setdiag(0.0)
    flux.eliminate_zeros()
    net = (flux - flux.T).tocsr()
    net.data = np.maximum(net.data, 0.0)
    net.eliminate_zeros()
    total = float(flux[start].sum())
    return ReactiveFlux(forward, backward, stationary, flux, net, total, total / float(flowing.sum()))


def _apart(chain: NicheChain, source: Target, target: Target) -> tuple[Ints, Ints]:
    """States of both sets."""
    start, end = states_of(chain, source, "source"), states_of(chain, target)
    common = np.intersect1d(start, end)
    if common.size:
        raise NichechainError(
            f"niche {chain.label(int(common[0]))} is in the source and in the target, "
            "but these must not have a niche in common"
        )
    return start, end
