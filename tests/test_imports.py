"""What an import costs: NumPy and the heavy libraries only where they are used."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import nichechain

HEAVY = ("numpy", "torch", "ribs", "mujoco", "gymnasium", "pandas", "matplotlib", "sklearn", "numba")
SEARCH = ("torch", "ribs", "mujoco", "gymnasium", "matplotlib", "sklearn")


def imported(statement: str, names: tuple[str, ...]) -> list[str]:
    """Which of the libraries a fresh interpreter has after a statement."""
    code = f"import sys\n{statement}\nprint(*[name for name in {names!r} if name in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(nichechain.__file__).parents[1],
    )
    return done.stdout.split()


def test_importing_the_package_imports_nothing_heavy() -> None:
    assert imported("import nichechain; nichechain.__version__; dir(nichechain)", HEAVY) == []


def test_reading_an_archive_needs_no_search_library() -> None:
    rooms = "archive.building, births, domains, evolvability, execution, search.map_elites, archive.write"
    assert imported("\n".join(f"import nichechain.{room}" for room in rooms.split(", ")), SEARCH) == []


def test_making_a_domain_loads_no_physics() -> None:
    statement = "from nichechain import domains; domains.FetchPickAndPlace().genotype_length"
    assert imported(statement, SEARCH) == []


def test_no_simulator_is_imported_before_it_is_asked_for() -> None:
    assert imported("import nichechain.domains", ("torch", "gymnasium", "mujoco", "numba")) == []


def test_checks_above_can_fail() -> None:
    assert imported("import numpy", HEAVY) == ["numpy"]


@pytest.mark.parametrize("name", nichechain.__all__)
def test_every_public_name_is_there(name: str) -> None:
    assert getattr(nichechain, name) is getattr(nichechain, name)
    assert name in dir(nichechain)


def test_a_name_that_is_not_there() -> None:
    with pytest.raises(AttributeError, match="'nichechain' has no attribute 'l_evolution'"):
        nichechain.l_evolution  # noqa: B018
