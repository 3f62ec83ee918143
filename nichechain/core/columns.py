"""Rows that are kept as columns: one array for each field, all of one length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Columnar:
    """What dataclasses of equally long arrays have in common."""

    def __len__(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns().values())))

    def __getitem__(self, rows: slice | NDArray[np.bool_] | NDArray[np.int64]) -> Self:
        return type(self)(*(column[rows] for column in self.columns().values()))

    def columns(self) -> dict[str, NDArray[Any]]:
        """The arrays by their names, in order."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """The rows of several, in order."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
