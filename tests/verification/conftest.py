"""A small archive of a domain that sometimes fails, and forgeries of it with valid checksums."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from numpy.typing import ArrayLike

from nichechain import births
from nichechain.archive import read, write
from nichechain.archive.archive import Archive, load
from nichechain.archive.building import build
from nichechain.domains import Evaluation, PlanarArm
from nichechain.execution import Threads
from nichechain.search.config import BuildConfig
from nichechain.search.elites import SearchState

# 333 births end in the middle of a step, so children are pending.
CONFIG = BuildConfig(
    "arm",
    (6, 5),
    ((-0.7, 1.0), (-0.9, 0.8)),
    evaluations=333,
    initial=50,
    batch=32,
    scale=0.3,
    seed=5,
    lineage_brood=2,
)


class RoughArm(PlanarArm):
    """An arm that breaks now and then."""

    chunk = 7

    def evaluate(self, genotypes: ArrayLike) -> Evaluation:
        """Fail where the first joint is bent too far."""
        angles = np.asarray(genotypes)
        plain = super().evaluate(angles)
        broken = angles[:, 0] > 0.8
        return Evaluation(
            np.where(broken[:, None], np.nan, plain.behavior),
            np.where(broken, np.nan, plain.objective),
            broken,
            tuple("the first joint broke" if bad else "" for bad in broken),
        )


def built(folder: Path, config: BuildConfig = CONFIG) -> Archive:
    """Build, and open what was built."""
    with Threads(1) as executor:
        build(config, folder, executor, domain=RoughArm())
    return load(folder, domain=RoughArm())


@pytest.fixture(scope="session")
def genuine(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return built(tmp_path_factory.mktemp("genuine") / "archive")


class Forgery:
    """A copy of an archive in memory, to be altered and sealed again."""

    def __init__(self, archive: Archive) -> None:
        self.meta = archive.meta
        self.niches = archive.niches
        rows = read.read_births(archive.folder, archive.meta).to_pylist()
        # Python's own numbers, None for null.
        self.births = pd.DataFrame(rows, dtype=object)
        self.state: SearchState = read.read_state(archive.folder, archive.meta)

    def set(self, uid: int, /, **values: object) -> None:
        """Values of a birth."""
        for name, value in values.items():
            self.births.loc[uid, name] = value

    def elite(self, row: int, **values: object) -> None:
        """Values of an elite."""
        self._alter("elites", row, values)

    def pending(self, row: int, **values: object) -> None:
        """Values of a child that waits."""
        self._alter("pending", row, values)

    def lineage(self, row: int, **values: object) -> None:
        """Values of a lineage under way."""
        self._alter("lineages", row, values)

    def drop_elite(self, row: int) -> None:
        """Leave an elite out."""
        kept = np.arange(len(self.state.elites)) != row
        self.state = replace(self.state, elites=self.state.elites[kept])

    def _alter(self, what: str, row: int, values: dict[str, object]) -> None:
        part = getattr(self.state, what)
        arrays = {name: getattr(part, name).copy() for name in values}
        for name, value in values.items():
            arrays[name][row] = value
        self.state = replace(self.state, **{what: replace(part, **arrays)})

    def sealed(self, folder: Path) -> Archive:
        """Written as a build writes, checksums and all."""
        axes = len(self.meta.facts.behavior_names)
        columns = [
            pa.array([None if pd.isna(value) else value for value in self.births[field.name]]).cast(
                field.type
            )
            for field in births.schema(axes)
        ]
        table = pa.Table.from_arrays(columns, schema=births.schema(axes))
        writer = write.Writer(folder, self.meta.config, self.meta.facts, self.meta.origin, niches=self.niches)
        writer.append(table)
        writer.commit(self.state)
        return load(folder, domain=RoughArm())


@pytest.fixture
def forgery(genuine: Archive) -> Forgery:
    return Forgery(genuine)
