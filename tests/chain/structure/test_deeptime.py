"""A chain handed to deeptime."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from scipy import sparse

from nichechain import NicheChain, NichechainError
from nichechain.chain.structure import to_deeptime
from nichechain.chain.structure.stationary import stationary_distribution

from .samples import MIXED


def test_to_deeptime():
    pytest.importorskip("deeptime")
    transition = np.array([[0.5, 0.5, 0.0], [0.2, 0.5, 0.3], [0.0, 0.4, 0.6]])
    for form in (np.array, sparse.csr_array):
        chain = NicheChain(form(transition))
        model = to_deeptime(chain)
        assert model.n_states == 3
        np.testing.assert_allclose(model.stationary_distribution, stationary_distribution(chain)[0])
    assert to_deeptime(NicheChain(MIXED)).n_states == 6


def test_to_deeptime_without_deeptime(monkeypatch):
    monkeypatch.setitem(sys.modules, "deeptime", None)
    monkeypatch.setitem(sys.modules, "deeptime.markov.msm", None)
    with pytest.raises(NichechainError, match="deeptime is not installed"):
        to_deeptime(NicheChain(MIXED))
