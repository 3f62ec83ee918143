"""Where those lineages are that still wander within a set of states, and how fast they leave it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from nichechain.chain.model import NicheChain
from nichechain.chain.structure.classes import recurrent_classes
from nichechain.chain.structure.inside import Inside
from nichechain.chain.structure.stationary import stationary_of
from nichechain.chain.structure.targets import Target, states_of
from nichechain.chain.structure.transitions import leaving_alone, reachable
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Parts that are left at rates nearer to one another than this are taken for equally slow.
_EQUAL = 1e-9
_MOST_STEPS = 200
_CONVERGED = 1e-11
# What is left of the eigenvalue when its vector is found, and how many steps that takes.
_NEARLY = 1e-9
_POLISH = 40
_SETTLED = 1e-12


@dataclass(frozen=True)
class QuasiStationary:
    """Where lineages are that have stayed within a set of states for long.

    Parameters
    ----------
    distribution : (S,) float64 array
        Zero outside the set; all NaN where there is no such distribution, see ``reason``.
    leaving : float
        Probability that a lineage distributed like this has left the set a generation later; NaN for
        an empty set. As exact for 1e-20 as for 0.1.
    reason : str
        Why there is no distribution, empty where there is one.
    """

    distribution: Floats
    leaving: float
    reason: str = ""

    @property
    def survival(self) -> float:
        """Probability that the lineage is still in the set a generation later."""
        return 1.0 - self.leaving


def quasi_stationary_distribution(chain: NicheChain, states: Target | None = None) -> QuasiStationary:
    """Where a lineage is, given that it has not left a set of states for a long time.

    Parameters
    ----------
    chain : NicheChain
    states : sequence of niches, optional
        By default all transient states: those in no recurrent class.

    Returns
    -------
    QuasiStationary
        Without a distribution where the set is empty, where every lineage leaves it within a few
        generations, or where two parts of it are left equally slowly, so that the distribution
        depends on where lineages began.

    Raises
    ------
    NichechainError
        If there is no such niche, T would have to be whole and is too large for that, or the
        iteration does not converge.

    Notes
    -----
    The left eigenvector of T within the set that belongs to its largest eigenvalue, the survival
    (Darroch and Seneta 1965). 1 − survival is the smallest eigenvalue of I − T within the set. It is
    found by inverse iteration, whose shift is summed from parts that are not negative (Xue 1996,
    "Computing the smallest eigenvalue of an M-matrix"), so that a small one is exact as well.
    """
    nowhere = np.full(chain.states, np.nan)
    if states is None:
        within = np.setdiff1d(np.arange(chain.states), np.concatenate(recurrent_classes(chain)))
        if not within.size:
            return QuasiStationary(nowhere, np.nan, "no state is transient")
    else:
        within = states_of(chain, states)
    rows = sparse.csr_array(chain.T, copy=True)
    rows.eliminate_zeros()
    inner = rows[within][:, within].tocsr()
    number, label = connected_components(inner, directed=True, connection="strong")
    order = np.argsort(label, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(label, minlength=number))[:-1])
    decays = [decay(rows, within[part]) for part in parts]
    leaving = min(rate for rate, _ in decays)
    slowest = [k for k, (rate, _) in enumerate(decays) if rate - leaving <= _EQUAL * leaving]
    if leaving == 1.0:
        return QuasiStationary(nowhere, 1.0, "every lineage leaves these states within a few generations")
    if len(slowest) > 1:
        return QuasiStationary(
            nowhere, leaving, f"{len(slowest)} parts of these states are left equally slowly"
        )
    share = np.zeros(within.size)
    part = parts[slowest[0]]
    share[part] = decays[slowest[0]][1]
    after = np.setdiff1d(reachable(inner, part, within.size), part)
    if after.size:
        # Downstream lineages come in from the slowest part faster than they leave.
        downstream = _Slowed.of(rows, within[after])
        while downstream.taken < leaving:
            downstream = downstream.next(min(downstream.sums.min(), leaving - downstream.taken))
        share[after] = downstream.solve_transposed(share[part] @ inner[part][:, after])
    distribution = np.zeros(chain.states)
    distribution[within] = share / share.sum()
    return QuasiStationary(distribution, leaving)


def decay(rows: sparse.csr_array, states: Ints) -> tuple[float, Floats]:
    """How fast lineages leave a set of states that all lead to one another, and where they are then.

    Parameters
    ----------
    rows : (S, S) scipy.sparse.csr_array
        T.
    states : (m,) int64 array

    Returns
    -------
    float and (m,) float64 array
        1 − the largest eigenvalue of T within the set, and the left eigenvector that belongs to it,
        which sums to 1.
    """
    if states.size == 1:
        stays = rows[states[0], states[0]] > 0.0
        return leaving_alone(rows, int(states[0])) if stays else 1.0, np.ones(1)
    inside = _Slowed.of(rows, states)
    if not inside.system.leaving.any():
        return 0.0, stationary_of(rows, states)
    if inside.system.at_once is None:
        # So many states are eliminated once at most, and not for every shift.
        found = _iterated(inside.system)
        if found is not None:
            return found
    for _ in range(_MOST_STEPS):
        low, high = inside.bounds
        if high - low <= _CONVERGED * high:
            break
        inside = inside.next(inside.sums.min())
    else:
        raise NichechainError(
            f"the quasi-stationary distribution of {states.size} states does not converge: "
            f"between {low:.9g} and {high:.9g} leave them in a generation"
        )
    # So close to the eigenvalue, a step leaves next to nothing of other eigenvectors; more than one is
    # taken for states in which next to nobody is.
    near = inside.next(inside.sums.min() * (1.0 - _NEARLY))
    share = np.ones(states.size)
    for _ in range(_POLISH):
        before = share
        share = near.solve_transposed(share)
        share /= share.sum()
        if (np.abs(share - before) <= _SETTLED * share).all():
            break
    return low, share


def _iterated(inside: Inside) -> tuple[float, Floats] | None:
    """The same by inverse iteration without shifts; None where it converges too slowly."""
    ahead, behind = np.ones(inside.size), np.ones(inside.size)
    for _ in range(_MOST_STEPS):
        solved, share = inside.solve(ahead), inside.solve_transposed(behind)
        # Bounds of the smallest eigenvalue (Collatz 1942; Wielandt 1950), and of what is left in the vector.
        rate, left = ahead / solved, behind / share
        ahead, behind = solved / solved.max(), share / share.sum()
        if np.ptp(rate) <= _NEARLY * rate.min() and np.ptp(left) <= _NEARLY * left.min():
            return float(rate.min()), behind
    return None


@dataclass(frozen=True)
class _Slowed:
    """I − Q less a part ``taken`` of its smallest eigenvalue, still without a negative number.

    Parameters
    ----------
    system : Inside
        X⁻¹ (I − Q − taken) X, whose rows sum to something that is not negative.
    scale : (m,) float64 array
        The diagonal of X.
    taken : float
    """

    system: Inside
    scale: Floats
    taken: float

    @classmethod
    def of(cls, rows: sparse.csr_array, states: Ints) -> _Slowed:
        return cls(Inside.of(rows, states), np.ones(states.size), 0.0)

    @cached_property
    def sums(self) -> Floats:
        """What rows sum to once X is scaled by the times to leave, (m,)."""
        return 1.0 / self.system.times

    @property
    def bounds(self) -> tuple[float, float]:
        """Of the smallest eigenvalue of I − Q (Collatz 1942; Wielandt 1950)."""
        return self.taken + float(self.sums.min()), self.taken + float(self.sums.max())

    def next(self, step: float) -> _Slowed:
        """With so much more taken, which must not be more than the smallest of the sums."""
        assert isinstance(self.system.onward, sparse.csr_array)
        scale = self.sums.min() / self.sums
        entries = self.system.onward.tocoo()
        row, column = entries.coords
        onward = sparse.csr_array(
            (entries.data * (scale[column] / scale[row]), (row, column)), shape=entries.shape
        )
        system = Inside(onward, self.sums - step, self.system.states)
        return _Slowed(system, self.scale * scale, self.taken + float(step))

    def solve_transposed(self, right: Floats) -> Floats:
        """The x with x (I − Q − taken) = b."""
        found: Floats = self.system.solve_transposed(right * self.scale) / self.scale
        return found
