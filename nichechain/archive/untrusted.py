"""Decoding what somebody else may have written: claims are checked before memory is given for them.

Everything here raises ValueError, or whatever the libraries beneath make of bytes they were never
meant to see; which file it was is for the caller to say.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import stat
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import DTypeLike, NDArray

from nichechain.archive.parquet_pages import decoded_size
from nichechain.core.text import printable

LONGEST_STRING = 1000
"""Bytes of the longest string in a table, or characters in metadata, that is believed."""

_SLACK = 1 << 20
_NUMBER = 64
_THRIFT = 1 << 20


def read_file(path: Path, root: Path, limit: int | None = None) -> bytes:
    """The content of a plain file within a folder, links followed.

    Parameters
    ----------
    path : Path
    root : Path
        The folder that the file must lie in.
    limit : int, optional
        Bytes that it may have.

    Raises
    ------
    ValueError
        If it lies outside the folder, is no plain file or is larger.
    OSError
        If it cannot be read.
    """
    real = path.resolve(strict=True)
    if not real.is_relative_to(root.resolve()):
        raise ValueError("it lies outside the folder")
    # Opening a pipe would wait for ever.
    status = real.stat()
    if not stat.S_ISREG(status.st_mode):
        raise ValueError("it is no plain file")
    if limit is not None and status.st_size > limit:
        raise ValueError(f"it has {status.st_size} bytes, but can have no more than {limit}")
    with real.open("rb") as file:
        content = file.read(status.st_size)
    if len(content) != status.st_size:
        raise ValueError("it ends too early")
    return content


def sha256(content: bytes) -> str:
    """SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def read_object(content: bytes) -> dict[str, Any]:
    """A JSON object."""
    values = json.loads(content.decode("utf-8"))
    if not isinstance(values, dict):
        raise ValueError("it holds no object")
    longest = _longest(values)
    if longest > LONGEST_STRING:
        raise ValueError(f"it has a text of {longest} characters, more than {LONGEST_STRING}")
    return values


def _longest(values: Any) -> int:
    """Characters of the longest text in a JSON value, keys included."""
    match values:
        case str():
            return len(values)
        case list():
            return max(map(_longest, values), default=0)
        case dict():
            return max((max(len(name), _longest(value)) for name, value in values.items()), default=0)
        case _:
            return 0


def read_arrays(
    content: bytes,
    kinds: Mapping[str, tuple[DTypeLike, int]],
    *optional: Mapping[str, tuple[DTypeLike, int]],
) -> dict[str, NDArray[Any]]:
    """Arrays of an ``.npz`` file as ``numpy.savez`` writes it: uncompressed, never pickled.

    Parameters
    ----------
    content : bytes
    kinds : mapping of str to (dtype, int)
        Type and number of dimensions of each array that is wanted.
    *optional : mapping of str to (dtype, int)
        The same of arrays that are wanted where they are there: all of a mapping, or none is.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = archive.infolist()
        if any(member.compress_type != zipfile.ZIP_STORED for member in members):
            raise ValueError("it is compressed, which no archive is")
        if sum(member.file_size for member in members) > len(content):
            raise ValueError("it claims to hold more than it does")
        names = [member.filename for member in members]
        for group in optional:
            kinds = {**kinds, **(group if any(f"{name}.npy" in names for name in group) else {})}
        for name in kinds:
            if names.count(f"{name}.npy") != 1:
                raise ValueError(f"it should hold {name} once")
        return {name: read_array(archive.read(f"{name}.npy"), *kind) for name, kind in kinds.items()}


def read_array(content: bytes, dtype: DTypeLike, dimensions: int) -> NDArray[Any]:
    """An array of an ``.npy`` file, never pickled.

    Parameters
    ----------
    content : bytes
    dtype : dtype
    dimensions : int
    """
    stream = io.BytesIO(content)
    if np.lib.format.read_magic(stream) != (1, 0):
        raise ValueError("an array has a format that no archive has")
    shape, fortran, found = np.lib.format.read_array_header_1_0(stream)
    if found != np.dtype(dtype) or found.hasobject or len(shape) != dimensions:
        raise ValueError(f"an array is {found} of {len(shape)} dimensions, not {dtype} of {dimensions}")
    count = math.prod(shape)
    start = stream.tell()
    if min(shape, default=0) < 0 or count * found.itemsize != len(content) - start:
        raise ValueError(f"an array of shape {shape} does not fit its {len(content) - start} bytes")
    flat = np.frombuffer(content, found, count, start)
    # The order in memory is kept, for it decides the bytes of the next commit.
    return flat.reshape(shape, order="F" if fortran else "C").copy(order="K")


def read_table(
    content: bytes, schema: pa.Schema, rows: int, columns: list[str] | None = None, *, flag: str
) -> pa.Table:
    """A Parquet file of that schema and that many rows.

    Parameters
    ----------
    content : bytes
    schema : pyarrow.Schema
        Of numbers, booleans and strings.
    rows : int
        Memory is bounded by a multiple of it.
    columns : list of str, optional
        Those that are wanted; by default all.
    flag : str
        The last column, which may be missing where it is false in all rows.
    """
    flagged = schema
    texts = [field.name for field in schema if pa.types.is_string(field.type)]
    file = pq.ParquetFile(
        pa.BufferReader(content),
        # A string may be stored once and named in every row, so rows are only spelled out when
        # the longest is known.
        read_dictionary=texts,
        pre_buffer=False,
        thrift_string_size_limit=_THRIFT,
        thrift_container_size_limit=_THRIFT,
    )
    meta = file.metadata
    if flag not in meta.schema.to_arrow_schema().names:
        schema = schema.remove(schema.get_field_index(flag))
    if not meta.schema.to_arrow_schema().remove_metadata().equals(schema):
        raise ValueError("its columns are not those of births")
    groups = [meta.row_group(group) for group in range(meta.num_row_groups)]
    if meta.num_rows != rows or sum(group.num_rows for group in groups) != rows:
        raise ValueError(f"it has {meta.num_rows} rows, but {rows} were written")
    for index, name in enumerate(schema.names):
        # Over all groups: they could name the same pages again and again.
        size = sum(decoded_size(content, group.column(index)) for group in groups)
        if size > _SLACK + (LONGEST_STRING if name in texts else _NUMBER) * rows:
            raise ValueError(f"its column {name} claims to be larger than it can be")
    # See nichechain.core.parquet on threads.
    wanted = columns if columns is None else [name for name in columns if name in schema.names]
    table = file.read(wanted, use_threads=False)
    if len(table) != rows:
        raise ValueError(f"it has {len(table)} rows, but {rows} were written")
    for name in texts:
        if name in table.column_names:
            place = table.column_names.index(name)
            table = table.set_column(place, schema.field(name), _spelled_out(table[name]))
    table.validate(full=True)
    if flag not in table.column_names and (columns is None or flag in columns):
        table = table.append_column(flagged.field(flag), pa.array(np.zeros(rows, bool)))
    return table if columns is None else table.select(columns)


def _spelled_out(texts: pa.ChunkedArray) -> pa.ChunkedArray:
    for chunk in texts.chunks:
        longest = pc.max(pc.binary_length(chunk.dictionary)).as_py() if len(chunk.dictionary) else 0
        if (longest or 0) > LONGEST_STRING:
            raise ValueError(f"it has a string of {longest} bytes, more than {LONGEST_STRING}")
    plain = texts.cast(pa.string())
    if all(text.isprintable() for chunk in texts.chunks for text in chunk.dictionary.to_pylist() if text):
        return plain
    return pa.chunked_array([[None if t is None else printable(t) for t in plain.to_pylist()]], pa.string())
