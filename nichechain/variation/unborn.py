"""Children that are described, and grown where they are needed.

A child is a function of its parent, of a seed and of its number. So whoever evaluates it can grow it:
what has to travel is each parent once, and a number for each child.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nichechain.core.errors import NichechainError
from nichechain.core.randomness import Purpose, keyed
from nichechain.variation.additive import Mutation

# Children that are described together, with 16 bytes each.
_MOST_CHILDREN = 2**28

Float32s = NDArray[np.float32]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Unborn:
    """N children of K parents, not grown yet.

    Parameters
    ----------
    mutate : Mutation
    purpose : Purpose
        What the children are made for, see :func:`nichechain.core.randomness.keyed`.
    parents : (K, P) float32 array
    seeds : sequence of int
        One for each parent: that of the run it lives in.
    parent : (N,) int64 array
        Row of each child's parent.
    number : (N,) int64 array
        Number of each child among those of its seed and purpose.
    names : sequence of hashable, optional
        One for each parent, which no other genotype has while this process lives: who evaluates
        may then keep the parent for the next children.
    """

    mutate: Mutation
    purpose: Purpose
    parents: Float32s
    seeds: Sequence[int]
    parent: Ints
    number: Ints
    names: Sequence[Hashable] | None = None

    def __len__(self) -> int:
        """Number of children."""
        return len(self.number)

    def __getitem__(self, rows: slice | NDArray[np.bool_] | Ints) -> Unborn:
        """Some of the children; the parents stay."""
        return replace(self, parent=self.parent[rows], number=self.number[rows])

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        """The children, for code that expects genotypes."""
        return self.grow().astype(dtype or np.float32, copy=False)

    def grow(self) -> Float32s:
        """The children, (N, P)."""
        children = np.empty((len(self), self.parents.shape[1]), np.float32)
        # Siblings share a parent, so an operator that wrote to it would change the next.
        parents = self.parents.view()
        parents.flags.writeable = False
        for row, (parent, number) in enumerate(zip(self.parent.tolist(), self.number.tolist(), strict=True)):
            rng = keyed(self.seeds[parent], self.purpose, number)
            children[row] = self.mutate(parents[parent], rng)
        return children


def litters(mutate: Mutation, purpose: Purpose, parents: Float32s, seed: int, size: int) -> Unborn:
    """So many children of every parent (K, P), those of the first parent first.

    The i-th child of every parent is made with the same noise.
    """
    count = len(parents)
    check_litter(size, count)
    each = np.repeat(np.arange(count), size)
    return Unborn(mutate, purpose, parents, (seed,) * count, each, np.tile(np.arange(size), count))


def check_litter(offspring: int, parents: int) -> None:
    """Refuse more children than can be described at once.

    Raises
    ------
    NichechainError
        If there are too many of each parent.
    """
    most = _MOST_CHILDREN // max(1, parents)
    if offspring > most:
        raise NichechainError(f"offspring is {offspring}, but must be at most {most} of each parent")


def grown(genotypes: Float32s | Unborn) -> Float32s:
    """Genotypes as an array, (N, P)."""
    return genotypes.grow() if isinstance(genotypes, Unborn) else genotypes
