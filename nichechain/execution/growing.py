"""Broods on their way to workers far away: each parent travels once, each child as two numbers."""

from __future__ import annotations

import itertools
import pickle
from collections.abc import Hashable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from nichechain.core.randomness import Purpose
from nichechain.variation import Mutation
from nichechain.variation.unborn import Unborn

Float32s = NDArray[np.float32]
Ints = NDArray[np.int64]

MEMORY = 64 * 2**20
"""Bytes of parents that a worker keeps before it forgets them all."""


@dataclass(frozen=True)
class Letter:
    """Some unborn children, as a worker is told of them.

    Parameters
    ----------
    forget : bool
        Whether to forget all parents first.
    parents : dict
        Parents that the worker does not have yet: seed and genotype (P,), by the handle that they
        have with it.
    parent : (n,) int64 array
        Handle of each child's parent.
    number : (n,) int64 array
    purpose : Purpose
    mutate : bytes, optional
        The pickled operator, where it is another than before.
    """

    forget: bool
    parents: dict[int, tuple[int, Float32s]]
    parent: Ints
    number: Ints
    purpose: Purpose
    mutate: bytes | None


class Sender:
    """What one worker has been told so far, so that it is told once.

    Workers do what they are sent in order, and one that loses a letter is lost itself.
    """

    def __init__(self) -> None:
        self._handles: dict[Hashable, int] = {}
        self._next = itertools.count()
        self._held = 0
        self._mutate: bytes | None = None

    def letter(self, unborn: Unborn, mutate: bytes) -> Letter:
        """The letter about unborn children, whose pickled operator is given."""
        forget = self._held > MEMORY
        if forget:
            self._handles.clear()
            self._held = 0
        rows, which = np.unique(unborn.parent, return_inverse=True)
        handles = np.empty(rows.size, np.int64)
        news: dict[int, tuple[int, Float32s]] = {}
        for i, row in enumerate(rows.tolist()):
            # A parent without a name is held all the same, but never found again.
            name = object() if unborn.names is None else unborn.names[row]
            if name not in self._handles:
                self._handles[name] = next(self._next)
                genotype = unborn.parents[row]
                self._held += genotype.nbytes
                news[self._handles[name]] = (unborn.seeds[row], genotype)
            handles[i] = self._handles[name]
        known = mutate == self._mutate
        self._mutate = mutate
        return Letter(forget, news, handles[which], unborn.number, unborn.purpose, None if known else mutate)


class Receiver:
    """A worker's side: the parents that it keeps."""

    def __init__(self) -> None:
        self._parents: dict[int, tuple[int, Float32s]] = {}
        self._mutate: Mutation | None = None

    def unborn(self, letter: Letter) -> Unborn:
        """What a letter is about.

        Raises
        ------
        Exception
            What unpacking the operator raises.
        """
        if letter.mutate is not None:
            self._mutate = pickle.loads(letter.mutate)  # noqa: S301  # from our own driver
        assert self._mutate is not None
        if letter.forget:
            self._parents.clear()
        # Copies, for Ray's arrays would hold on to the whole letter.
        self._parents |= {handle: (seed, one.copy()) for handle, (seed, one) in letter.parents.items()}
        rows, which = np.unique(letter.parent, return_inverse=True)
        seeds, genotypes = zip(*(self._parents[row] for row in rows.tolist()), strict=True)
        return Unborn(self._mutate, letter.purpose, np.stack(genotypes), seeds, which, letter.number)


def by_parent(unborn: Unborn) -> tuple[Unborn, Ints]:
    """Unborn children with siblings side by side, and where its rows are then.

    Siblings often move alike, so who evaluates some of them well has them all.
    """
    order = np.argsort(unborn.parent, kind="stable")
    back = np.empty_like(order)
    back[order] = np.arange(order.size)
    return replace(unborn, parent=unborn.parent[order], number=unborn.number[order]), back
