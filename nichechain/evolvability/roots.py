"""What a question about one root needs of a chain: draws of T, and where the root's children land."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.chain.model import NicheChain, Transition
from nichechain.core.checks import as_floats
from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.niches import Niche

Floats = NDArray[np.float64]


def transition_draws(chain: NicheChain, draws: int, seed: int) -> Iterator[Transition]:
    """T itself where it is given, draws from its posterior where it is estimated with one.

    Parameters
    ----------
    chain : NicheChain
    draws : int
        Number of draws, where there is a posterior.
    seed : int
        Draw k comes from ``keyed(seed, Purpose.POSTERIOR, k)``.

    Yields
    ------
    (S, S) array, scipy.sparse.csr_array or PooledTransition
    """
    if chain.posterior is None:
        yield chain.operator
        return
    for number in range(draws):
        yield chain.posterior.draw(keyed(seed, Purpose.POSTERIOR, number))


class Root:
    """Where lineages begin: in a niche, or with offspring of a given distribution.

    Parameters
    ----------
    chain : NicheChain
    niche : int or tuple of int, optional
        The root stands in this niche.
    offspring : (n_niches,) or (S,) array, optional
        D: generation 1 is drawn from this distribution. Give either this or ``niche``.

    Raises
    ------
    NichechainError
        If not exactly one is given, there is no such niche, or D is no distribution.
    """

    def __init__(
        self, chain: NicheChain, *, niche: Niche | None = None, offspring: ArrayLike | None = None
    ) -> None:
        if (niche is None) == (offspring is None):
            raise NichechainError("give either a niche or the distribution of the offspring, and only one")
        self.state = None if niche is None else chain.state(niche)
        self._distribution = np.zeros(chain.states)
        if offspring is not None:
            self._distribution = _distribution(offspring, chain)
        else:
            self._distribution[self.state] = 1.0

    def first(self, transition: Transition, convention: str) -> Floats:
        """Distribution of the first state that counts, (S,).

        Under ``procedure`` that is the root's own state, under ``definition`` its child's.
        """
        if self.state is None or convention == "procedure":
            return self._distribution
        if isinstance(transition, np.ndarray):
            row: Floats = transition[self.state]
        else:
            row = transition[[self.state]].toarray()[0]
        return row


def generations(l: int, convention: str) -> int:  # noqa: E741  # the paper's name
    """States of a walk that count. Under ``procedure`` the root's own state is one of them."""
    return l + 1 if convention == "procedure" else l


def _distribution(offspring: ArrayLike, chain: NicheChain) -> Floats:
    given = as_floats("offspring", offspring)
    if given.shape not in ((chain.n_niches,), (chain.states,)):
        raise NichechainError(
            f"offspring has shape {given.shape}, but must be ({chain.n_niches},), one share per niche"
        )
    if not np.isfinite(given).all() or (given < 0).any() or abs(given.sum() - 1.0) > 1e-8:
        raise NichechainError(
            f"offspring sums to {given.sum():.9g}, but must be shares that are not negative and sum to 1"
        )
    shares = np.zeros(chain.states)
    shares[: given.size] = given
    return shares
