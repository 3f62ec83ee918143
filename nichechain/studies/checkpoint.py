"""How far the block of walks is that is under way: a single file, replaced after every step."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from nichechain.core.errors import ArchiveError
from nichechain.core.files import write_atomically
from nichechain.core.parquet import parquet_bytes, read_parquet
from nichechain.studies.folder import CHECKPOINT, Block
from nichechain.walks import WalkState

_PREFIX = "state_"


@dataclass(frozen=True)
class Walked:
    """How far a block is.

    Parameters
    ----------
    state : WalkState
    records, births : tuple of pyarrow.Table
        Of the steps that are done, in parts.
    """

    state: WalkState
    records: tuple[pa.Table, ...]
    births: tuple[pa.Table, ...]

    @property
    def made(self) -> int:
        """How many births there are."""
        return sum(table.num_rows for table in self.births)


def write_checkpoint(folder: Path, block: Block, at: Walked) -> None:
    """Write how far a block is."""
    arrays: dict[str, Any] = {f"{_PREFIX}{name}": values for name, values in at.state.arrays().items()}
    arrays["block"] = np.frombuffer(block.name.encode(), np.uint8)
    for name, tables in (("records", at.records), ("births", at.births)):
        content = parquet_bytes(pa.concat_tables(tables)) if tables else b""
        arrays[name] = np.frombuffer(content, np.uint8)
    file = io.BytesIO()
    np.savez(file, **arrays)
    write_atomically(folder / CHECKPOINT, file.getvalue())


def under_way(folder: Path) -> str | None:
    """Name of the block that was under way, if one was.

    Raises
    ------
    ArchiveError
        If the file is damaged.
    """
    arrays = _load(folder, ("block",))
    return None if arrays is None else bytes(arrays["block"]).decode("ascii", "replace")


def read_checkpoint(folder: Path, block: Block) -> Walked | None:
    """How far a block was, if it was under way.

    Raises
    ------
    ArchiveError
        If the file is damaged.
    """
    if under_way(folder) != block.name:
        return None
    arrays = _load(folder)
    assert arrays is not None
    try:
        state = WalkState.from_arrays(
            {name.removeprefix(_PREFIX): v for name, v in arrays.items() if name.startswith(_PREFIX)}
        )
        records, births = (
            (read_parquet(pa.BufferReader(arrays[name].tobytes())),) if len(arrays[name]) else ()
            for name in ("records", "births")
        )
    except (KeyError, ValueError, OSError, pa.ArrowException) as error:
        raise _damaged(folder, error) from error
    return Walked(state, records, births)


def remove_checkpoint(folder: Path) -> None:
    """Nothing is under way any more."""
    (folder / CHECKPOINT).unlink(missing_ok=True)


def _load(folder: Path, names: Sequence[str] | None = None) -> dict[str, NDArray[Any]] | None:
    try:
        with np.load(folder / CHECKPOINT, allow_pickle=False) as stored:
            return {name: stored[name] for name in names or stored.files}
    except FileNotFoundError:
        return None
    except (KeyError, ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise _damaged(folder, error) from error


def _damaged(folder: Path, error: Exception) -> ArchiveError:
    path = folder / CHECKPOINT
    return ArchiveError(f"{path} is damaged: {error}; without that file, the walks under way begin anew")
