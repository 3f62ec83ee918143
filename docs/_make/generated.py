"""Pages that are made when the site is built, so that none can fall behind the code.

The command line from what its commands say of themselves, the Python reference from docstrings, and
one page for every numbered example and every notebook.
"""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import griffe
import notebooks

# The command line has a page of its own, and shipped archives are no room.
_NOT_PYTHON = ("cli", "archives")
_ROLE = re.compile(r":[a-z]+:`~?([\w.]+)`")
_SENTENCE = re.compile(r"(?<=[.?!])\s+(?=[A-Z])")
_SUBCOMMAND = re.compile(r"^  ([a-z]+) [A-Z]+ ", re.MULTILINE)


def pages(root: Path) -> dict[str, str | bytes]:
    """All of them, and the pictures of notebooks, by their paths in the documentation."""
    return {
        "cli.md": command_line(),
        **examples(root),
        **reference(root / "nichechain"),
        **notebooks.pages(root / "docs/notebooks"),
    }


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
    made = {}
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
        made[name] = "\n\n".join(parts)
        listed.append(f"| [`{path.name}`]({path.stem}.md) | {heading} |")
    table = "\n".join(["| script | what it does |", "|---|---|", *listed])
    made["examples/index.md"] = (
        "# Examples\n\nNumbered scripts, each under a minute. All but that of a cluster end in a picture, "
        f"which they write to the current folder.\n\n{table}\n"
    )
    return made


def reference(package: Path) -> dict[str, str]:
    """One page for each room, of what its packages have for users, and one of what comes in one import."""
    known = griffe.load("nichechain", search_paths=[package.parent], resolve_aliases=True)
    made = {"api/nichechain.md": _front(known, _exported(package / "__init__.py"))}
    for room in sorted(path.parent for path in package.glob("*/__init__.py")):
        if room.name not in _NOT_PYTHON:
            packages = sorted(room.rglob("__init__.py"), key=lambda path: (len(path.parts), path))
            parts: list[str] = []
            seen: set[str] = set()
            for path in packages:
                names = [name for name in _exported(path) if name not in seen]
                seen.update(names)
                parts += _package(known, package.parent, path.parent, names) if names else []
            made[f"api/{room.name}.md"] = "\n\n".join([f"# nichechain.{room.name}", *parts])
    return made


def _package(known: griffe.Object, root: Path, folder: Path, exported: list[str]) -> list[str]:
    """What a package says of itself, a line for each name that it has, and a description of each."""
    package = ".".join(folder.relative_to(root).parts)
    inner = [] if package.count(".") == 1 else [f"## {package}"]
    # A function may bear the name of its module.
    homes = [f"{package}.{each}" if (folder / f"{each}.py").is_file() else package for each in exported]
    return [
        *inner,
        f"::: {package}\n    options:\n      members: false\n      show_root_heading: false\n"
        "      show_root_toc_entry: false",
        f"Each is had by `from {package} import NAME`.",
        _table(known, {each: f"{home}.{each}" for home, each in zip(homes, exported, strict=True)}),
        *(f"::: {home}.{each}" for home, each in zip(homes, exported, strict=True)),
    ]


def _front(known: griffe.Object, exported: list[str]) -> str:
    return (
        "# nichechain\n\n::: nichechain\n    options:\n      members: false\n"
        "      show_root_heading: false\n\n```python\nimport nichechain as nc\n```\n\n"
        "What that gives, each described with the room that it comes from:\n\n"
        + _table(known, {f"nc.{name}": f"nichechain.{name}" for name in exported})
    )


def _table(known: griffe.Object, names: dict[str, str]) -> str:
    """A line for each name: a link to its description, and the first sentence of that."""
    lines = [
        f'| <autoref identifier="{path}" optional><code>{name}</code></autoref> | {_sentence(known, path)} |'
        for name, path in names.items()
    ]
    return "\n".join(["| name | what it is |", "|---|---|", *lines])


def _sentence(known: griffe.Object, path: str) -> str:
    found = known[path.removeprefix("nichechain.")]
    target = found.final_target if isinstance(found, griffe.Alias) else found
    if target.docstring is None:
        return f"`{target.value}`" if isinstance(target, griffe.Attribute) else ""
    text = " ".join(target.docstring.value.partition("\n\n")[0].split())
    sentence = _SENTENCE.split(text, maxsplit=1)[0]
    return _ROLE.sub(r"`\1`", sentence).replace("``", "`").replace("|", "\\|")


def _exported(path: Path) -> list[str]:
    """What the module names in ``__all__``."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
            return [str(name) for name in ast.literal_eval(node.value)]
    return []


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
