"""What all tests share."""

import signal

import pytest
from hypothesis import settings

import nichechain as nc

# Tests assert numbers, not speed: a busy machine fails none of them.
settings.register_profile("nichechain", deadline=None)
settings.load_profile("nichechain")

# A shell makes what it runs in the background deaf to Ctrl-C, and that is inherited.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let ``pytest --refresh-docs tests/test_docs.py`` write what blocks print into their pages."""
    parser.addoption("--refresh-docs", action="store_true", help="rewrite the outputs shown in the docs")


@pytest.fixture(scope="session")
def arm_archive(tmp_path_factory: pytest.TempPathFactory) -> nc.Archive:
    """A small archive of the arm, to read from."""
    folder = tmp_path_factory.mktemp("shared") / "arm"
    config = nc.BuildConfig("arm", (6, 9), ((-1, 1), (-1, 1)), evaluations=800, scale=0.5)
    with nc.Threads(1) as threads:
        nc.build(config, folder, threads)
    return nc.load(folder)
