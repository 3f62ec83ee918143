"""The chain for those who go on with deeptime."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from scipy import sparse

from nichechain.chain.model import NicheChain
from nichechain.core.errors import NichechainError


def to_deeptime(chain: NicheChain) -> Any:
    """The chain as a model of the library deeptime, for all else that is known of Markov chains.

    Returns
    -------
    deeptime.markov.msm.MarkovStateModel
        All states, the outside state last where there is one. Much of deeptime refuses a chain of
        more than one class: hand it a class, or use the functions of this package.

    Raises
    ------
    NichechainError
        If deeptime is not installed.
    """
    try:
        model = importlib.import_module("deeptime.markov.msm").MarkovStateModel
    except ImportError:
        raise NichechainError(
            "deeptime is not installed, but to_deeptime needs it: pip install deeptime"
        ) from None
    matrix = chain.T.copy() if isinstance(chain.T, np.ndarray) else sparse.csr_matrix(chain.T, copy=True)
    return model(matrix)
