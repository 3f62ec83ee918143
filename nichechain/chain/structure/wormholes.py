"""Wormholes: transitions far more probable than how far children usually land would explain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.special import betaincc

from nichechain.chain.base_measure import BaseMeasure
from nichechain.chain.counts import TransitionCounts
from nichechain.chain.model import NicheChain
from nichechain.chain.structure.transitions import rows_of
from nichechain.core.checks import as_whole, check_at_least, check_choice, check_numbers
from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    import pandas as pd

Floats = NDArray[np.float64]

# Growth that is rounding.
_SETTLED = 1e-15
Ints = NDArray[np.int64]
Beyond = Literal["displacement", "both"]


def wormholes(
    chain: NicheChain,
    *,
    beyond: Beyond = "displacement",
    times: float = 10.0,
    expected_false: float = 1.0,
) -> pd.DataFrame:
    """Observed transitions between niches, those least explained by displacement first.

    Parameters
    ----------
    chain : NicheChain
        Estimated with a posterior, from births in a grid.
    beyond : {"displacement", "both"}
        What a wormhole must exceed: how far children land of their parents, or also how many of
        all children land there. Children that are broken all land where the search began, which
        displacement does not explain, but destination does.
    times : float
        A transition is a wormhole if T_ij is more than so many times what is expected, at least 1.
    expected_false : float
        Flag as many transitions as can be while each is more likely a wormhole than not and no
        more than this number of them are expected to be none, at least 0.

    Returns
    -------
    pandas.DataFrame
        One row for each pair of different niches with a birth from one to the other:
        ``parent``, ``child`` and their labels ``parent_index``, ``child_index``; ``count`` (births);
        ``exposure`` (births of parents in the niche); ``distance`` between centres, in units of
        behavior; ``displacement``, the probability that children land so far, in that direction,
        judged by the births of all other pairs; ``destination``, the share of all other births
        that land there; ``probability``, the posterior mean of T_ij; ``exceeds``, the posterior
        probability that T_ij is more than ``times`` what ``beyond`` names; ``singleton``, whether
        the count is 1; ``cumulated_false``; and ``wormhole``, the flag.

    Raises
    ------
    NichechainError
        If the chain has no posterior or no niches, or an argument is out of range.

    Notes
    -----
    The paper's "wormholes", in its section "Towards better evolvability definitions". T_ij has
    the Beta marginal of its row's Dirichlet posterior. Thousands of pairs are looked at, so a
    posterior probability on its own would let many through by chance; transitions are therefore
    flagged from the top while the sum of 1 − ``exceeds``, which is the number of false ones
    expected among them (``cumulated_false``), stays within ``expected_false``: the Bayesian false
    discovery count of Newton et al. (2004), "Detecting differential gene expression with a
    semiparametric hierarchical mixture method". A pair's own births are left out of what is
    expected of it, or a rare jump would explain itself.
    """
    import pandas as pd

    check_choice("beyond", beyond, get_args(Beyond))
    check_numbers(times=times, expected_false=expected_false)
    if not 1.0 <= times < math.inf:
        raise NichechainError(f"times is {times}, but must be at least 1")
    if not expected_false >= 0.0:
        raise NichechainError(f"expected_false is {expected_false}, but must not be negative")
    if chain.posterior is None or chain.counts is None:
        raise NichechainError(
            f"wormholes need a chain with a posterior, but this one is {chain.estimator}: "
            "estimate it with empirical-bayes or dirichlet"
        )
    posterior, counts = chain.posterior, chain.counts
    parent, child, count = _between_niches(counts)
    displacement, destination = _expected(counts, parent, child, count)
    prior = posterior.strength * posterior.base.probability(parent, child)
    mass = count / posterior.design_effect[parent] + prior
    rest = np.asarray(posterior.weights.sum(axis=1)).ravel()[parent] + posterior.strength - mass
    centers = counts.niches.centers
    expected = displacement if beyond == "displacement" else np.maximum(displacement, destination)
    frame = pd.DataFrame(
        {
            "parent": parent,
            "child": child,
            "parent_index": [chain.label(state) for state in parent.tolist()],
            "child_index": [chain.label(state) for state in child.tolist()],
            "count": count,
            "exposure": counts.births[parent],
            "distance": np.linalg.norm(centers[child] - centers[parent], axis=1),
            "displacement": displacement,
            "destination": destination,
            "probability": mass / (mass + rest),
            # The Beta marginal's upper tail; no probability exceeds 1.
            "exceeds": betaincc(mass, rest, np.minimum(float(times) * expected, 1.0)),
            "singleton": count == 1,
        }
    )
    frame = frame.sort_values(["exceeds", "count", "distance"], ascending=False, kind="stable").reset_index(
        drop=True
    )
    frame["cumulated_false"] = (1.0 - frame["exceeds"]).cumsum()
    # A single hopeless case would fit into a budget of one.
    frame["wormhole"] = (frame["cumulated_false"] <= expected_false) & (frame["exceeds"] > 0.5)
    return frame


def wormhole_exposure(chain: NicheChain, found: pd.DataFrame, *, l: int = 1) -> Floats:
    """Probability that a lineage takes at least one wormhole.

    Parameters
    ----------
    chain : NicheChain
        Not only the one in which they were found: a draw from its posterior as well.
    found : pandas.DataFrame
        Columns ``parent``, ``child`` and ``wormhole``, as :func:`wormholes` gives them; rows that are
        not flagged are left out.
    l : int
        Generations, at least 1.

    Returns
    -------
    (S,) float64 array
        For a root in each state.

    Raises
    ------
    NichechainError
        If ``l`` is out of range, a column is missing or names a state that does not exist.

    Notes
    -----
    e_k = w + (T − W) e_{k−1} for W the transitions that are wormholes, w their sum in each row of T, and
    e_0 = 0: the probability that one of them is among the first k steps.
    """
    check_at_least(1, l=l)
    columns = getattr(found, "columns", ())
    missing = [name for name in ("parent", "child", "wormhole") if name not in columns]
    if missing:
        raise NichechainError(f"found has no column {missing[0]}, but must be a table of wormholes")
    flagged = found[found["wormhole"].astype(bool)]
    parent, child = (as_whole(name, flagged[name]) for name in ("parent", "child"))
    for state in (*parent.tolist(), *child.tolist()):
        if not 0 <= state < chain.states:
            raise NichechainError(f"found names state {state}, but this chain has {chain.states} states")
    rows = rows_of(chain)
    start, place = np.unique(parent, return_inverse=True)
    some = rows[start].toarray() if start.size else np.zeros((0, chain.states))
    ways = sparse.csr_array((some[place, child], (parent, child)), shape=rows.shape)
    # Through parts of T, wormholes can only be taken out of the product.
    others = rows - ways if isinstance(rows, sparse.csr_array) else None
    taken = np.asarray(ways.sum(axis=1)).ravel()
    exposure = taken
    for _ in range(l - 1):
        before = exposure
        onward = rows @ exposure - ways @ exposure if others is None else others @ exposure
        exposure = taken + onward
        # The largest growth never grows again.
        if np.abs(exposure - before).max() <= _SETTLED:
            break
    at_most_one: Floats = np.minimum(exposure, 1.0)
    return at_most_one


def _between_niches(counts: TransitionCounts) -> tuple[Ints, Ints, Ints]:
    """Parents, children and numbers of the births from one niche into another."""
    entries = counts.matrix.tocoo()
    parent, child = (axis.astype(np.int64) for axis in entries.coords)
    n = len(counts.niches)
    # The outside is nowhere, so nothing is far from it.
    kept = (parent < n) & (child < n) & (parent != child) & (entries.data > 0)
    return parent[kept], child[kept], entries.data[kept].astype(np.int64)


def _expected(counts: TransitionCounts, parent: Ints, child: Ints, count: Ints) -> tuple[Floats, Floats]:
    """Probability of each pair by pooled displacement and by destination, without its own births."""
    n = len(counts.niches)
    base = BaseMeasure.pooled(counts, np.ones(3) / 3)
    destination, displacement, _ = base.components(parent, child)
    # Births that the pools are made of, with the imaginary ones that BaseMeasure adds.
    total = float(counts.matrix.sum()) + 1.0
    inside = float(counts.matrix[:n, :n].sum())
    kernel = inside + 0.5
    staying = 1.0 - base.leaving
    all_ways = base.within[parent] * kernel
    this_way = displacement / staying * all_ways
    staying_else = 1.0 / (1.0 + base.leaving / staying * inside / np.maximum(inside - count, 1.0))
    # Half a birth, spread over all niches, makes nothing quite impossible.
    pair, row = base.displacement.own(parent, child)
    so_far = (np.maximum(this_way - count * pair, 0.0) + 0.5 / n) / (all_ways - count * row + 0.5)
    there = (np.maximum(destination * total - count, 0.0) + 0.5 / n) / (total - count + 0.5)
    return staying_else * so_far, there
