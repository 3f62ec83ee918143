"""How many children of parents in niche i were born in niche j."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.births.families import tabulated
from nichechain.births.joins import across_runs
from nichechain.births.lineages import lineages_of, no_lineages
from nichechain.births.table import LINEAGE, NONE
from nichechain.core.checks import as_floats, as_whole, shown
from nichechain.core.errors import NichechainError
from nichechain.core.notebook import facts_table
from nichechain.niches import Niches
from nichechain.niches.plain import ATTRIBUTE, from_plain

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

Ints = NDArray[np.int64]

# Beyond this not every whole number is a float64 any more.
_MOST_BIRTHS = 2.0**53


@dataclass(frozen=True)
class TransitionCounts:
    """Births from niche to niche; counts of several runs add.

    Every evaluated child of a selected parent counts, accepted or not; births of unselected lineages
    are kept apart. States keep the numbers of the grid: none is dropped or renumbered.

    Parameters
    ----------
    matrix : (S, S) scipy.sparse.csr_array of int64
        ``matrix[i, j]`` children in state j of parents in state i.
    niches : Niches
    visits : (S,) int64 array
        Births in each state, initial ones included.
    families : (F, 4) int64 array
        Rows (state, elite, child state, children): whose children they are, as far as births say.
        Numbers of elites matter only in that they differ.
    lineages : (L, 6) int64 array
        Births of unselected lineages, see :mod:`nichechain.births.lineages`. Those after the first of
        each are not in ``matrix``, since a search hardly ever makes such a birth a parent.
    """

    matrix: sparse.csr_array
    niches: Niches
    visits: Ints
    families: Ints = field(default_factory=lambda: np.empty((0, 4), np.int64))
    lineages: Ints = field(default_factory=no_lineages)

    @overload
    @classmethod
    def from_births(
        cls, parent: pd.DataFrame | pa.Table, child: Niches | None = None, *, elite: None = None
    ) -> TransitionCounts: ...

    @overload
    @classmethod
    def from_births(
        cls, parent: ArrayLike, child: ArrayLike, niches: Niches, *, elite: ArrayLike | None = None
    ) -> TransitionCounts: ...

    @classmethod
    def from_births(
        cls, parent: Any, child: Any = None, niches: Niches | None = None, *, elite: ArrayLike | None = None
    ) -> TransitionCounts:
        """Counts of births: of their columns, or of a table as in ``from_births(births, niches)``.

        Parameters
        ----------
        parent, child : (N,) ints
            States of the parent and of the child, null or -1 where there is none: a birth without a
            parent is only a visit, and one without a niche failed and is left out. Or, in the place of
            ``parent``, a DataFrame or pyarrow.Table with the columns of :mod:`nichechain.births.table`,
            and the niches in the place of ``child``: not even those for ``archive.births()`` and what is
            selected of its rows, which know them.
        niches : Niches
            The niches that the numbers belong to.
        elite : (N,) ints, optional
            Number of the parent, which tells siblings from cousins; null or -1 where it is not known.

        Raises
        ------
        NichechainError
            If the lengths differ, a state does not exist or a column is missing.
        """
        if hasattr(parent, "columns"):
            if child is None and ATTRIBUTE in getattr(parent, "attrs", {}):
                child = from_plain(parent.attrs[ATTRIBUTE])
            if not isinstance(child, Niches) or niches is not None or elite is not None:
                raise NichechainError(
                    "a table of births comes with its niches alone: from_births(births, niches)"
                )
            return cls._from_table(parent, child)
        if child is None or niches is None:
            raise NichechainError("child or niches are missing: from_births(parent, child, niches)")
        i, j = _states("parent", parent), _states("child", child)
        _check_pairs(i, j, niches, lowest=NONE)
        moved = (i != NONE) & (j != NONE)
        counts = cls.from_pairs(i[moved], j[moved], niches)
        counts = replace(counts, visits=np.bincount(j[j != NONE], minlength=niches.states))
        if elite is None:
            return counts
        uid = _states("elite", elite)
        if uid.shape != i.shape:
            raise NichechainError(f"elites have shape {uid.shape} and parents {i.shape}, but must be alike")
        # Children whose parents are not known are not siblings for that.
        own = moved & (uid != NONE)
        return replace(counts, families=tabulated(i[own], uid[own], j[own]))

    @classmethod
    def _from_table(cls, births: Any, niches: Niches) -> TransitionCounts:
        names = list(getattr(births, "column_names", births.columns))
        for name in ("parent_niche", "child_niche"):
            if name not in names:
                raise NichechainError(f"births have no column {name}, but need parent_niche and child_niche")
        parent, child = (_states(name, births[name]) for name in ("parent_niche", "child_niche"))
        elite = run = None
        if "parent_uid" in names:
            elite = _states("parent_uid", births["parent_uid"])
            run = _states("run", births["run"]) if "run" in names else np.zeros(elite.size, np.int64)
            (numbered,) = across_runs(run, elite)
        flagged = _flags(births[LINEAGE]) if LINEAGE in names else np.zeros(parent.size, bool)
        selected = np.where(flagged, NONE, parent)
        counts = cls.from_births(selected, child, niches, elite=None if elite is None else numbered)
        if elite is None or run is None or "uid" not in names or not flagged.any():
            return counts
        _check_pairs(parent, child, niches, lowest=NONE)
        uid = _states("uid", births["uid"])
        return replace(counts, lineages=lineages_of(run, uid, elite, parent, child, flagged))

    @classmethod
    def from_trajectories(cls, trajectories: Iterable[ArrayLike], niches: Niches) -> TransitionCounts:
        """Counts of the steps of lineages.

        Parameters
        ----------
        trajectories : iterable of (L,) ints
            States of one lineage each, generation after generation. One of a single state is a visit.
        niches : Niches
            The niches that the numbers belong to.

        Raises
        ------
        NichechainError
            If a trajectory is no sequence of states that exist.
        """
        one_by_one = isinstance(trajectories, Iterable) and not sparse.issparse(trajectories)
        if not one_by_one or getattr(trajectories, "ndim", 1) == 0:
            raise NichechainError(f"trajectories is {shown(trajectories)}, but must be sequences of states")
        lineages = [as_whole("trajectories", each) for each in trajectories]
        for lineage in lineages:
            if lineage.ndim != 1:
                raise NichechainError(
                    f"trajectories has one of shape {lineage.shape}, but each must be a sequence of states"
                )
        empty = np.empty(0, np.int64)
        first = np.concatenate([empty, *(lineage[:1] for lineage in lineages)])
        parent = np.concatenate([empty, *(lineage[:-1] for lineage in lineages)])
        child = np.concatenate([empty, *(lineage[1:] for lineage in lineages)])
        _check_pairs(first, first, niches, lowest=0)
        counts = cls.from_pairs(parent, child, niches)
        return replace(counts, visits=counts.visits + np.bincount(first, minlength=niches.states))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike | sparse.sparray, niches: Niches) -> TransitionCounts:
        """Counts that are known already.

        Parameters
        ----------
        matrix : (S, S) array or scipy.sparse matrix of whole numbers
            ``matrix[i, j]`` births in state j of parents in state i.
        niches : Niches
            S is their number of states.

        Raises
        ------
        NichechainError
            If the matrix has another shape, or has numbers that count no births.
        """
        if not sparse.issparse(matrix):
            matrix = as_floats("matrix", matrix)
        if matrix.shape != (niches.states, niches.states):  # type: ignore[union-attr]
            raise NichechainError(
                f"matrix has shape {matrix.shape}, "  # type: ignore[union-attr]
                f"but must have ({niches.states}, {niches.states}), a row for each state"
            )
        entries = sparse.coo_array(matrix)
        parent, child = entries.coords
        n = _multiplicities("matrix", entries.data, parent.shape)
        return cls.from_pairs(parent, child, niches, n=n)

    @classmethod
    def from_pairs(
        cls, parent: ArrayLike, child: ArrayLike, niches: Niches, n: ArrayLike | None = None
    ) -> TransitionCounts:
        """Counts of pairs of states.

        Parameters
        ----------
        parent, child : (N,) ints
            States of parents and of their children.
        niches : Niches
            The niches that the numbers belong to.
        n : (N,) ints, optional
            How many births each pair stands for; by default one.

        Raises
        ------
        NichechainError
            If the lengths differ, a state does not exist, a number is negative, or there are more than
            2**53 births in all.
        """
        i, j = as_whole("parent", parent), as_whole("child", child)
        _check_pairs(i, j, niches, lowest=0)
        size = np.ones(i.size, np.int64) if n is None else _multiplicities("n", n, i.shape)
        shape = (niches.states, niches.states)
        matrix = sparse.coo_array((size, (i, j)), shape=shape).tocsr()
        # A pair that stands for no birth is no transition.
        matrix.eliminate_zeros()
        visits = np.zeros(niches.states, np.int64)
        np.add.at(visits, j, size)
        return cls(matrix, niches, visits)

    def __add__(self, other: TransitionCounts) -> TransitionCounts:
        """Pooled counts.

        Raises
        ------
        NichechainError
            If the niches differ, or there are more than 2**53 births in all.
        """
        if self.niches != other.niches:
            raise NichechainError(f"niches differ: {self.niches} and {other.niches}")
        _check_total("the sum", float(self.births.sum()) + float(other.births.sum()))
        later = other.families.copy()
        if len(self.families):
            # Elites of two runs may bear the same number.
            later[:, 1] += self.families[:, 1].max() + 1 - later[:, 1].min(initial=0)
        lineages = other.lineages.copy()
        lineages[:, :2] += self.lineages[:, :2].max(axis=0, initial=-1) + 1
        return TransitionCounts(
            (self.matrix + other.matrix).tocsr(),
            self.niches,
            self.visits + other.visits,
            np.concatenate([self.families, later]),
            np.concatenate([self.lineages, lineages]),
        )

    def __repr__(self) -> str:
        shown = ", ".join(f"{name} {value}" for name, value in self._facts().items())
        return f"TransitionCounts({shown}; {self.niches})"

    def _repr_html_(self) -> str:
        return facts_table("TransitionCounts", {**self._facts(), "niches": self.niches})

    def _facts(self) -> dict[str, object]:
        return {
            "births with a parent": int(self.births.sum()),
            "rows observed": f"{self.rows_observed} of {len(self.niches)}",
            "births outside": self.births_outside,
            "births of lineages": len(self.lineages),
        }

    @property
    def births(self) -> Ints:
        """Children of parents in each state, (S,): what is known of each row of T."""
        return np.asarray(self.matrix.sum(axis=1), np.int64).ravel()

    @property
    def never_filled(self) -> int:
        """Niches in which nobody was born."""
        return int(np.count_nonzero(self.visits[: len(self.niches)] == 0))

    @property
    def never_parent(self) -> int:
        """Niches in which somebody was born, none of whom became a parent."""
        n = len(self.niches)
        return int(np.count_nonzero((self.visits[:n] > 0) & (self.births[:n] == 0)))

    @property
    def rows_observed(self) -> int:
        """Niches with at least one parent: rows of T that births speak of."""
        return int(np.count_nonzero(self.births[: len(self.niches)]))

    @property
    def births_outside(self) -> int:
        """Births out of bounds."""
        return int(self.visits[len(self.niches) :].sum())


def _multiplicities(name: str, n: ArrayLike, shape: tuple[int, ...]) -> Ints:
    given = as_floats(name, n)
    if given.shape != shape:
        raise NichechainError(
            f"{name} has shape {given.shape}, but must have {shape}, one number for each pair"
        )
    if not (np.isfinite(given).all() and (given >= 0).all() and (given == np.floor(given)).all()):
        raise NichechainError(f"{name} has numbers that are negative or no whole numbers, but counts births")
    _check_total(name, float(given.sum()))
    return given.astype(np.int64)


def _check_total(name: str, births: float) -> None:
    """Refuse more births than floating-point numbers, and sums of whole ones, can count."""
    if births > _MOST_BIRTHS:
        raise NichechainError(f"{name} is {births:.3g} births in all, but at most 2**53 can be counted")


def _states(name: str, values: Any) -> Ints:
    """Numbers of states, -1 for what pandas and Arrow call null."""
    if hasattr(values, "fill_null"):
        # Of Arrow.
        values = values.fill_null(NONE).to_numpy(zero_copy_only=False) if values.null_count else values
    elif hasattr(values, "isna"):
        # Of pandas, where NaN stands for null in a column of floats.
        values = values.fillna(NONE)
    elif np.ma.isMaskedArray(values):
        values = values.filled(NONE)
    return as_whole(name, values)


def _flags(values: Any) -> NDArray[np.bool_]:
    """Yes or no, no for what pandas and Arrow call null."""
    if hasattr(values, "fill_null"):
        return values.fill_null(False).to_numpy(zero_copy_only=False).astype(bool)  # type: ignore[no-any-return]
    return np.asarray(values.fillna(False) if hasattr(values, "fillna") else values, bool)


def _check_pairs(parent: Ints, child: Ints, niches: Niches, *, lowest: int) -> None:
    if parent.shape != child.shape or parent.ndim != 1:
        raise NichechainError(
            f"parents have shape {parent.shape} and children {child.shape}, but must be alike"
        )
    for states in (parent, child):
        odd = states[(states < lowest) | (states >= niches.states)]
        if odd.size:
            raise NichechainError(f"state is {odd[0]}, but states run from 0 to {niches.states - 1}")
