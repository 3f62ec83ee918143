"""The chain: a transition matrix over niches, given or estimated."""

from __future__ import annotations

from functools import cached_property
from numbers import Integral
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from nichechain.chain.operator import PooledTransition
from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.core.notebook import facts_table
from nichechain.niches import OUTSIDE, Niche, Niches

if TYPE_CHECKING:
    import networkx as nx

    from nichechain.chain.counts import TransitionCounts
    from nichechain.chain.posterior import DirichletPosterior

Floats = NDArray[np.float64]
Matrix: TypeAlias = "Floats | sparse.csr_array"
Transition: TypeAlias = "Matrix | PooledTransition"


# T as a matrix, where it is kept in parts: 16,384 states.
_MOST_BYTES = 2**31


class NicheChain:
    """A Markov chain whose states are niches: step 4 of the paper's procedure. Immutable.

    Parameters
    ----------
    transition : (S, S) array, scipy.sparse matrix or PooledTransition, optional
        ``transition[i, j]`` = P(child in state j | parent in state i). Left out where there is a
        posterior.
    outside : int, optional
        Number of the state of behaviors out of bounds, which must be the last; it is no niche.
        By default there is none.
    niches : Niches, optional
        What the states are; lets niches be named by grid index.
    posterior : DirichletPosterior, optional
        What is known of T where it was estimated.
    counts : TransitionCounts, optional
        The births that T was estimated from.
    estimator : str
        How T came about.
    normalize : bool
        Whether to divide each row of ``transition`` by its sum, for counts, or for rows that sum to 1
        only in single precision.

    Raises
    ------
    NichechainError
        If the matrix is not square, not real, not finite, negative, or a row does not sum to 1.
    """

    def __init__(
        self,
        transition: ArrayLike | sparse.sparray | sparse.spmatrix | PooledTransition | None = None,
        *,
        outside: int | None = None,
        niches: Niches | None = None,
        posterior: DirichletPosterior | None = None,
        counts: TransitionCounts | None = None,
        estimator: str = "given",
        normalize: bool = False,
    ) -> None:
        if (transition is None) == (posterior is None):
            raise NichechainError("a chain needs either a transition matrix or a posterior")
        self._given = None if transition is None else _stochastic(transition, normalize=normalize)
        self.niches = niches
        self.posterior = posterior
        self.counts = counts
        self.estimator = estimator
        self.states: int = (
            posterior.counts.niches.states if posterior is not None else self._given.shape[0]  # type: ignore[union-attr]
        )
        if outside is not None and (not isinstance(outside, Integral) or outside != self.states - 1):
            raise NichechainError(
                f"outside is {shown(outside)}, but must be the last state, {self.states - 1}"
            )
        self.outside = outside
        self.n_niches = self.states - (outside is not None)
        if niches is not None and len(niches) != self.n_niches:
            raise NichechainError(f"T has {self.n_niches} niches, but the grid has {len(niches)}")

    def __repr__(self) -> str:
        place = "" if self.outside is None else " and outside"
        return f"NicheChain({self.n_niches} niches{place}, estimator: {self.estimator})"

    def _repr_html_(self) -> str:
        facts: dict[str, object] = {
            "niches": self.n_niches,
            "outside": "none" if self.outside is None else f"state {self.outside}",
            "T": self.estimator,
        }
        if self.counts is not None:
            births = int(self.counts.births.sum())
            facts |= {"births with a parent": births, "rows observed": self.counts.rows_observed}
        return facts_table("NicheChain", facts)

    @cached_property
    def T(self) -> Matrix:  # noqa: N802  # the paper's name
        """The transition matrix (S, S); its posterior mean where it was estimated with one.

        Raises
        ------
        NichechainError
            If T is kept in parts and would take more than 2 GiB as a matrix.
        """
        parts = self._given is None or isinstance(self._given, PooledTransition)
        if parts and 8 * self.states**2 > _MOST_BYTES:
            raise NichechainError(
                f"T of {self.states} states would take {8 * self.states**2 / 2**30:.1f} GiB as a matrix: "
                "multiply with chain.operator instead"
            )
        if isinstance(self._given, PooledTransition):
            return self._given.toarray()
        if self._given is not None:
            return self._given
        assert self.posterior is not None
        return self.posterior.mean()

    @cached_property
    def operator(self) -> Transition:
        """T to multiply with: the same, but kept in parts where it was estimated with a posterior."""
        if self._given is not None:
            return self._given
        assert self.posterior is not None
        return self.posterior.mean_operator()

    @property
    def births(self) -> NDArray[np.int64] | None:
        """Births behind each row of T (S,), where T was estimated."""
        return None if self.counts is None else self.counts.births

    def state(self, niche: Niche) -> int:
        """Flat id of a niche given as flat id or grid index, or of the outside state.

        Raises
        ------
        NichechainError
            If there is no such niche.
        """
        if self.niches is not None:
            return self.niches.state(niche)
        if self.outside is not None and niche in (OUTSIDE, self.outside):
            return self.outside
        if not isinstance(niche, (int, np.integer)) or isinstance(niche, np.timedelta64):
            raise NichechainError(f"niche is {shown(niche)}, but this chain has no grid: give its number")
        if not 0 <= niche < self.n_niches:
            raise NichechainError(f"niche is {niche}, but this chain has niches 0 to {self.n_niches - 1}")
        return int(niche)

    def label(self, state: int) -> str:
        """How a state is called: its grid index, its number, or ``outside``."""
        if state == self.outside:
            return "outside"
        return str(state) if self.niches is None else self.niches.label(state)

    def niche_evolvability(self, l: int = 5, lineages: int = 100, **options: Any) -> Floats:
        """l-evolvability of every niche, (n_niches,).

        The values of :func:`nichechain.evolvability.niche_evolvability`, which takes the same
        options and gives intervals as well.
        """
        from nichechain.evolvability import niche_evolvability

        return niche_evolvability(self, l=l, lineages=lineages, **options).value

    def graph(self, threshold: float = 0.05) -> nx.DiGraph:
        """The chain as a graph, see :func:`nichechain.chain.structure.graph.reachability_graph`."""
        from nichechain.chain.structure.graph import reachability_graph

        return reachability_graph(self, threshold)


