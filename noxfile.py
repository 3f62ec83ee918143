"""What has to hold, in parts that can be run one by one: ``nox -l`` lists them, ``nox -s lint`` runs one.

Each part has an environment of its own; ``nox --no-venv --no-install -s lint types`` takes the one at hand.
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import nox

nox.needs_version = ">=2024.4.15"
nox.options.default_venv_backend = "virtualenv"
nox.options.error_on_missing_interpreters = False
nox.options.reuse_venv = "yes"
nox.options.sessions = ["lint", "types", "tests", "docs", "wheel"]

PYTHONS = ("3.11", "3.12", "3.13")
PROJECT = nox.project.load_toml("pyproject.toml")["project"]
PINNED = ("-c", "constraints.txt")

# Tests of rooms that do their work without PyTorch, none of them long: what other Pythons are asked.
SMOKE = (
    "tests/archive/test_exports.py",
    "tests/archive/test_imported.py",
    "tests/archive/test_merge.py",
    "tests/births",
    "tests/chain/structure",
    "tests/chain/test_counts.py",
    "tests/chain/test_estimators.py",
    "tests/chain/test_posterior.py",
    "tests/cli/test_build.py",
    "tests/cli/test_evolvability.py",
    "tests/cli/test_info.py",
    "tests/core",
    "tests/domains/test_arm.py",
    "tests/domains/test_noise.py",
    "tests/domains/test_toy.py",
    "tests/evolvability/test_coverage.py",
    "tests/execution/test_threads.py",
    "tests/niches/test_cvt.py",
    "tests/niches/test_grid.py",
    "tests/search/test_map_elites.py",
    "tests/test_imports.py",
    "tests/variation",
    "tests/walks/diversity",
)
# What is compared with other programs, and what needs a browser, Box2D or Ray.
PEERS = (
    "tests/archive/test_exports.py",
    "tests/chain/structure",
    "tests/domains/test_descriptors.py",
    "tests/domains/test_gym.py",
    "tests/execution/test_ray.py",
    "tests/plots/test_explorer_browser.py",
    "tests/test_docs.py",
    "tests/variation/test_polynomial.py",
)

INSTALLED = """
import nichechain as nc

assert "site-packages" in nc.__file__, nc.__file__
archive = nc.load("fetch-pick-and-place")
print(archive)
print(archive.chain())
"""


def _find_pythons() -> None:
    """Let the Pythons of pyenv be found, which answer only to who asks for them by number."""
    installed = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    found = [path for version in PYTHONS for path in sorted(installed.glob(f"{version}.*"))[-1:]]
    if found:
        os.environ.setdefault("PYENV_VERSION", ":".join(path.name for path in found))
        os.environ["PATH"] = os.pathsep.join([os.environ["PATH"], *(str(path / "bin") for path in found)])


_find_pythons()


@nox.session
def lint(session: nox.Session) -> None:
    """Ruff's rules and format, and the walls between rooms."""
    session.install(*PINNED, *_tools("ruff", "import-linter"))
    session.run("ruff", "check", ".")
    session.run("ruff", "format", "--check", ".")
    session.run("lint-imports", env={"PYTHONPATH": "."})


@nox.session
def types(session: nox.Session) -> None:
    """Mypy, strict."""
    session.install(*PINNED, "-e", ".[dev]")
    session.run("mypy")


@nox.session(python=PYTHONS)
def tests(session: nox.Session) -> None:
    """All tests on the oldest Python; on others those that need no PyTorch, or all with ``-- --all``."""
    whole = session.python == PYTHONS[0] or "--all" in session.posargs
    given = [word for word in session.posargs if word != "--all"]
    if whole:
        session.install(*PINNED, "-e", ".[test]")
    else:
        session.log("a smoke test without PyTorch, whose builds are large; all tests with -- --all")
        needed = [line for line in PROJECT["dependencies"] if not line.startswith("torch")]
        session.install(*PINNED, *needed, *PROJECT["optional-dependencies"]["test"])
        session.install("--no-deps", "-e", ".")
    chosen = whole or any(not word.startswith("-") for word in given)
    session.run("python", "-m", "pytest", *given, *(() if chosen else SMOKE))


@nox.session
def peers(session: nox.Session) -> None:
    """Tests beside other programs, in a browser, on Ray and in Box2D."""
    session.install(*PINNED, "-e", ".[test,peers,ray,box2d,gpcca]")
    if shutil.which("chromedriver") is None:
        session.warn("there is no chromedriver: the explorer is not opened in a browser")
    session.run("python", "-m", "pytest", *(session.posargs or PEERS))


@nox.session
def examples(session: nox.Session) -> None:
    """The examples that take longer than a test may, and the notebooks."""
    session.install(*PINNED, "-e", ".[test,ray,box2d,notebooks]")
    session.run("python", "-m", "pytest", "-m", "slow", "tests/test_examples.py", "tests/test_notebooks.py")


@nox.session
def docs(session: nox.Session) -> None:
    """The documentation builds without a warning."""
    session.install(*PINNED, "-e", ".[docs]")
    site = session.posargs[0] if session.posargs else str(Path(session.create_tmp()) / "site")
    session.run("python", "docs/build.py", site)


@nox.session
def wheel(session: nox.Session) -> None:
    """The wheel works away from the checkout, with what it says it needs; the shipped archive is in it."""
    made = Path(session.create_tmp()).resolve()
    for old in made.glob("nichechain-*.whl"):
        old.unlink()
    session.run("python", "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(made), ".")
    (built,) = made.glob("nichechain-*.whl")
    session.install(*PINNED, str(built))
    session.install("--no-deps", "--force-reinstall", str(built))
    with session.chdir(made):
        session.run("python", "-P", "-c", INSTALLED)
        session.run("nichechain", "info", "fetch-pick-and-place")


@nox.session
def studies(session: nox.Session) -> None:
    """The paper's experiments, on the arm."""
    session.install(*PINNED, "-e", ".")
    made = Path(session.create_tmp())
    for kind in ("pressure", "metrics"):
        shutil.rmtree(made / kind, ignore_errors=True)
    few = ("--runs", "6", "--steps", "20")
    session.run("nichechain", "walks", "pressure", "arm", *few, "--out", str(made / "pressure"))
    session.run("nichechain", "walks", "metrics", "arm", *few, "--paired", "--out", str(made / "metrics"))


def _tools(*names: str) -> list[str]:
    """What ``pyproject.toml`` says of these tools."""
    return [
        line for line in PROJECT["optional-dependencies"]["dev"] if re.split(r"[<>=\[]", line)[0] in names
    ]
