"""Sets of niches that lineages stay in for long: recurrent classes, then parts of a class."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from nichechain.chain.model import NicheChain
from nichechain.chain.structure.classes import classes_of, closed_classes_of
from nichechain.chain.structure.inside import Inside
from nichechain.chain.structure.quasi_stationary import decay
from nichechain.chain.structure.timescales import gaps
from nichechain.core.checks import check_whole
from nichechain.core.errors import NichechainError

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# A dense eigenproblem of more states takes minutes.
_MOST_STATES = 3_000
# Groups of one class, beyond which their search takes minutes.
_MOST_PARTS = 20
# Of a group that is more likely left than not, nobody would say that lineages stay there.
_STAYING = 0.5


@dataclass(frozen=True)
class MetastableSets:
    """States of a chain in m groups that lineages seldom leave.

    Parameters
    ----------
    membership : (S, m) float64 array
        Share of each state in each group; rows sum to 1.
    group : (S,) int64 array
        Where its share is largest. Groups are in the order of their smallest states.
    transition : (m, m) float64 array
        Probability that a child of a lineage that has been in one group for long is in another;
        staying is on the diagonal.
    crispness : float
        From 0 to 1: how clearly states belong to one group; the mean over groups of
        Σ_i χ_ig² / Σ_i χ_ig for memberships χ.
    """

    membership: Floats
    group: Ints
    transition: Floats
    crispness: float


def metastable_sets(chain: NicheChain, groups: int) -> MetastableSets:
    """Group the states of a chain so that lineages stay within groups for as long as they can.

    Parameters
    ----------
    chain : NicheChain
        Reversible or not, of one class or of many.
    groups : int
        m, from 2 to the number of states; not less than the number of recurrent classes.

    Returns
    -------
    MetastableSets

    Raises
    ------
    NichechainError
        If ``groups`` is out of range or would split a pair of complex eigenvalues, if a group would be
        empty or more likely be left than stayed in, if a class has more than 3,000 states, or if
        pyGPCCA is needed and not installed.

    Notes
    -----
    Each recurrent class is a group that is never left. Further groups come from the eigenvalues of T
    with the largest real parts, which are those of its classes, T being triangular by classes: a
    class with n of them makes n groups. An eigenvalue near −1 has a large size as well, but belongs to
    lineages that swap sides every generation, so size is not what counts. A class is divided by GPCCA of
    Reuter, Fackeldey and Weber (2019), as pyGPCCA does it; a transient one as if it was not left. The
    states that are then left over share in the groups as lineages get into them first.
    """
    check_whole(groups=groups)
    if not 2 <= groups <= chain.states:
        raise NichechainError(f"groups is {groups}, but must be from 2 to {chain.states}")
    rows = sparse.csr_array(chain.T, copy=True)
    rows.eliminate_zeros()
    cores = _cores(chain, rows, groups)
    membership = np.zeros((chain.states, groups))
    weight = np.zeros(chain.states)
    first = 0
    for states, parts in cores:
        membership[states, first : first + parts] = _divided(rows, states, parts)
        weight[states] = decay(rows, states)[1]
        first += parts
    _share_the_rest(rows, np.concatenate([states for states, _ in cores]), membership)
    group = membership.argmax(axis=1)
    if np.unique(group).size < groups:
        raise NichechainError(
            f"groups is {groups}, but no state would belong to one of them more than to any other: "
            "ask for fewer groups"
        )
    order = np.argsort(np.unique(group, return_index=True)[1])
    membership, group = membership[:, order], np.argsort(order)[group]
    transition = _between_groups(rows, weight, group, groups)
    loose = int(np.argmin(transition.diagonal()))
    if transition[loose, loose] < _STAYING:
        raise NichechainError(
            f"groups is {groups}, but this chain has not so many sets that lineages stay in: in the group of "
            f"{np.count_nonzero(group == loose)} around {chain.label(_most(weight, group == loose))} they "
            f"would stay with a probability of only {transition[loose, loose]:.2g}"
        )
    crispness = float(((membership**2).sum(axis=0) / membership.sum(axis=0)).mean())
    return MetastableSets(membership, group.astype(np.int64), transition, crispness)


def _cores(chain: NicheChain, rows: sparse.csr_array, groups: int) -> list[tuple[Ints, int]]:
    """Classes that groups are made of, and of how many each."""
    closed = closed_classes_of(rows, chain.states)
    if groups < len(closed):
        alone = [states[0] for states in closed if states.size == 1]
        births = chain.births
        unknown = 0 if births is None else int(np.count_nonzero(births[alone] == 0))
        why = f", {unknown} of them niches without births" if unknown else ""
        raise NichechainError(
            f"groups is {groups}, but this chain has {len(closed)} recurrent classes{why}: "
            "each is a group that is never left"
        )
    if groups == len(closed):
        return [(states, 1) for states in closed]
    classes = classes_of(rows, chain.states)
    largest = max(states.size for states in classes)
    if largest > _MOST_STATES:
        raise NichechainError(
            f"a class of {largest} states is too large to be divided: at most {_MOST_STATES} are"
        )
    recurrent = {int(states[0]) for states in closed}
    gap = [gaps(rows, states, closed=int(states[0]) in recurrent) for states in classes]
    owner = np.repeat(np.arange(len(classes)), [each.size for each in gap])
    values = np.concatenate(gap)
    # Recurrent classes come before transient ones that are hardly ever left.
    transient = np.array([int(states[0]) not in recurrent for states in classes])[owner]
    leading = np.lexsort((transient, values.real))[:groups]
    counts = np.bincount(owner[leading], minlength=len(classes))
    for number in np.flatnonzero(counts):
        chosen = values[leading[owner[leading] == number]]
        if abs(chosen.imag.sum()) > 1e-9 * np.abs(chosen).max(initial=1e-300):
            raise NichechainError(
                f"groups is {groups}, which would split a pair of complex eigenvalues of this chain: "
                f"ask for {groups + 1} groups, or for fewer"
            )
        # No m sets are stayed in more than the m largest eigenvalues add up to (Fan 1949), if reversible.
        stayed = float((1.0 - chosen.real).mean())
        if stayed < _STAYING:
            raise NichechainError(
                f"groups is {groups}, but this chain has not so many sets that lineages stay in: the "
                f"eigenvalues allow them to stay with a probability of {max(stayed, 0.0):.2g} on average"
            )
        if _MOST_PARTS < chosen.size < classes[number].size:
            raise NichechainError(
                f"groups is {groups}, which would divide a class into {chosen.size} groups, "
                f"but at most {_MOST_PARTS} can be searched for"
            )
    return [(classes[number], int(counts[number])) for number in np.flatnonzero(counts)]


def _divided(rows: sparse.csr_array, states: Ints, parts: int) -> Floats:
    """Memberships of the states of a class in its groups, (c, parts)."""
    if parts == 1:
        return np.ones((states.size, 1))
    if parts == states.size:
        return np.eye(parts)
    inner = rows[states][:, states].toarray()
    inner /= inner.sum(axis=1, keepdims=True)
    try:
        with _silence():
            from pygpcca import GPCCA

            warnings.simplefilter("ignore")
            uniform = np.full(states.size, 1.0 / states.size)
            found = GPCCA(inner, eta=uniform, z="LR", method="brandts").optimize(parts)
    except ModuleNotFoundError as error:
        if error.name != "pygpcca":
            raise
        raise NichechainError(
            'pyGPCCA is not installed, but metastable_sets needs it: pip install "nichechain[gpcca]"'
        ) from None
    except (ValueError, RuntimeError) as error:
        raise NichechainError(
            f"a class of {states.size} states does not divide into {parts} groups: "
            f"{' '.join(str(error).split())}"
        ) from error
    return np.asarray(found.memberships, np.float64)


def _share_the_rest(rows: sparse.csr_array, core: Ints, membership: Floats) -> None:
    """Memberships of all states outside the core, by where lineages first get into it."""
    rest = np.setdiff1d(np.arange(rows.shape[0]), core)
    if rest.size:
        inside = Inside.of(rows, rest)
        arriving = rows[rest] @ membership
        shares = np.stack([inside.solve(column) for column in arriving.T], axis=1)
        membership[rest] = shares / shares.sum(axis=1, keepdims=True)


def _between_groups(rows: sparse.csr_array, weight: Floats, group: Ints, groups: int) -> Floats:
    """Where children of each group land, from where lineages are that stay in it, (m, m)."""
    belongs = np.zeros((group.size, groups))
    belongs[np.arange(group.size), group] = 1.0
    among = belongs * weight[:, None]
    # Of a group that is hardly ever visited, all states alike.
    empty = among.sum(axis=0) == 0.0
    among[:, empty] = belongs[:, empty]
    landed = among.T @ (rows @ belongs)
    between: Floats = landed / landed.sum(axis=1, keepdims=True)
    return between


def _most(weight: Floats, chosen: NDArray[np.bool_]) -> int:
    return int(np.argmax(np.where(chosen, weight, -1.0)))


@contextmanager
def _silence() -> Iterator[None]:
    """PyGPCCA warns where this module refuses, and turns on all warnings of the process for good."""
    before = os.environ.get("PYTHONWARNINGS")
    with warnings.catch_warnings():
        try:
            yield
        finally:
            if before is None:
                os.environ.pop("PYTHONWARNINGS", None)
            else:
                os.environ["PYTHONWARNINGS"] = before
