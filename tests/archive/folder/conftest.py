"""Archives of three small parts."""

from __future__ import annotations

import pytest

from nichechain.archive import write

from .samples import built


@pytest.fixture(autouse=True)
def _small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(write, "PART_ROWS", 200)


@pytest.fixture(scope="module")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "PART_ROWS", 200)
        return built(tmp_path_factory.mktemp("pristine"))