def _stochastic(
    transition: ArrayLike | sparse.sparray | sparse.spmatrix | PooledTransition, *, normalize: bool
) -> Transition:
    """The matrix in float64, sparse if it was, after checking that it is row-stochastic."""
    if isinstance(transition, PooledTransition):
        return transition
    matrix: Matrix
    try:
        array = sparse.csr_array(transition) if sparse.issparse(transition) else np.asarray(transition)
        given = array.dtype
        if given.kind == "c":
            raise NichechainError("T has complex numbers, but must have probabilities: take T.real if it is")
        matrix = array.astype(np.float64)
    except (TypeError, ValueError) as error:
        if isinstance(error, NichechainError):
            raise
        raise NichechainError("T has rows of unequal length or values that are no numbers") from None
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.shape[0]:
        raise NichechainError(f"T has shape {matrix.shape}, but must be square with at least one state")
    values = matrix if isinstance(matrix, np.ndarray) else matrix.data
    if not np.isfinite(values).all():
        raise NichechainError("T has NaN or infinite values, but must have probabilities")
    if values.size and values.min() < 0:
        raise NichechainError(f"T has a value of {values.min():g}, but probabilities are not negative")
    sums = np.asarray(matrix.sum(axis=1)).ravel()
    if normalize:
        matrix = _divided(matrix, sums)
        values = matrix if isinstance(matrix, np.ndarray) else matrix.data
    else:
        _check_sums(sums, given)
    values.setflags(write=False)
    return matrix


def _divided(matrix: Matrix, sums: Floats) -> Matrix:
    """Rows divided by their sums."""
    odd = np.flatnonzero(~((sums > 0.0) & np.isfinite(sums)))
    if odd.size:
        raise NichechainError(
            f"row {odd[0]} of T sums to {sums[odd[0]]:g}, so normalize=True cannot make it sum to 1"
        )
    if isinstance(matrix, np.ndarray):
        return matrix / sums[:, None]
    return sparse.csr_array(sparse.diags_array(1.0 / sums) @ matrix)


def _check_sums(sums: Floats, given: np.dtype[Any]) -> None:
    """Refuse rows that do not sum to 1 in the precision that they were given in."""
    precision = np.finfo(given).eps if np.issubdtype(given, np.floating) else np.finfo(float).eps
    off = np.abs(sums - 1.0)
    worst = int(np.argmax(off))
    if off[worst] > 8 * sums.size * precision + 1e-12:
        raise NichechainError(
            f"row {worst} of T sums to {sums[worst]:.9g}, but every row must sum to 1: "
            "normalize=True divides each row by its sum"
        )
