"""What was computed before an interruption, in a file that says what made it."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nichechain.core.errors import NichechainError
from nichechain.core.files import write_atomically

Arrays = dict[str, NDArray[Any]]


def read_unfinished(path: Path | None, made_by: dict[str, Any], what: str, *names: str) -> Arrays | None:
    """The arrays of such a file, or None where there is none.

    Parameters
    ----------
    path : Path, optional
    made_by : dict
        All that shapes the arrays, as plain values.
    what : str
        What the arrays are called.
    *names : str
        Of the arrays, which are of one length.

    Raises
    ------
    NichechainError
        If the file is damaged, or what made it differs.
    """
    if path is None or not path.exists():
        return None
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as stored:
            found, arrays = json.loads(str(stored["made_by"])), {name: stored[name] for name in names}
        if len({len(array) for array in arrays.values()}) != 1:
            raise ValueError("its parts differ in length")
    except (OSError, TypeError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise NichechainError(f"{path} is damaged, remove it: {error}") from error
    found, wanted = found if isinstance(found, dict) else {}, json.loads(json.dumps(made_by))
    if found != wanted:
        odd = ", ".join(name for name in wanted if found.get(name) != wanted[name])
        raise NichechainError(f"{path} holds {what} that differ in {odd}: start over, or remove it")
    return arrays


def write_unfinished(path: Path, made_by: dict[str, Any], arrays: Arrays) -> None:
    """Replace such a file, or make it and its folder."""
    file = io.BytesIO()
    np.savez(file, allow_pickle=False, made_by=np.array(json.dumps(made_by)), **arrays)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, file.getvalue())
