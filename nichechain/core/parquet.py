"""Small Parquet files: read without a thread of anybody's pool, written with checksums."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq


def read_parquet(source: Path | pa.NativeFile, *, checksums: bool = False) -> pa.Table:
    """All rows of a file.

    A thread of pyarrow's pool that lets go of Python's bytes while the interpreter ends takes the
    process with it, "terminate called without an active exception"
    (https://github.com/apache/arrow/issues/34314, 45017). So none is begun.

    Parameters
    ----------
    source : Path or pyarrow.NativeFile
    checksums : bool
        Whether pages are held against their checksums.

    Raises
    ------
    OSError, pyarrow.ArrowException
        If it cannot be read.
    """
    # A name with a colon would pass for an address on the net, and one that is not UTF-8 for none.
    opened = pa.BufferReader(source.read_bytes()) if isinstance(source, Path) else source
    with opened, pq.ParquetFile(opened, pre_buffer=False, page_checksum_verification=checksums) as file:
        return file.read(use_threads=False)


def parquet_bytes(table: pa.Table) -> bytes:
    """A table as the content of a file, each page with a checksum."""
    content = pa.BufferOutputStream()
    pq.write_table(table, content, compression="zstd", write_page_checksum=True)
    written: bytes = content.getvalue().to_pybytes()
    return written
