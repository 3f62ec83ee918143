"""Centroids of a tessellation that another program made."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from nichechain.core.errors import NichechainError
from nichechain.core.files import as_path
from nichechain.core.parquet import read_parquet
from nichechain.niches.base import Floats


def read_centroids(path: str | Path) -> Floats:
    """Centroids (n, B) out of a file: the niche of row k has the number k.

    Parameters
    ----------
    path : path
        NumPy's ``.npy``; ``.csv`` or ``.txt``, a row for each centroid, with or without a header; or
        ``.parquet``, a column for each axis.

    Raises
    ------
    NichechainError
        If it cannot be read, or holds something else.
    """
    path = as_path("path", path)
    kind = path.suffix.lower()
    if kind not in (".npy", ".csv", ".txt", ".parquet"):
        raise NichechainError(
            f"{path} is neither a .npy, .csv, .txt nor .parquet file, but must be one of them"
        )
    try:
        content = path.read_bytes()
    except OSError as error:
        raise NichechainError(
            f"{path} cannot be read: {error.strerror}: centroids must be in a file"
        ) from error
    try:
        if kind == ".npy":
            found = np.load(io.BytesIO(content), allow_pickle=False)
        elif kind == ".parquet":
            import pyarrow as pa

            found = read_parquet(pa.BufferReader(content)).to_pandas(use_threads=False).to_numpy(np.float64)
        else:
            found = _read_text(content.decode())
    except Exception as error:
        reason = (str(error).splitlines() or [""])[0]
        raise NichechainError(f"{path} has no centroids that can be read: {reason}") from error
    if found.ndim != 2 or found.dtype.kind not in "fiu":
        raise NichechainError(
            f"{path} has an array of shape {found.shape} and type {found.dtype}, but must have numbers, "
            "a row for each centroid"
        )
    centroids: Floats = found.astype(np.float64)
    return centroids


def _read_text(text: str) -> Floats:
    rows = [line.replace(",", " ").split() for line in text.splitlines() if line.strip()]
    if rows and not _are_numbers(rows[0]):
        rows = rows[1:]
    return np.array(rows, np.float64)


def _are_numbers(words: list[str]) -> bool:
    try:
        return bool([float(word) for word in words])
    except ValueError:
        return False
