"""Build the documentation as a folder of pages: ``python docs/build.py [FOLDER]``, ``site`` if none is given.

Zensical makes the pages. It runs no code of ours on the way, so what is ours is done before and after:
pages that come from the code are written and links are rewritten beforehand, in a copy, and equations
become MathML afterwards.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path.insert(0, str(HERE / "_make"))

import equations  # noqa: E402
import generated  # noqa: E402
import links  # noqa: E402


def build(folder: Path) -> None:
    """Write the site to a folder, which it replaces; a warning is an error."""
    with tempfile.TemporaryDirectory() as scratch:
        stage = Path(scratch)
        lay_out(stage)
        # Where nichechain and the examples are seen from, by mkdocstrings and by snippets.
        command = [sys.executable, "-m", "zensical", "build", "--strict", "-f", str(stage / "mkdocs.yml")]
        subprocess.run(command, check=True, cwd=stage)  # noqa: S603  # of our own making
        for page in (stage / "site").rglob("*.html"):
            page.write_text(equations.to_mathml(page.read_text(encoding="utf-8")), encoding="utf-8")
        shutil.rmtree(folder, ignore_errors=True)
        shutil.move(stage / "site", folder)


def lay_out(stage: Path) -> None:
    """Write what Zensical reads: the pages that are kept, and those that come from the code."""
    pages = stage / "docs"
    shutil.copytree(HERE, pages, ignore=shutil.ignore_patterns("_make", "*.py", "__pycache__"))
    for name, content in generated.pages(ROOT).items():
        (pages / name).parent.mkdir(parents=True, exist_ok=True)
        (pages / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    for page in pages.rglob("*.md"):
        here = page.parent.relative_to(pages).as_posix()
        page.write_text(links.rewrite(page.read_text(encoding="utf-8"), here), encoding="utf-8")
    for name in ("nichechain", "examples"):
        (stage / name).symlink_to(ROOT / name)
    shutil.copytree(HERE / "_make", stage / "_make")
    shutil.copy(ROOT / "mkdocs.yml", stage)


if __name__ == "__main__":
    build(Path(sys.argv[1] if len(sys.argv) > 1 else "site").resolve())
