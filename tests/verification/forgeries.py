"""Forgeries of an archive, with valid checksums, and what of them does not hold."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from nichechain import births
from nichechain.archive import read, write
from nichechain.archive.archive import Archive, load
from nichechain.search.elites import SearchState
from nichechain.verification import Verification

from ..arms import RoughArm


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

    def fine(self) -> int:
        """A birth of the last steps that is nobody's parent, no elite, and did not fail."""
        rows = self.births
        parents = {*rows["parent_uid"].dropna().astype(int), *self.state.pending.parent_uid.tolist()}
        elites = set(self.state.elites.uid.tolist())
        return next(
            uid
            for uid in reversed(range(len(rows)))
            if uid not in parents | elites and rows.loc[uid, "failed"] is None and rows.loc[uid, "depth"] > 1
        )


def found(result: Verification) -> dict[str, tuple[int, ...]]:
    """Names of what does not hold, with the births that were named."""
    return {check.name: check.uids for check in result.mismatched}


def nudged(value: float) -> float:
    """The next larger number."""
    return float(np.nextafter(value, np.inf))


def one_weight_off(genotype: Any) -> Any:
    """A genotype with one of its parameters nudged."""
    altered = genotype.copy()
    altered[4] = np.nextafter(altered[4], np.float32(9))
    return altered
