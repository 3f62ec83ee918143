from pathlib import Path

import pytest

from nichechain import BuildConfig, Threads, build, domains


@pytest.fixture(scope="session")
def archive_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small archive of the arm."""
    folder = tmp_path_factory.mktemp("arm") / "archive"
    arm = domains.make("arm")
    config = BuildConfig(domain="arm", shape=(5, 5), bounds=arm.bounds, evaluations=300)
    with Threads(1) as threads:
        build(config, folder, threads)
    return folder
