"""Notebooks are kept with their outputs; a long test runs them, and with --refresh-docs writes them anew."""

import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
# What a notebook needs beyond what nichechain does.
NEEDS = {"03_lunar_lander": "Box2D", "06_qdax": "qdax"}

notebooks = pytest.mark.parametrize("path", [pytest.param(path, id=path.stem) for path in NOTEBOOKS])


def printed(cell) -> str:
    texts = [output["text"] for output in cell.get("outputs", []) if output["output_type"] == "stream"]
    return "".join("".join(text) for text in texts)


@notebooks
def test_a_notebook_shows_what_its_cells_gave(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    first, *rest = code
    assert cells[0]["source"][0].startswith("# ")
    assert first["metadata"]["tags"] == ["install"]
    assert "".join(first["source"]).startswith("%pip install -q ")
    assert [cell["execution_count"] for cell in rest] == list(range(1, len(rest) + 1))
    outputs = [output for cell in rest for output in cell["outputs"]]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not [each for each in outputs if each["output_type"] == "error" or each.get("name") == "stderr"]
    assert "/tmp" not in path.read_text(encoding="utf-8")


@pytest.mark.slow
@notebooks
def test_a_notebook_runs(path, alike, tmp_path, request, monkeypatch):
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    pytest.importorskip(NEEDS.get(path.stem, "nichechain"))
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    book = nbformat.read(path, 4)
    shown = [printed(cell) for cell in book.cells]
    # What the first cell installs is here.
    run = nbformat.v4.new_notebook(
        cells=[cell for cell in book.cells if "install" not in cell.metadata.get("tags", [])],
        metadata=book.metadata,
    )
    client = nbclient.NotebookClient(
        run, timeout=600, record_timing=False, resources={"metadata": {"path": str(tmp_path)}}
    )
    client.execute()
    for cell in (each for each in run.cells if each.cell_type == "code"):
        # Notices, such as of the first compilation, are no result.
        cell["outputs"] = [each for each in cell.get("outputs", []) if each.get("name") != "stderr"]
    if request.config.getoption("refresh_docs"):
        nbformat.write(book, path)
        return
    for cell, before in zip(book.cells, shown, strict=True):
        assert alike(printed(cell), before), cell.source
