"""Pages that are made when the site is built, so that none can fall behind the code.

The command line from what its commands say of themselves, the Python reference from docstrings, and
one page for every numbered example.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

# The command line has a page of its own.
_NOT_PYTHON = ("cli", "archives")
_GROUPS = {
    "illumination": ("config", "building", "illumination", "selection", "births"),
    "archive": ("archive", "store", "committed", "merging", "importing", "exports"),
}
_SUBCOMMAND = re.compile(r"^  ([a-z]+) [A-Z]+ ", re.MULTILINE)


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    root = Path(config.config_file_path).parent
    pages = {"cli.md": command_line()} | examples(root) | reference(root / "nichechain")
    for name, content in pages.items():
        files.append(File.generated(config, name, content=content))
    return files


def command_line() -> str:
    """The page of all commands, from what they say themselves."""
    from nichechain.cli import COMMANDS

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        helps = pool.map(_help, ([], *([name] for name in COMMANDS)))
    overview, *each = helps
    lines = [
        "# Command line",
        "What every command says of itself. `nichechain` and `python -m nichechain` are the same.",
        _block(overview),
    ]
    for name, text in zip(COMMANDS, each, strict=True):
        lines += [f"## nichechain {name}", _block(text)]
        # Only a command of several has a help without boxes of options.
        for choice in () if "─ options" in text else _SUBCOMMAND.findall(text):
            lines += [f"### nichechain {name} {choice}", _block(_help([name, choice]))]
    return "\n\n".join(lines)


def examples(root: Path) -> dict[str, str]:
    """One page for each numbered example, and one that lists them."""
    pages = {}
    listed = []
    for path in sorted(root.glob("examples/[0-9][0-9]_*.py")):
        source = path.read_text(encoding="utf-8")
        title, _, description = (ast.get_docstring(ast.parse(source)) or path.stem).partition("\n\n")
        name = f"examples/{path.stem}.md"
        heading = " ".join(title.split())
        body = source.split('"""', 2)[2].strip()
        parts = [f"# {path.stem}", f"**{heading}**", description.replace("``", "`")]
        if (root / "docs/pictures/examples" / f"{path.stem}.png").is_file():
            parts.append(f"![what {path.name} draws](../pictures/examples/{path.stem}.png)")
        parts += [f"```sh\npython examples/{path.name}\n```", f"```python\n{body}\n```"]
        pages[name] = "\n\n".join(parts)
        listed.append(f"| [`{path.name}`]({path.stem}.md) | {heading} |")
    table = "\n".join(["| script | what it does |", "|---|---|", *listed])
    pages["examples/index.md"] = (
        "# Examples\n\nNumbered scripts, each under a minute and each ending in a picture. "
        f"They run anywhere and write to the current folder.\n\n{table}\n"
    )
    return pages


def reference(package: Path) -> dict[str, str]:
    """One page for each package, and one for each group of the modules beside them."""
    beside = {path.stem for path in package.glob("*.py")} - {"__init__", "__main__"}
    pages = {}
    for folder in sorted(path.parent for path in package.glob("*/__init__.py")):
        if folder.name in _NOT_PYTHON:
            continue
        name = f"nichechain.{folder.name}"
        inner = [path for path in sorted(folder.rglob("*.py")) if path.stem[0] != "_" and _has_public(path)]
        pages[f"api/{folder.name}.md"] = _package(
            package.parent, name, _exported(folder / "__init__.py"), inner
        )
    for group, names in _GROUPS.items():
        listed = [name for name in names if name in beside]
        beside -= set(listed)
        pages[f"api/{group}.md"] = _modules(group, listed)
    pages["api/others.md"] = _modules(
        "others", sorted(name for name in beside if _has_public(package / f"{name}.py"))
    )
    pages["api/nichechain.md"] = _front(_exported(package / "__init__.py"))
    return pages


def _package(root: Path, name: str, exported: list[str], modules: list[Path]) -> str:
    lines = [
        f"# {name}",
        f"::: {name}\n    options:\n      members: false\n      show_root_heading: false\n"
        "      show_root_toc_entry: false",
    ]
    if exported:
        names = "\n".join(f"    {each}," for each in exported)
        lines.append(f"```python\nfrom {name} import (\n{names}\n)\n```")
    for path in modules:
        module = ".".join(path.relative_to(root).with_suffix("").parts)
        # What a package names is for its users; the rest of that module is how it is done.
        shown = [each for each in exported if each in _defined(path)]
        options = f"\n    options:\n      members: {shown}" if shown else ""
        lines.append(f"::: {module}{options}")
    return "\n\n".join(lines)


def _modules(title: str, names: list[str]) -> str:
    return "\n\n".join([f"# {title}", *(f"::: nichechain.{name}" for name in names)])


def _front(exported: list[str]) -> str:
    names = "\n".join(
        f'- <autoref identifier="nichechain.{name}" optional><code>nc.{name}</code></autoref>'
        for name in exported
    )
    return (
        "# nichechain\n\n::: nichechain\n    options:\n      members: false\n"
        "      show_root_heading: false\n\n```python\nimport nichechain as nc\n```\n\n"
        f"What that gives, each described with the module that it comes from:\n\n{names}\n"
    )


def _exported(path: Path) -> list[str]:
    """What the module names in ``__all__``."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return [str(name) for name in ast.literal_eval(node.value)]
    return []


def _defined(path: Path) -> set[str]:
    """Names that the module gives to something of its own."""
    names = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            names.add(node.name)
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            names.add(ast.unparse(target))
    return names


def _has_public(path: Path) -> bool:
    """Whether the module defines a class or function that is not private."""
    return any(
        isinstance(node, (ast.ClassDef, ast.FunctionDef)) and not node.name.startswith("_")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
    )


def _help(words: list[str]) -> str:
    environment = os.environ | {"COLUMNS": "80", "NO_COLOR": "1", "TERM": "dumb", "PYTHONUTF8": "1"}
    told = subprocess.run(  # noqa: S603  # our own program
        [sys.executable, "-m", "nichechain", *words, "--help"],
        check=True,
        capture_output=True,
        encoding="utf-8",
        env=environment,
    )
    return told.stdout.rstrip()


def _block(text: str) -> str:
    return f"```text\n{text}\n```"
