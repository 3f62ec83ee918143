"""Where walks stand between two steps, and what a step measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain import landscape
from nichechain.births.table import NONE
from nichechain.core.arrays import present
from nichechain.walks.diversity import NoveltyArchive

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class WalkState:
    """All that R walks, each of μ states, have to remember between two steps.

    Parameters
    ----------
    step : int
        Steps made so far.
    run : (R,) int64 array
        Number of each walk within its configuration.
    genotype : (R, μ, P) float32 array
    uid, depth, niche : (R, μ) int64 arrays
        Births of the states; niche is ``births.NONE`` where there are no niches.
    path : (R, μ, step + 1, B) float64 array
        Behaviors of each state's lineage: the state itself last, and one that stayed for a step
        once more for it.
    archive : NoveltyArchive
        One per walk, or one that all share.
    stalls : (R,) int64 array
        Places that had no candidate so far, so that a state stayed.
    """

    step: int
    run: Ints
    genotype: NDArray[np.float32]
    uid: Ints
    depth: Ints
    niche: Ints
    path: Floats
    archive: NoveltyArchive
    stalls: Ints

    @property
    def behavior(self) -> Floats:
        """Behavior of each state, (R, μ, B)."""
        return self.path[:, :, -1]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The state as plain arrays, for ``numpy.savez``."""
        names = ("run", "genotype", "uid", "depth", "niche", "path", "stalls")
        return {
            "step": np.array(self.step),
            **{name: getattr(self, name) for name in names},
            "archive_behavior": self.archive.behavior,
            "archive_entered": self.archive.entered,
        }

    @staticmethod
    def from_arrays(arrays: Mapping[str, NDArray[Any]]) -> WalkState:
        """The state that :meth:`arrays` gave."""
        names = ("run", "genotype", "uid", "depth", "niche", "path", "stalls")
        return WalkState(
            step=int(arrays["step"]),
            archive=NoveltyArchive(arrays["archive_behavior"], arrays["archive_entered"]),
            **{name: arrays[name] for name in names},
        )


@dataclass(frozen=True)
class StepRecord:
    """Measures of the μ states of R walks, and who followed them.

    Parameters
    ----------
    step : int
    run : (R,) int64 array
    uid : (R, μ) int64 array
    behavior : (R, μ, B) array
    niche : (R, μ) int64 array
        ``births.NONE`` where there are no niches.
    sample_size : (R, μ) int64 array
        Offspring of the state that did not fail: those that it is measured by.
    local_sensitivity, expected_local_sensitivity : (R, μ) arrays
        LS and LS*.
    evolvability, expected_evolvability : (R, μ) arrays
        η and η*; η* is NaN where fewer than two offspring did not fail.
    coverage : (R, μ) array
        d/n, the one-hot evolvability; NaN where there are no niches.
    population_evolvability : (R,) array
        ρ*: η* over the states that follow; NaN where μ is 1.
    next_uid : (R, μ) int64 array
        The states that follow; one of ``uid`` where a state stayed.
    next_behavior : (R, μ, B) array
    diversity : (R, μ) array
        G of the states that follow; NaN where one stayed for want of a candidate.
    stalled : (R,) int64 array
        Places that had no candidate.
    """

    step: int
    run: Ints
    uid: Ints
    behavior: Floats
    niche: Ints
    sample_size: Ints
    local_sensitivity: Floats
    expected_local_sensitivity: Floats
    evolvability: Floats
    expected_evolvability: Floats
    coverage: Floats
    population_evolvability: Floats
    next_uid: Ints
    next_behavior: Floats
    diversity: Floats
    stalled: Ints

    def table(self) -> pa.Table:
        """One row for each walk and state; NaN is null."""
        walks, states = self.uid.shape
        axes = self.behavior.shape[2]
        columns: dict[str, pa.Array] = {
            "run": pa.array(np.repeat(self.run, states), pa.int32()),
            "step": pa.array(np.full(walks * states, self.step), pa.int32()),
            "state": pa.array(np.tile(np.arange(states), walks), pa.int32()),
            "uid": pa.array(self.uid.ravel()),
            "niche": pa.array(self.niche.ravel(), pa.int32(), mask=self.niche.ravel() == NONE),
            **{f"behavior_{axis}": pa.array(self.behavior[:, :, axis].ravel()) for axis in range(axes)},
            "sample_size": pa.array(self.sample_size.ravel(), pa.int32()),
        }
        for name in (
            "local_sensitivity",
            "expected_local_sensitivity",
            "evolvability",
            "expected_evolvability",
            "coverage",
        ):
            columns[name] = pa.array(getattr(self, name).ravel(), from_pandas=True)
        columns["population_evolvability"] = pa.array(
            np.repeat(self.population_evolvability, states), from_pandas=True
        )
        columns["next_uid"] = pa.array(self.next_uid.ravel())
        for axis in range(axes):
            columns[f"next_behavior_{axis}"] = pa.array(self.next_behavior[:, :, axis].ravel())
        columns["diversity"] = pa.array(self.diversity.ravel(), from_pandas=True)
        columns["stalled"] = pa.array(np.repeat(self.stalled, states), pa.int32())
        return pa.table(columns)


def record_table(records: Sequence[StepRecord]) -> pa.Table:
    """Rows of several steps, in order."""
    return pa.concat_tables([record.table() for record in records])


def measure_states(
    parent: Floats, offspring: Floats, niche: Ints, niches: int
) -> tuple[Ints, Floats, Floats, Floats, Floats, Floats]:
    """Measures of states from their offspring.

    Parameters
    ----------
    parent : (R, μ, B) array
    offspring : (R, μ, n, B) array
    niche : (R, μ, n) int64 array
    niches : int
        Number of niches, 0 if there are none.

    Returns
    -------
    sample_size, LS, LS*, η, η*, d/n : (R, μ) arrays
    """
    size: Ints = present(offspring).sum(axis=-1, dtype=np.int64)
    coverage = landscape.one_hot_evolvability(niche, niches) if niches else np.full(size.shape, np.nan)
    return (
        size,
        landscape.local_sensitivity(parent, offspring),
        landscape.expected_local_sensitivity(parent, offspring),
        landscape.evolvability(offspring),
        landscape.expected_evolvability(offspring),
        coverage,
    )
