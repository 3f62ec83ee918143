"""All local measures of several genotypes at once, and what each of them is called."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.births.table import NONE
from nichechain.core.arrays import present
from nichechain.core.checks import as_floats, as_tuple, check_at_least
from nichechain.core.errors import NichechainError
from nichechain.landscape.behaviors import (
    EPSILON,
    dissimila_ratio,
    evolvability,
    expected_evolvability,
    expected_local_sensitivity,
    hull_volume,
    local_sensitivity,
    one_hot_evolvability,
)
from nichechain.niches import Niches

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Pairs of offspring measured at once (16 MiB per axis of behavior).
_PAIRS = 2**21


@dataclass(frozen=True)
class Measure:
    """A measure as people know it.

    Parameters
    ----------
    name : str
        Of the column.
    symbol : str
        As the paper writes it.
    title : str
    axes : str
        Its unit as a power of the unit of behavior: none, that unit, or one factor per axis.
    """

    name: str
    symbol: str
    title: str
    axes: str = "one"


_ALL = (
    Measure("local_sensitivity", "LS", "local sensitivity"),
    Measure("expected_local_sensitivity", "LS*", "expected local sensitivity"),
    Measure("evolvability", "η", "evolvability"),
    Measure("expected_evolvability", "η*", "expected evolvability"),
    Measure("one_hot_evolvability", "d/n", "one-hot evolvability", "none"),
    Measure("ratio", "r", "dissimila ratio", "none"),
    Measure("expected_ratio", "r*", "expected dissimila ratio", "none"),
    Measure("hull_volume", "hull", "convex hull of the offspring", "all"),
)

MEASURES = {measure.name: measure for measure in _ALL}
"""Every local measure by its name."""


@dataclass(frozen=True)
class LocalMeasures:
    """Local measures of G genotypes, each from a sample of its offspring.

    Parameters
    ----------
    sample_size : int
        Offspring of each.
    failed : (G,) int64 array
        Those whose evaluation failed, which no measure counts.
    local_sensitivity, expected_local_sensitivity : (G,) arrays
        LS and LS*, in units of behavior.
    evolvability, expected_evolvability : (G,) arrays
        η and η*, in units of behavior.
    one_hot_evolvability : (G,) array
        d/n; NaN where there are no niches.
    ratio, expected_ratio : (G,) arrays
        r and r*.
    hull_volume : (G,) array
        In units of behavior to the power of its axes.
    """

    sample_size: int
    failed: Ints
    local_sensitivity: Floats
    expected_local_sensitivity: Floats
    evolvability: Floats
    expected_evolvability: Floats
    one_hot_evolvability: Floats
    ratio: Floats
    expected_ratio: Floats
    hull_volume: Floats

    def __len__(self) -> int:
        return len(self.failed)

    def __getitem__(self, measure: str) -> Floats:
        """The measure of that name.

        Raises
        ------
        NichechainError
            If there is none.
        """
        column: Floats = getattr(self, find_measure(measure).name)
        return column


def find_measure(name: str) -> Measure:
    """The measure of that name; hyphens do for underscores.

    Raises
    ------
    NichechainError
        If there is none.
    """
    found = MEASURES.get(str(name).strip().replace("-", "_"))
    if found is None:
        known = ", ".join(known.replace("_", "-") for known in MEASURES)
        raise NichechainError(f"there is no measure {name!r}: it must be one of {known}")
    return found


def find_measures(names: Sequence[str]) -> tuple[Measure, ...]:
    """The measures of these names, each once, in the order given.

    Raises
    ------
    NichechainError
        If there are no names, or no measure bears one of them.
    """
    names = as_tuple("names", names)
    if not names:
        raise NichechainError("no measure is named, but at least one is needed")
    return tuple(dict.fromkeys(find_measure(name) for name in names))


def measure_behaviors(
    parent: ArrayLike, offspring: ArrayLike, niches: Niches | None = None, *, epsilon: float = EPSILON
) -> LocalMeasures:
    """All local measures of genotypes, from behaviors alone.

    Parameters
    ----------
    parent : (G, B) array
    offspring : (G, n, B) array
        NaN where an evaluation failed.
    niches : Niches, optional
        For one-hot evolvability.
    epsilon : float
        As in :func:`dissimila_ratio`.

    Returns
    -------
    LocalMeasures
        A genotype's do not depend on the others.

    Raises
    ------
    NichechainError
        If the shapes do not fit together, a sample has fewer than 2 offspring, or a behavior is
        infinite.
    """
    roots, born = as_floats("parent", parent), as_floats("offspring", offspring)
    if roots.ndim != 2 or born.ndim != 3 or (len(born), born.shape[2]) != roots.shape:
        raise NichechainError(
            f"parent and offspring have shapes {roots.shape} and {born.shape}, "
            "but must be (G, B) and (G, n, B)"
        )
    size = born.shape[1]
    check_sample_size(size)
    if not np.isfinite(roots).all() or np.isinf(born).any():
        raise NichechainError("behaviors have infinite values, or parents NaN, which no distance can measure")
    pairs = size * (size - 1) // 2
    step = max(1, _PAIRS // pairs)
    blocks = [slice(first, first + step) for first in range(0, len(roots), step)]
    widest = _joined([evolvability(born[block]) for block in blocks])
    mean = _joined([expected_evolvability(born[block]) for block in blocks])
    farthest, away = local_sensitivity(roots, born), expected_local_sensitivity(roots, born)
    alive = present(born)
    covered = np.full(len(roots), np.nan)
    if niches is not None:
        state = np.full(alive.shape, NONE, np.int64)
        state[alive] = niches.of(born[alive])
        covered = one_hot_evolvability(state, len(niches))
    return LocalMeasures(
        sample_size=size,
        failed=(~alive).sum(axis=1),
        local_sensitivity=farthest,
        expected_local_sensitivity=away,
        evolvability=widest,
        expected_evolvability=mean,
        one_hot_evolvability=covered,
        ratio=dissimila_ratio(widest, farthest, epsilon),
        expected_ratio=dissimila_ratio(mean, away, epsilon),
        hull_volume=np.array([hull_volume(sample) for sample in born], np.float64),
    )


def check_sample_size(size: int, name: str = "sample_size") -> None:
    """Refuse a sample too small for evolvability.

    Parameters
    ----------
    size : int
    name : str, optional
        What the caller knows it by.

    Raises
    ------
    NichechainError
        If it is below 2.
    """
    check_at_least(2, **{name: size})


def _joined(parts: list[Floats]) -> Floats:
    return np.concatenate(parts) if parts else np.empty(0)
