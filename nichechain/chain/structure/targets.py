"""The sets of states that a question is about, named as niches are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from nichechain.chain.model import NicheChain
from nichechain.core.errors import NichechainError
from nichechain.niches import Niche

Ints = NDArray[np.int64]

Target: TypeAlias = Niche | Sequence[Niche] | NDArray[np.int64]
"""A niche, as flat id or as grid index (a tuple), or a list or array of them. The outside state
goes by its number."""


def states_of(chain: NicheChain, target: Target, name: str = "target") -> Ints:
    """Sorted states of a target, which the caller knows by this name.

    Raises
    ------
    NichechainError
        If there is no such niche, or the target is empty.
    """
    if (
        isinstance(target, list)
        or (isinstance(target, np.ndarray) and target.ndim)
        or (isinstance(target, Sequence) and not isinstance(target, (tuple, str)))
    ):
        several = list(target)
    else:
        # A tuple is the index of one niche; what is no niche at all is for the chain to refuse.
        several = [target]
    if not several:
        raise NichechainError(f"the {name} is empty, but must have at least one niche")
    return np.unique([chain.state(niche) for niche in several])
