"""An elite's own record: the children that births already tell of it, and what they say of the next."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.births.table import NONE
from nichechain.chain.model import NicheChain

if TYPE_CHECKING:
    from nichechain.archive.archive import Archive

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def recorded_children(archive: Archive, uids: Ints) -> sparse.csr_array:
    """States of the children that births tell of some parents, (K, S) int64.

    Parameters
    ----------
    archive : Archive
    uids : (K,) int64 array
        Numbers of the parents' own births, each once.

    Notes
    -----
    Accepted or not, every child counts that did not fail.
    """
    births = archive.table(["parent_uid", "child_niche"])
    parent, child = (births[name].fill_null(NONE).to_numpy().astype(np.int64) for name in births.column_names)
    order = np.argsort(uids)
    place = np.minimum(np.searchsorted(uids, parent, sorter=order), max(0, uids.size - 1))
    row = order[place] if uids.size else place
    own = (uids[row] == parent) & (child != NONE) if uids.size else np.zeros(parent.size, bool)
    shape = (uids.size, archive.niches.states)
    one = np.ones(np.count_nonzero(own), np.int64)
    return sparse.coo_array((one, (row[own], child[own])), shape=shape).tocsr()


def own_strength(chain: NicheChain) -> float:
    """α: how many children of an elite its niche's row is worth, in foretelling where the next ones land.

    As many as make children of one elite foretell each other best, see
    :func:`nichechain.chain.elites.elite_concentration`; 1 where T has no posterior.
    """
    return 1.0 if chain.posterior is None else chain.posterior.elite_concentration


def draw_children(counts: Ints, row: Floats, rng: np.random.Generator, strength: float) -> Floats:
    """D of genotypes, (..., S), drawn given the states of their children and their niche's row of T.

    Notes
    -----
    D = w·Dirichlet(counts) + (1 − w)·row with w ~ Beta(children, α). Where the row is itself a draw from
    Dirichlet(α T_i), as in a chain that is calibrated on lineages, D is Dirichlet(counts + α T_i).
    """
    known, shares = draw_known(sparse.csr_array(np.atleast_2d(counts)), rng, strength)
    drawn: Floats = (shares.toarray() + (1.0 - known)[:, None] * np.atleast_2d(row)).reshape(row.shape)
    return drawn


def draw_known(
    counts: sparse.csr_array, rng: np.random.Generator, strength: float
) -> tuple[Floats, sparse.csr_array]:
    """The part of D that children speak for: w (K,), and w·Dirichlet(counts), (K, S)."""
    children = np.asarray(counts.sum(axis=1)).ravel()
    known = np.zeros(children.size)
    seen = children > 0
    known[seen] = rng.beta(children[seen], strength)
    entries = counts.tocoo()
    row, column = entries.coords
    weight = rng.standard_gamma(entries.data)
    total = np.bincount(row, weight, children.size)
    weight *= known[row] / np.maximum(total, np.finfo(float).tiny)[row]
    return known, sparse.coo_array((weight, (row, column)), shape=counts.shape).tocsr()
