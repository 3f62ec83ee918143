"""Sets of niches that lineages stay in for long, by generalised Perron cluster analysis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.model import NicheChain
from nichechain.core.checks import check_whole
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class MetastableSets:
    """States of a chain in m groups that lineages seldom leave.

    Parameters
    ----------
    membership : (S, m) float64 array
        Share of each state in each group; rows sum to 1.
    group : (S,) int64 array
        Where its share is largest.
    transition : (m, m) float64 array
        The chain between groups.
    crispness : float
        From 0 to 1: how clearly states belong to one group.
    """

    membership: Floats
    group: NDArray[np.int64]
    transition: Floats
    crispness: float


def metastable_sets(chain: NicheChain, groups: int) -> MetastableSets:
    """Group the states of a chain so that lineages stay within groups for as long as they can.

    Parameters
    ----------
    chain : NicheChain
        Reversible or not: a chain of births is not.
    groups : int
        m, at least 2 and less than the number of states.

    Raises
    ------
    NichechainError
        If ``groups`` is out of range, splits a pair of complex eigenvalues, or pyGPCCA is not
        installed.

    Notes
    -----
    GPCCA of Reuter, Fackeldey and Weber (2019), as pyGPCCA does it, on the dense transition
    matrix: seconds at 400 states, minutes at thousands.
    """
    check_whole(groups=groups)
    if not 2 <= groups < chain.states:
        raise NichechainError(f"groups is {groups}, but must be from 2 to {chain.states - 1}")
    try:
        from pygpcca import GPCCA
    except ImportError:
        raise NichechainError(
            'pyGPCCA is not installed, but metastable_sets needs it: pip install "nichechain[gpcca]"'
        ) from None
    matrix = np.array(chain.T) if isinstance(chain.T, np.ndarray) else chain.T.toarray()
    found = GPCCA(matrix, eta=np.full(len(matrix), 1.0 / len(matrix)), method="brandts")
    try:
        found.optimize(groups)
    except ValueError as error:
        raise NichechainError(
            f"groups is {groups}, which does not divide this chain: {' '.join(str(error).split())}"
        ) from error
    membership = np.asarray(found.memberships, np.float64)
    return MetastableSets(
        membership,
        membership.argmax(axis=1),
        np.asarray(found.coarse_grained_transition_matrix, np.float64),
        float(found.optimal_crispness),
    )
