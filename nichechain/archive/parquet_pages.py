"""How much memory the pages of a Parquet file ask for, before anything is decoded.

A reader allocates what a page's header claims, which the footer need not confirm. Headers are
structs in Thrift's compact protocol (https://github.com/apache/thrift, doc/specs), described in
parquet.thrift of https://github.com/apache/parquet-format.
"""

from __future__ import annotations

from typing import Any

import pyarrow.parquet as pq

# Encodings whose values take no more memory than their page, or are indices into a dictionary.
# The incremental ones (DELTA_BYTE_ARRAY) make long strings from next to nothing.
_PLAIN, _PLAIN_DICTIONARY, _RLE, _RLE_DICTIONARY = 0, 2, 3, 8
_ENCODINGS = (_PLAIN, _PLAIN_DICTIONARY, _RLE, _RLE_DICTIONARY)

_TYPE, _DECODED, _STORED, _DATA, _DICTIONARY, _DATA_2 = 1, 2, 3, 5, 7, 8
_DEEPEST = 4


def decoded_size(content: bytes, column: pq.ColumnChunkMetaData) -> int:
    """Bytes that the pages of a column chunk take once they are decompressed.

    Parameters
    ----------
    content : bytes
        The whole file.
    column : pyarrow.parquet.ColumnChunkMetaData

    Raises
    ------
    ValueError
        If a page is not what its header says, or has an encoding that may grow without bound.
    """
    start = column.data_page_offset
    if column.has_dictionary_page and 0 < column.dictionary_page_offset < start:
        start = column.dictionary_page_offset
    stop = start + column.total_compressed_size
    if not 0 < start <= stop <= len(content):
        raise ValueError(f"column {column.path_in_schema} lies outside the file")
    size = 0
    while start < stop:
        reader = _Thrift(content, start, stop)
        header = reader.struct()
        decoded, stored = header.get(_DECODED), header.get(_STORED)
        if not isinstance(decoded, int) or not isinstance(stored, int) or decoded < 0 or stored < 0:
            raise ValueError(f"a page of column {column.path_in_schema} has no size")
        _check_encoding(header)
        size += decoded
        start = reader.position + stored
    if start != stop:
        raise ValueError(f"a page of column {column.path_in_schema} is larger than its column")
    return size


def _check_encoding(header: dict[int, Any]) -> None:
    for part, field in ((_DATA, 2), (_DICTIONARY, 2), (_DATA_2, 4)):
        if part in header and header[part].get(field) not in _ENCODINGS:
            raise ValueError("a page has an encoding that no archive is written with")


class _Thrift:
    """Reads one struct of Thrift's compact protocol, field numbers to values."""

    def __init__(self, content: bytes, position: int, stop: int) -> None:
        self._content = content
        self._stop = stop
        self.position = position

    def struct(self, depth: int = 0) -> dict[int, Any]:
        if depth == _DEEPEST:
            raise ValueError("a page header is nested too deeply")
        fields: dict[int, Any] = {}
        number = 0
        while head := self._byte():
            step = head >> 4
            number = number + step if step else self._signed()
            if number in fields:
                # Which of the two would count is for each reader to say, so neither does.
                raise ValueError("a page header has a field twice")
            fields[number] = self._value(head & 15, depth)
        return fields

    def _value(self, kind: int, depth: int) -> Any:
        match kind:
            case 1 | 2:
                return kind == 1
            case 3:
                return self._byte()
            case 4 | 5 | 6:
                return self._signed()
            case 7:
                return self._skip(8)
            case 8:
                return self._skip(self._unsigned())
            case 12:
                return self.struct(depth + 1)
        # Page headers have no lists and no maps.
        raise ValueError("a page header has a field of a kind that it should not have")

    def _byte(self) -> int:
        if self.position >= self._stop:
            raise ValueError("a page header ends too early")
        self.position += 1
        return self._content[self.position - 1]

    def _unsigned(self) -> int:
        value = 0
        for shift in range(0, 70, 7):
            byte = self._byte()
            value |= (byte & 127) << shift
            if byte < 128:
                return value
        raise ValueError("a page header has a number without end")

    def _signed(self) -> int:
        value = self._unsigned()
        return (value >> 1) ^ -(value & 1)

    def _skip(self, count: int) -> None:
        if count > self._stop - self.position:
            raise ValueError("a page header ends too early")
        self.position += count
