"""The house stays one that a newcomer can guess: few modules on top, one word for one thing, marked doors."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import re
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

import nichechain

PACKAGE = Path(nichechain.__file__).parent
ROOT = PACKAGE.parent
PAGES = [*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md"))]
PACKAGES = [
    "nichechain",
    *(info.name for info in pkgutil.walk_packages(nichechain.__path__, "nichechain.") if info.ispkg),
]
# Packages that speak to a library which is an extra.
EXTRA = {"nichechain.qdax": "qdax"}
_PATH = re.compile(r"(?<![\w/.-])(?:tests|nichechain|benchmarks|examples|docs)/[\w./-]+\.(?:py|md|png|svg)")
_BLOCK = re.compile(r"^ *```python[^\n]*\n(.*?)^ *```$", re.DOTALL | re.MULTILINE)


def test_three_modules_stand_at_the_top() -> None:
    assert {path.name for path in PACKAGE.glob("*.py")} == {"__init__.py", "__main__.py", "_version.py"}


def test_no_two_public_classes_bear_one_name() -> None:
    homes = defaultdict(list)
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(path.relative_to(PACKAGE).as_posix())
    assert len(homes) > 100
    assert {name: found for name, found in homes.items() if len(found) > 1} == {}


def test_nothing_reads_a_clock_that_may_be_set() -> None:
    # Whoever sets the clock, or lets it jump, changes no checkpoint and no figure of progress.
    clock = re.compile(r"\btime\.time(?:_ns)?\(|from time import [^\n]*\btime\b|\bdatetime\b")
    found = [path.name for path in PACKAGE.rglob("*.py") if clock.search(path.read_text(encoding="utf-8"))]
    assert found == []


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_says_what_is_for_users(package: str) -> None:
    if package in EXTRA:
        pytest.importorskip(EXTRA[package])
    loaded = importlib.import_module(package)
    names = loaded.__all__
    assert len(set(names)) == len(names)
    assert not [name for name in names if name.startswith("_") or not hasattr(loaded, name)]


def _imports(code: str) -> Iterator[tuple[str, str]]:
    """What a piece of code imports from nichechain, by module and name."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            yield from ((each.name, "") for each in node.names if each.name.partition(".")[0] == "nichechain")
        elif isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "nichechain":
            yield from ((str(node.module), each.name) for each in node.names)


def _shown() -> list[tuple[str, str]]:
    """The code that users are shown: examples, and blocks of the documentation."""
    found = [(path.name, path.read_text(encoding="utf-8")) for path in sorted(ROOT.glob("examples/*.py"))]
    for path in PAGES:
        blocks = _BLOCK.findall(path.read_text(encoding="utf-8"))
        found += [(path.name, block) for block in blocks if "\n--8<--" not in f"\n{block}"]
    return found


def test_what_users_are_shown_is_for_users() -> None:
    private = []
    for page, code in _shown():
        for module, name in _imports(code):
            public = module in PACKAGES and (
                name in ("", *importlib.import_module(module).__all__) or f"{module}.{name}" in PACKAGES
            )
            if not public:
                private.append(f"{page}: {module} {name}".strip())
    assert not private, "\n".join(private)


def test_files_that_pages_name_are_there() -> None:
    named = {(page.name, path) for page in PAGES for path in _PATH.findall(page.read_text(encoding="utf-8"))}
    assert len(named) > 20
    # NAME stands for what a contributor adds.
    assert not [
        (page, path) for page, path in sorted(named) if "NAME" not in path and not (ROOT / path).exists()
    ]


def test_the_picture_of_the_architecture_has_every_room() -> None:
    picture = (ROOT / "docs/pictures/architecture.svg").read_text(encoding="utf-8")
    rooms = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert set(re.findall(r'font-weight="bold" fill="#111">(\w+)<', picture)) == rooms
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = contract["tool"]["importlinter"]["contracts"][0]["layers"]
    assert {room for layer in layers for room in layer.split(" | ")} == rooms
