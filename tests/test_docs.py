"""Code blocks of the documentation run, in the order of their page, and say what they are said to say.

Python blocks run unless a comment in the line before says otherwise; blocks of the shell run where one
says so. A page shares its names and a folder. What a comment can say: ``run`` (a block of nichechain
commands), ``slow`` (only with -m slow), ``needs NAME`` (only where that module is installed),
``skip: why``, ``output`` (what the block before printed). ``pytest --refresh-docs tests/test_docs.py``
writes what the blocks print now into their pages.
"""

import ast
import dataclasses
import importlib.util
import re
import shlex
from pathlib import Path

import matplotlib
import pytest

from nichechain.cli import main

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]

_BLOCK = re.compile(
    r"^(?P<indent> *)(?:<!-- (?P<said>[^>]*?) -->\n+ *)?```(?P<kind>[a-z]+)[^\n]*\n(?P<code>.*?)^ *```$",
    re.DOTALL | re.MULTILINE,
)
_SNIPPET = re.compile(r'^--8<-- "(?P<path>[^":]+)(?::(?P<ranges>[\d:,]+))?"$', re.MULTILINE)


@dataclasses.dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    line: int
    kind: str
    said: str
    code: str
    output: str | None = None
    shown: tuple[int, int] = (0, 0)  # where the page has the output

    @property
    def runs(self) -> bool:
        words = self.said.split()
        if words[:1] == ["skip:"]:
            return False
        if "needs" in words and importlib.util.find_spec(words[words.index("needs") + 1]) is None:
            return False
        return self.kind == "python" or (self.kind == "sh" and self.said.startswith("run"))

    @property
    def slow(self) -> bool:
        return "slow" in self.said.split()


def blocks_of(text: str) -> list[Block]:
    """The blocks that may run, each with the output that the page shows for it."""
    found: list[Block] = []
    for match in _BLOCK.finditer(text):
        said = match["said"] or ""
        code = "\n".join(line.removeprefix(match["indent"]) for line in match["code"].splitlines())
        if said == "output":
            last = found.pop()
            where = match.span("code")
            found.append(dataclasses.replace(last, output=code, shown=where))
        else:
            line = text.count("\n", 0, match.start("code")) + 1
            found.append(Block(line, match["kind"], said, _SNIPPET.sub(_included, code)))
    return [block for block in found if block.runs]


def _included(match: re.Match[str]) -> str:
    lines = (ROOT / match["path"]).read_text(encoding="utf-8").splitlines()
    if match["ranges"] is None:
        return "\n".join(lines)
    parts = [[int(end) for end in part.split(":")] for part in match["ranges"].split(",")]
    return "\n".join(line for first, last in parts for line in lines[first - 1 : last])


def run(block: Block, names: dict[str, object], page: Path) -> None:
    if block.kind == "sh":
        for line in block.code.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words:
                assert words[0] == "nichechain", f"{page.name}:{block.line} would run {words[0]}"
                assert main(words[1:]) == 0, f"{page.name}:{block.line}: {line}"
        return
    # Lines of the page, so that a traceback leads there.
    tree = ast.increment_lineno(ast.parse(block.code), block.line)
    exec(compile(tree, str(page), "exec"), names)


def _cases():
    for page in PAGES:
        blocks = blocks_of(page.read_text(encoding="utf-8"))
        name = str(page.relative_to(ROOT))
        if any(not block.slow for block in blocks):
            yield pytest.param(page, False, id=name)
        if any(block.slow for block in blocks):
            yield pytest.param(page, True, id=f"{name}, with slow blocks", marks=pytest.mark.slow)


@pytest.mark.parametrize(("page", "slow"), list(_cases()))
def test_blocks_of_a_page_run(page, slow, alike, tmp_path, monkeypatch, capsys, request):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    matplotlib.use("agg")
    names: dict[str, object] = {"__name__": "__docs__"}
    text = page.read_text(encoding="utf-8")
    fresh: list[tuple[tuple[int, int], str]] = []
    for block in blocks_of(text):
        if block.slow and not slow:
            continue
        capsys.readouterr()
        run(block, names, page)
        printed = capsys.readouterr().out
        if block.output is None:
            continue
        if request.config.getoption("refresh_docs"):
            lines = [line.rstrip() for line in printed.strip("\n").splitlines()]
            fresh.append((block.shown, "".join(f"{line}\n" for line in lines)))
        else:
            assert alike(printed, block.output), f"{page.name}:{block.line} prints\n{printed}"
    for (first, last), printed in reversed(fresh):
        text = text[:first] + printed + text[last:]
    if fresh:
        page.write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    ("said", "shown", "same"),
    [
        ("niche 14,14: 63.59", "niche 14,14:   63.6", True),
        ("niche 14,14: 63.59", "niche 14,14: 61.9", False),
        ("a 0.50\nb", "a 0.50 c", False),
        ("wrote a.png", "wrote a.png", True),
    ],
)
def test_outputs_are_compared_by_words_and_numbers(said, shown, same, alike):
    assert alike(said, shown) == same


def test_marks_are_read():
    page = "\n".join(
        [
            "<!-- run -->\n```sh\nnichechain info x\n```",
            "```sh\nrm -r x\n```",
            "<!-- slow -->\n```python\n1\n```",
            "<!-- skip: needs a cluster -->\n```python\n2\n```",
            "```python\n3\n```\n\n<!-- output -->\n```text\n3\n```",
        ]
    )
    blocks = blocks_of(page)
    assert [block.code for block in blocks] == ["nichechain info x", "1", "3"]
    assert [block.slow for block in blocks] == [False, True, False]
    assert [block.output for block in blocks] == [None, None, "3"]
