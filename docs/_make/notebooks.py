"""Notebooks become pages: they are kept with their outputs, so that building the site runs none of them."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

_ENDINGS = {"image/png": "png", "image/gif": "gif"}
_STYLE = re.compile(r"<style.*?</style>\s*", re.DOTALL)


def pages(folder: Path) -> dict[str, str | bytes]:
    """A page for each notebook and the pictures on it, by their paths in the documentation."""
    made: dict[str, str | bytes] = {}
    listed = []
    for path in sorted(folder.glob("*.ipynb")):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        parts = [_join(cells[0]["source"]), f"[Download this notebook]({path.name}) and open it on your own."]
        for cell in cells[1:]:
            source = _join(cell["source"])
            parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
            for output in cell.get("outputs", []):
                name = f"{path.stem}-{len(parts)}"
                shown, picture = _shown(output, name)
                parts.append(shown)
                if picture is not None:
                    made[f"notebooks/{name}.{picture[0]}"] = picture[1]
        made[f"notebooks/{path.stem}.md"] = "\n\n".join(part for part in parts if part)
        listed.append(f"- [{_join(cells[0]['source']).splitlines()[0].lstrip('# ')}]({path.stem}.md)")
    made["notebooks/index.md"] = (
        "# Notebooks\n\nEach was run as it stands here and takes under a minute. On its page is a link that "
        "downloads it.\n\n" + "\n".join(listed) + "\n"
    )
    return made


def _shown(output: dict[str, Any], name: str) -> tuple[str, tuple[str, bytes] | None]:
    """What an output looks like in Markdown, and the ending and bytes of its picture."""
    if output["output_type"] == "stream":
        return f"```text\n{_join(output['text']).rstrip()}\n```", None
    data = output.get("data", {})
    for kind, ending in _ENDINGS.items():
        if kind in data:
            return f"![output]({name}.{ending})", (ending, base64.b64decode(_join(data[kind])))
    if "text/html" in data:
        # A blank line would end the table, and styles are the site's.
        bare = _STYLE.sub("", _join(data["text/html"])).replace(
            '<table border="1" class="dataframe">', "<table>"
        )
        lines = bare.splitlines()
        return "\n".join(line.strip() for line in lines if line.strip()), None
    return f"```text\n{_join(data.get('text/plain', ''))}\n```", None


def _join(lines: str | list[str]) -> str:
    return lines if isinstance(lines, str) else "".join(lines)
