"""Evaluate the offspring of elites, and keep what is evaluated until all is."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nichechain.core.errors import NichechainError
from nichechain.core.unfinished import read_unfinished, write_unfinished
from nichechain.domains.base import Domain
from nichechain.landscape.genotypes import make_offspring
from nichechain.variation import Mutation

if TYPE_CHECKING:
    from nichechain.execution import Executor

Floats = NDArray[np.float64]
Float32s = NDArray[np.float32]
Family = Floats
"""Behaviors (1 + n, B) of a parent and of its offspring, NaN where one failed."""

# An interruption loses the batch under way, so batches grow and shrink to take about so long. With
# more rows they would take up too much memory.
_BATCH_SECONDS = 2.0
_FIRST_BATCH = 64
_LARGEST_BATCH = 8192
_SAVE_SECONDS = 5.0


@dataclass
class Kept:
    """Families that were evaluated, by a digest of all their genotypes.

    What a family is called says all of how it was made: its parent, the operator, the seed and the
    sample size. So it is found again whichever other elites are asked for.

    Parameters
    ----------
    path : Path, optional
        Where they are kept; nowhere by default.
    made_by : dict
        What else shapes a behavior, such as the domain and the versions of libraries, as plain values.
    families : dict of str to (1 + n, B) arrays
    """

    path: Path | None
    made_by: dict[str, Any]
    families: dict[str, Family] = field(default_factory=dict)

    @classmethod
    def read(cls, path: Path | None, made_by: dict[str, Any]) -> Kept:
        """What a file holds, nothing where there is none.

        Raises
        ------
        NichechainError
            If it is damaged, or what made it differs.
        """
        kept = cls(path, made_by)
        arrays = read_unfinished(path, made_by, "measurements", "key", "families")
        if arrays is not None:
            kept.families = dict(zip(arrays["key"].tolist(), arrays["families"], strict=True))
        return kept

    def save(self) -> None:
        """Make all families durable."""
        if self.path is not None and self.families:
            families = np.stack(list(self.families.values()))
            arrays = {"key": np.array(list(self.families)), "families": families}
            write_unfinished(self.path, self.made_by, arrays)


def sample_families(
    domain: Domain,
    parents: Float32s,
    mutate: Mutation,
    sample_size: int,
    seed: int,
    kept: Kept,
    executor: Executor | None = None,
    on_done: Callable[[int], None] | None = None,
) -> Floats:
    """Behaviors of parents and of their offspring.

    Parameters
    ----------
    domain : Domain
    parents : (G, P) float32 array
        G at least 1.
    mutate : Mutation
    sample_size : int
        Offspring of each.
    seed : int
    kept : Kept
        What it holds is not evaluated again. It is added to, and saved every few seconds and when
        the evaluation is interrupted.
    executor : Executor, optional
        Where to evaluate; by default here.
    on_done : callable, optional
        Told how many more have been evaluated, or were kept.

    Returns
    -------
    (G, 1 + sample_size, B) array
        Each parent first; NaN where an evaluation failed.

    Raises
    ------
    NichechainError
        If the domain no longer says of a kept parent what was kept.
    """
    found: list[str] = []
    size = 1 + sample_size
    saved = monotonic()
    waiting: dict[str, Float32s] = {}

    resumed = 0
    rows = _FIRST_BATCH

    def evaluate() -> None:
        nonlocal saved, resumed, rows
        if on_done is not None and resumed:
            on_done(resumed)
            resumed = 0
        began = monotonic()
        batch = np.concatenate(list(waiting.values()))
        if executor is None:
            behavior = domain.evaluate(batch).behavior
            if on_done is not None:
                on_done(len(batch))
        else:
            behavior = executor.evaluate(domain, batch, on_done).behavior
        kept.families.update(zip(waiting, behavior.reshape(len(waiting), size, -1), strict=True))
        waiting.clear()
        took = monotonic() - began
        if took < _BATCH_SECONDS / 2:
            rows = min(_LARGEST_BATCH, 2 * rows)
        elif took > 2 * _BATCH_SECONDS:
            rows = max(1, rows // 2)
        if monotonic() - saved >= _SAVE_SECONDS:
            kept.save()
            saved = monotonic()

    try:
        for parent in parents:
            family = np.concatenate([parent[None], make_offspring(parent[None], mutate, sample_size, seed)])
            key = hashlib.sha256(family.tobytes()).hexdigest()
            found.append(key)
            if key not in kept.families:
                waiting[key] = family
            else:
                if not resumed:
                    _check_same(domain, parent, kept.families[key][0], kept.path)
                # Told at once, so that a rate begins with what is really evaluated.
                resumed += size
            if len(waiting) * size >= rows:
                evaluate()
        if waiting:
            evaluate()
        elif on_done is not None and resumed:
            on_done(resumed)
    finally:
        kept.save()
    return np.stack([kept.families[key] for key in found])


def operator_digest(mutate: Mutation, length: int, seed: int) -> str:
    """What tells an operator and its seed from others: what they make of a genotype."""
    child = make_offspring(np.ones((1, length), np.float32), mutate, 1, seed)
    return hashlib.sha256(child.tobytes()).hexdigest()


def _check_same(domain: Domain, parent: Float32s, kept: Floats, path: Path | None) -> None:
    """Refuse to mix behaviors of two domains under one name."""
    if not np.array_equal(domain.evaluate(parent[None]).behavior[0], kept, equal_nan=True):
        raise NichechainError(
            f"{path} holds measurements that {domain.name} does not repeat, so they were made on another "
            "domain: start over, or remove it"
        )
