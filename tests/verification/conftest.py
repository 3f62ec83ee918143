"""A small archive of a domain that sometimes fails, and a forgery of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from nichechain.archive.archive import Archive, load
from nichechain.archive.building import build
from nichechain.execution import Threads
from nichechain.search.config import BuildConfig

from ..arms import RoughArm
from .forgeries import Forgery

# 333 births end in the middle of a step, so children are pending.
CONFIG = BuildConfig(
    "arm",
    (6, 5),
    ((-0.7, 1.0), (-0.9, 0.8)),
    evaluations=333,
    initial=50,
    batch=32,
    scale=0.3,
    seed=5,
    lineage_brood=2,
)


def built(folder: Path, config: BuildConfig = CONFIG) -> Archive:
    """Build, and open what was built."""
    with Threads(1) as executor:
        build(config, folder, executor, domain=RoughArm())
    return load(folder, domain=RoughArm())


@pytest.fixture(scope="session")
def genuine(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return built(tmp_path_factory.mktemp("genuine") / "archive")


@pytest.fixture
def forgery(genuine: Archive) -> Forgery:
    return Forgery(genuine)
