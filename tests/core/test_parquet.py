"""Small Parquet files come back as they were written, whatever they are called."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pytest

from nichechain.core.parquet import parquet_bytes, read_parquet

TABLE = pa.table({"run": [0, 1, 2], "label": ["a", None, "c"]})


@pytest.mark.parametrize("name", ["rows", "seed:1/rows.parquet", "s3:rows", "a b?c#%20", "\udcff"])
def test_a_name_is_no_address(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path(name)
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(parquet_bytes(TABLE))
    assert read_parquet(path, checksums=True).equals(TABLE)
    assert read_parquet(pa.BufferReader(path.read_bytes())).equals(TABLE)


def test_a_file_that_is_missing_is_an_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_parquet(tmp_path / "rows.parquet")
