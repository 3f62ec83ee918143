"""Logs of other programs, in whatever form they come."""

from __future__ import annotations

import gzip
import hashlib
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.core.files import as_path
from nichechain.core.parquet import read_parquet

if TYPE_CHECKING:
    import pandas as pd

_KINDS = ".csv, .csv.gz or .parquet file, nor a folder of .parquet files"


def read_log(log: str | Path | pd.DataFrame | pa.Table) -> tuple[pa.Table, dict[str, str]]:
    """The rows of a log, and what an archive says of where they come from.

    Parameters
    ----------
    log : path, pandas.DataFrame or pyarrow.Table
        A CSV file with a header, plain or gzipped; a Parquet file, or a folder of some, which are read in
        the order of their names; or a table.

    Raises
    ------
    NichechainError
        If it cannot be read.
    """
    if isinstance(log, pa.Table):
        return log, {"file": "a table", "sha256": _digest_of(log)}
    if hasattr(log, "columns"):
        try:
            table = pa.Table.from_pandas(log, preserve_index=False).replace_schema_metadata(None)
        except pa.ArrowException as error:
            raise NichechainError(f"log cannot be read as a table: {str(error).splitlines()[0]}") from error
        return table, {"file": "a DataFrame", "sha256": _digest_of(table)}
    if not isinstance(log, (str, Path)):
        raise NichechainError(f"log is a {type(log).__name__}, but must be a file, a folder or a DataFrame")
    path = as_path("log", log)
    if path.is_dir():
        parts = sorted(path.glob("*.parquet"))
        if not parts:
            raise NichechainError(f"{log} is a folder without a .parquet file, but must have at least one")
        read = [_read(part) for part in parts]
        tables = [table for table, _ in read]
        try:
            table = pa.concat_tables(tables, promote_options="default")
        except pa.ArrowException as error:
            raise NichechainError(
                f"{log} has files that do not belong together, but must have the same columns: "
                f"{str(error).splitlines()[0]}"
            ) from error
        digest = hashlib.sha256("".join(each for _, each in read).encode()).hexdigest()
        return table, {"file": f"{path.name}, {len(parts)} files", "sha256": digest}
    table, digest = _read(path)
    return table, {"file": path.name, "sha256": digest}


def _read(path: Path) -> tuple[pa.Table, str]:
    """Rows of a file, and the checksum of its bytes."""
    kind = "".join(path.suffixes[-2:]).lower() if path.suffix.lower() == ".gz" else path.suffix.lower()
    try:
        # What is no log may have no end, such as a device, and is not read.
        if path.exists() and kind not in (".csv", ".csv.gz", ".parquet"):
            raise NichechainError(f"log {path} is neither a {_KINDS}, which are what can be imported")
        content = path.read_bytes()
    except OSError as error:
        raise NichechainError(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        if isinstance(error, NichechainError):
            raise
        raise NichechainError(f"log is {shown(str(path))}, but must be a file: {error}") from error
    digest = hashlib.sha256(content).hexdigest()
    try:
        if kind == ".parquet":
            return read_parquet(pa.BufferReader(content)), digest
        return _read_csv(gzip.decompress(content) if kind == ".csv.gz" else content), digest
    except (pa.ArrowException, OSError, EOFError, zlib.error) as error:
        reason = str(error).splitlines()[0]
        raise NichechainError(f"{path} cannot be read as {kind[1:].upper()}: {reason}") from error


def _read_csv(content: bytes) -> pa.Table:
    import pyarrow.csv

    # The reader has a thread in any case, which must not be the last to hold Python's bytes.
    own = pa.BufferOutputStream()
    own.write(content)
    return pyarrow.csv.read_csv(pa.BufferReader(own.getvalue()), pyarrow.csv.ReadOptions(use_threads=False))


def _digest_of(table: Any) -> str:
    """A checksum of the rows of a table, however they lie in memory."""
    buffer = pa.BufferOutputStream()
    with pa.ipc.new_stream(buffer, table.schema) as stream:
        stream.write_table(table.combine_chunks())
    return hashlib.sha256(buffer.getvalue()).hexdigest()
